// How surfels and nodes are stored on their pages.
#pragma once

namespace surfeit {

// From the header of a scene (SceneHeader::pageForm).
struct PageForm {
  bool full_precision = false;  // floats instead of quantized values
  // Columns that only some files have
  bool has_albedo = false;
  bool has_groups = false;
  bool has_long_sides = false;
  bool has_bounds = true;      // slabs and cones of nodes: since format version 2
  bool has_opacity = false;    // since format version 3
  bool has_lobes = false;      // since format version 4
  bool has_tints = false;      // of what has an opacity
  bool has_variances = false;  // of the radiosities of nodes
  bool has_slopes = false;     // of the radiosities of their pieces

  // Of these pages with other radiosities, whatever they had.
  PageForm relit() const {
    PageForm form = *this;
    form.has_variances = form.has_slopes = true;
    return form;
  }
};

}  // namespace surfeit
