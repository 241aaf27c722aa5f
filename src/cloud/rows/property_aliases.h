// What properties of formats without typed channels (PLY, PCD, text) are called by other programs,
// and what is called so that it may be a color or a normal.
#pragma once

#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"

namespace surfeit {

// The name of every property as rows have it (docs/files.md, "Names of properties"): X is x,
// diffuse_red, r, Rf and scalar_R are red, normal_x and NormalX are nx. Upper and lower case are
// told apart only where the element has both. A triple gets our names only when it is complete and
// the element has none of them; of several such triples the first of our table. Names that we do
// not know, and those of lists, stay as they are.
std::vector<std::string> knownNames(const RowLayout& element);

// One sentence for each property, or triple of them, that is called like a color, a normal, a size
// or an opacity, but is not read as one, with the --channels that reads it.
struct LackingChannels {
  bool color = false, normal = false, size = false, opacity = false;
};
std::vector<std::string> notesOfLookalikes(const RowLayout& element,
                                           const LackingChannels& lacking);

}  // namespace surfeit
