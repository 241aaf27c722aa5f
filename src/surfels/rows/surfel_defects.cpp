#include "surfels/rows/surfel_defects.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <string_view>
#include <vector>

#include "cloud/rows/surfel_names.h"
#include "core/assert.h"

namespace surfeit {
namespace {

struct KindName {
  SurfelDefects::Kind SurfelDefects::*kind;
  const char* name;
};

constexpr KindName kKindNames[] = {
    {&SurfelDefects::non_finite, "a non-finite value"},
    {&SurfelDefects::bad_radius, "a radius that is not positive"},
    {&SurfelDefects::bad_area, "an area that is not positive"},
    {&SurfelDefects::short_normal, "a normal too short to point"},
    {&SurfelDefects::negative_color, "a negative radiosity or albedo"},
    {&SurfelDefects::out_of_range, "a value too large to calculate with"},
    {&SurfelDefects::bad_group, "a group that is not 0 to 63"},
    {&SurfelDefects::bad_opacity, "an opacity that is not above 0 and at most 1"},
};

}  // namespace

std::string_view channelToDrop(std::string_view property) {
  const auto is_in = [property](const auto& names) {
    return std::find(std::begin(names), std::end(names), property) != std::end(names);
  };
  if (property.empty() || is_in(kPositionNames)) return {};
  if (is_in(kNormalNames) || property.starts_with("length of")) return "normal";
  if (is_in(kColorNames)) return "color";
  if (is_in(kRadiosityNames)) return "radiosity";
  if (is_in(kAlbedoNames)) return "albedo";
  if (is_in(kLongSideNames)) return "long_side";
  return property;
}

void SurfelDefects::Kind::add(std::uint64_t record, const char* bad_property, double bad_value,
                              const std::string& drops_of_property) {
  if (count == 0 || record < first_record) {
    first_record = record;
    property = bad_property;
    value = bad_value;
    drops = drops_of_property;
  }
  ++count;
}

std::string SurfelDefects::Kind::describe(const char* what) const {
  const std::string_view name = property;
  return fmt::format("{} record{} with {} (first: record {}{})", count, count == 1 ? "" : "s", what,
                     first_record,
                     name.empty() ? "" : fmt::format(", whose {} is {:.6g}", name, value));
}

std::uint64_t SurfelDefects::total() const {
  std::uint64_t sum = 0;
  for (const KindName& row : kKindNames) sum += (this->*row.kind).count;
  return sum;
}

std::uint64_t SurfelDefects::firstRecord() const {
  SURFEIT_ASSERT(total() > 0);
  std::uint64_t first = std::numeric_limits<std::uint64_t>::max();
  for (const KindName& row : kKindNames) {
    const Kind& kind = this->*row.kind;
    if (kind.count > 0) first = std::min(first, kind.first_record);
  }
  return first;
}

void SurfelDefects::add(const SurfelDefects& other) {
  for (const KindName& row : kKindNames) {
    Kind& kind = this->*row.kind;
    const Kind& more = other.*row.kind;
    if (more.count == 0) continue;
    const std::uint64_t count = kind.count + more.count;
    if (kind.count == 0 || more.first_record < kind.first_record) kind = more;
    kind.count = count;
  }
}

std::string SurfelDefects::describeKinds() const {
  std::string text;
  for (const KindName& row : kKindNames) {
    const Kind& kind = this->*row.kind;
    if (kind.count == 0) continue;
    text += fmt::format("{}{}", text.empty() ? "" : ", ",
                        kind.describe(std::string_view(kind.property) == "coverage"
                                          ? "a coverage that is not above 0 and at most 1"
                                          : row.name));
  }
  return text;
}

std::string SurfelDefects::wayOut() const {
  std::vector<std::string> drops;
  bool lacks_place = false, is_made = false;
  for (const KindName& row : kKindNames) {
    const Kind& kind = this->*row.kind;
    const bool has_property = kind.count > 0 && kind.property[0] != '\0' && kind.drops.empty();
    const bool is_place = channelToDrop(kind.property).empty();
    lacks_place = lacks_place || (has_property && is_place);
    is_made = is_made || (has_property && !is_place);
    const bool is_known = std::find(drops.begin(), drops.end(), kind.drops) != drops.end();
    if (!kind.drops.empty() && !is_known) drops.push_back(kind.drops);
  }
  if (drops.empty()) {
    if (lacks_place) {
      return "; a record without a place is no surfel: --filter leaves such records out";
    }
    return is_made
               ? "; such values follow from others, which --channels cannot leave out: --filter "
                 "leaves such records out"
               : "";
  }
  return fmt::format("; --channels {} reads such records without {}, convert --set changes values",
                     fmt::join(drops, ","), drops.size() > 1 ? "these" : "it");
}

}  // namespace surfeit
