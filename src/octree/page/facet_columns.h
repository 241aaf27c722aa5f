// Columns of the facets of a page's nodes. docs/format.md, "Node-group page", has the bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "octree/node/node.h"
#include "octree/page/byte_planes.h"
#include "octree/page/page_form.h"

namespace surfeit {

// One object per thread at a time. To write, or to pass over what was written: nodes go in one
// after the other.
class FacetColumns {
 public:
  FacetColumns();
  void add(const Node& node);

  // Numbers of facets and all of them but light, and this.
  void put(PayloadWriter& writer, const PageForm& form) const;
  void putLight(PayloadWriter& writer, const PageForm& form) const;
  // Takes what put() gives for as many nodes and facets; false when it ends early.
  bool pass(PayloadReader& reader, const PageForm& form) const;

  // Gives nodes their facets: flags and child counts are there. False when the columns end early,
  // or cannot be those of such nodes. First get(), then getLight().
  static bool get(PayloadReader& reader, std::span<Node> nodes, const PageForm& form);
  static bool getLight(PayloadReader& reader, std::span<Node> nodes, const PageForm& form);

 private:
  std::vector<std::uint8_t>& counts_;
  std::vector<NodeFacet>& facets_;
  std::vector<RadiositySlope>& slopes_;  // of all pieces, flat nodes as well
  std::vector<std::uint8_t>& hidden_;  // of the pieces of nodes of which some is
};

}  // namespace surfeit
