// A cloud with the values of a brick map at its surfels, so that whatever shows channels shows
// these: the counterpart of a shader's texture3d().
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "surfeit/status.h"
#include "view/cloud_rows.h"

namespace surfeit {

// Memory that look-ups take.
inline constexpr std::uint64_t kBrickRowsBytes = std::uint64_t{64} << 20;

// The rows of `rows` with the properties of the brick map's channels, which take the place of those
// of the same name. Values are looked up at position and normal of a row, over `filter_width`, or
// over twice its radius (0 without one); NaN where there are none. Errors as BrickMap::open.
Result<std::unique_ptr<CloudRows>> addBrickValues(std::unique_ptr<CloudRows> rows,
                                                  const std::string& brick_path,
                                                  std::optional<double> filter_width);

}  // namespace surfeit
