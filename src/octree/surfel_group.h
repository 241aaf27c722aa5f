// A surfel group: a run of surfels of neighbouring leaves along the curve, stored as one page.
// docs/format.md, "Surfel-group page", has the byte layout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/file.h"
#include "octree/page_form.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// How much a surfel may differ when it is read back. Radius: as a part of it, half a step of the
// largest shift. Normal: half a step of the octahedral map where it is widest, sqrt(3) times
// sqrt(6) / 65534 radians. docs/format.md, "Columns".
inline constexpr double kRadiusLoss = 0x1p-11, kNormalLoss = 7e-5;
// Position: 1/1000 of the radius, and far from the origin what the nearest float adds, which is no
// more than there is to round.
double positionLoss(const Surfel& surfel);
// Radius of a sphere around its position that holds the surfel when it is read back.
float radiusWithLoss(const Surfel& surfel);

// The payload of a page with these surfels (at least one), replaced. Returns how many bytes at its
// front are worth compressing, for compressPage. Safe from any thread.
std::size_t encodeSurfelGroup(std::span<const Surfel> surfels, const PageForm& form,
                              std::vector<std::byte>& payload);

// Decodes into `surfels` (the file's group capacity) and returns how many there are. Safe on
// arbitrary bytes; kCorruption names the field, but not the file.
Result<std::uint32_t> decodeSurfelGroup(Bytes payload, const PageForm& form,
                                        std::span<Surfel> surfels);

// The payload of the same page with other radiosities, one per surfel: all other columns keep their
// bytes. Returns as encodeSurfelGroup; errors as decodeSurfelGroup. `replaced` is not `payload`.
Result<std::size_t> replaceSurfelRadiosity(Bytes payload, const PageForm& form,
                                           std::span<const glm::vec3> radiosity,
                                           std::vector<std::byte>& replaced);

}  // namespace surfeit
