// A node group: consecutive nodes of one octree level along the curve, siblings side by side,
// stored as one page. docs/format.md, "Node-group page", has the byte layout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/spherical_harmonics.h"
#include "octree/node/lobe.h"
#include "octree/node/node.h"
#include "octree/page/page_form.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// The angle of a cone that holds every normal.
inline constexpr float kUnknownAngle = kPi;

// A node on its way to a page: its `page` counts within the level of its children, because where
// that level's pages begin is known only when all are written.
// Without padding, for shards store it as it is.
struct LevelNode {
  Node node;
  std::uint8_t child_level = 0;  // of an interior node; 0 for a leaf
  std::uint8_t reserved[3] = {};
  // Of Node::normal_cosine, of which nothing is known as yet: a cosine says little of small angles.
  float normal_angle = kUnknownAngle;
  std::uint16_t marks = 0;  // kSurfelMarks of the surfels below
  std::uint16_t reserved_end[3] = {};
};
static_assert(sizeof(LevelNode) == sizeof(Node) + 16);

// What references of a group may point at; from the header.
struct NodeLimits {
  std::span<const std::uint32_t> level_first_page;  // levels 0..21 and the end: 23 values
  std::uint32_t surfel_page_count = 0;
  std::uint32_t node_group_capacity = 0;
  std::uint32_t surfel_group_capacity = 0;
};

// The payload of a page with these nodes (at least one), replaced. Returns how many bytes at its
// front are worth compressing, for compressPage. Safe from any thread.
std::size_t encodeNodeGroup(std::span<const LevelNode> nodes, const PageForm& form,
                            std::vector<std::byte>& payload);

// Decodes node page number `page` into `nodes` (the file's group capacity) and returns how many
// there are. Children always lie on a deeper level, so that damaged links cannot form a loop. Their
// lobes, where the page has some, go to `lobes`, as many as nodes, or empty: to nobody. Safe on
// arbitrary bytes; kCorruption names the field, but not the file.
Result<std::uint32_t> decodeNodeGroup(Bytes payload, const PageForm& form, std::uint32_t page,
                                      const NodeLimits& limits, std::span<Node> nodes,
                                      std::span<NodeLobes> lobes = {});

// The payload of the same page with the radiosity and, for rough nodes, the power coefficients of
// `nodes`; of the rest area and flags must be as decoded. All other columns keep their bytes, but
// for lobes: the page has those given, one for each node, or none when they are empty. Returns as
// encodeNodeGroup; errors as decodeNodeGroup. `replaced` is not `payload`.
Result<std::size_t> replaceNodeRadiosity(Bytes payload, const PageForm& form,
                                         std::span<const Node> nodes,
                                         std::vector<std::byte>& replaced,
                                         std::span<const NodeLobes> lobes = {});

}  // namespace surfeit
