// Names of the properties that come in threes, as clouds have them and as we write them.
#pragma once

namespace surfeit {

inline constexpr const char* kPositionNames[3] = {"x", "y", "z"};
inline constexpr const char* kNormalNames[3] = {"nx", "ny", "nz"};
inline constexpr const char* kRadiosityNames[3] = {"radiosity_r", "radiosity_g", "radiosity_b"};
inline constexpr const char* kAlbedoNames[3] = {"albedo_r", "albedo_g", "albedo_b"};
inline constexpr const char* kColorNames[3] = {"red", "green", "blue"};

}  // namespace surfeit
