// A surfel group: a run of surfels of neighbouring leaves along the curve, stored as one page.
// docs/format.md, "Surfel-group page", has the byte layout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/node/lobe.h"
#include "octree/node/stored_loss.h"
#include "octree/page/page_form.h"
#include "storage/file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// The payload of a page with these surfels (at least one), replaced. Returns how many bytes at its
// front are worth compressing, for compressPage. Safe from any thread.
std::size_t encodeSurfelGroup(std::span<const Surfel> surfels, const PageForm& form,
                              std::vector<std::byte>& payload);

// Decodes into `surfels` (the file's group capacity) and returns how many there are. Their lobes,
// where the page has some, go to `lobes`, as many, or empty: to nobody. Safe on arbitrary bytes;
// kCorruption names the field, but not the file.
Result<std::uint32_t> decodeSurfelGroup(Bytes payload, const PageForm& form,
                                        std::span<Surfel> surfels, std::span<Lobe> lobes = {});

// The payload of the same page with other radiosities, one per surfel, and these lobes, one per
// surfel, or none when they are empty: all other columns keep their bytes. Returns as
// encodeSurfelGroup; errors as decodeSurfelGroup. `replaced` is not `payload`.
Result<std::size_t> replaceSurfelRadiosity(Bytes payload, const PageForm& form,
                                           std::span<const glm::vec3> radiosity,
                                           std::vector<std::byte>& replaced,
                                           std::span<const Lobe> lobes = {});

}  // namespace surfeit
