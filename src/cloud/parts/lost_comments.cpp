#include "cloud/parts/lost_comments.h"

#include <fmt/format.h>

#include <cstddef>

#include "core/crs_comment.h"
#include "core/group_comment.h"
#include "core/up_comment.h"

namespace surfeit {

std::vector<std::string> notesOfLostComments(std::string_view format,
                                             std::span<const std::string> comments,
                                             bool keeps_crs) {
  std::size_t names = 0, others = 0;
  bool loses_crs = false;
  for (const std::string& comment : comments) {
    const bool is_crs = comment.starts_with(kCrsComment);
    if (statedUpAxis(std::span(&comment, 1)) || (is_crs && keeps_crs)) continue;
    const bool is_name = statedGroupName(comment).has_value();
    ++(is_name ? names : others);
    loses_crs = loses_crs || is_crs;
  }
  std::vector<std::string> notes;
  if (names > 0) {
    notes.push_back(
        fmt::format("{} has no place for the names of object groups: they stay numbers", format));
  }
  if (others > 0) {
    notes.push_back(fmt::format("{} has no place for comments: {} are not kept{}", format, others,
                                loses_crs ? ", the coordinate reference system among them" : ""));
  }
  return notes;
}

}  // namespace surfeit
