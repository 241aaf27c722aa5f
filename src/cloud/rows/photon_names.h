// Names of the properties that only photon clouds have (docs/photons.md); the others are those of
// surfel clouds.
#pragma once

namespace surfeit {

inline constexpr const char* kPowerNames[3] = {"power_r", "power_g", "power_b"};
inline constexpr const char* kIncidentNames[3] = {"incident_x", "incident_y", "incident_z"};

}  // namespace surfeit
