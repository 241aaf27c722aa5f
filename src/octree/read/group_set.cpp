#include "octree/read/group_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>

namespace surfeit {
namespace {

// Groups first to last, both in the set.
std::uint64_t groupRange(std::uint32_t first, std::uint32_t last) {
  return kAllGroups << first & kAllGroups >> (kMaxGroups - 1 - last);
}

// All of `text` as a group.
bool parseGroup(std::string_view text, std::uint32_t& group) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, group);
  return error == std::errc() && stop == end && group < kMaxGroups;
}

}  // namespace

std::string describeGroups(std::uint64_t groups) {
  std::string text;
  while (groups != 0) {
    const auto first = static_cast<std::uint32_t>(std::countr_zero(groups));
    const auto count = static_cast<std::uint32_t>(std::countr_one(groups >> first));
    const std::uint32_t shown = count >= 3 ? count : 1;
    const std::uint32_t last = first + shown - 1;
    text += text.empty() ? "" : ",";
    text += shown > 1 ? fmt::format("{}-{}", first, last) : fmt::format("{}", first);
    groups &= ~groupRange(first, last);
  }
  return text.empty() ? "none" : text;
}

Result<std::uint64_t> parseGroups(std::string_view text) {
  std::uint64_t groups = 0;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view part = text.substr(begin, end - begin);
    const std::size_t dash = part.find('-');
    std::uint32_t first = 0, last = 0;
    bool is_valid = parseGroup(part.substr(0, dash), first);
    last = first;
    if (dash != std::string_view::npos) is_valid &= parseGroup(part.substr(dash + 1), last);
    if (!is_valid || last < first) {
      return Status::invalidArgument(fmt::format(
          "found \"{}\" in \"{}\", expected groups from 0 to {} and ranges of them, as 0,2-5", part,
          text, kMaxGroups - 1));
    }
    groups |= groupRange(first, last);
    begin = end + 1;
  }
  return groups;
}

Status checkGroups(const SceneFile& scene, std::uint64_t groups) {
  if (groups == kAllGroups) return {};
  if (!scene.header().channels.group) {
    return Status::corruption(
        fmt::format("{}: found no groups, expected one for every surfel, to choose {} from: index "
                    "clouds with an integer property group, 0 to {}",
                    scene.path(), describeGroups(groups), kMaxGroups - 1));
  }
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t present, scene.readGroups());
  if ((present & groups) != 0) return {};
  return Status::invalidArgument(
      fmt::format("{}: found groups {}, expected one of those chosen: {}", scene.path(),
                  describeGroups(present), describeGroups(groups)));
}

}  // namespace surfeit
