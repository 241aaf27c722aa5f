#include "surfels/generated/scene_recipe.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <set>
#include <utility>

#include "cloud/rows/row_layout.h"
#include "core/surfel_limits.h"

namespace surfeit {
namespace {

constexpr std::string_view kVersion = "1";

constexpr std::pair<SceneKind, const char*> kKindNames[] = {
    {SceneKind::kTerrain, "terrain"}, {SceneKind::kCity, "city"}, {SceneKind::kVolume, "volume"}};
constexpr std::pair<RecordOrder, const char*> kOrderNames[] = {
    {RecordOrder::kScan, "scan"}, {RecordOrder::kShuffled, "shuffled"}};

template <typename T, std::size_t kCount>
const char* nameOf(const std::pair<T, const char*> (&names)[kCount], T value) {
  for (const auto& [named, name] : names) {
    if (named == value) return name;
  }
  return "";
}

template <typename T, std::size_t kCount>
Result<T> valueOf(const std::pair<T, const char*> (&names)[kCount], std::string_view name,
                  const char* expected) {
  for (const auto& [named, its_name] : names) {
    if (name == its_name) return named;
  }
  return Status::invalidArgument(fmt::format("found {}, expected {}", quoteText(name), expected));
}

// A whole number or a decimal, and nothing behind it.
template <typename T>
Status parseNumber(std::string_view text, const char* expected, T& value) {
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || rest != end) {
    return Status::invalidArgument(fmt::format("found {}, expected {}", quoteText(text), expected));
  }
  return {};
}

// Sets the value of a key.
Status setValue(std::string_view key, std::string_view text, SceneRecipe& recipe) {
  if (key == "kind") {
    SURFEIT_ASSIGN_OR_RETURN(recipe.kind, parseSceneKind(text));
    return {};
  }
  if (key == "order") {
    SURFEIT_ASSIGN_OR_RETURN(recipe.order, parseRecordOrder(text));
    return {};
  }
  if (key == "part") return parseScenePart(text, recipe);
  if (key == "surfels") return parseNumber(text, "a whole number", recipe.surfels);
  if (key == "seed") return parseNumber(text, "a whole number", recipe.seed);
  if (key == "outlier") return parseNumber(text, "metres", recipe.outlier_distance);
  if (key == "duplicates") return parseNumber(text, "a percentage", recipe.duplicate_percent);
  return Status::invalidArgument(
      "unknown key, expected kind, surfels, seed, order, part, outlier or duplicates");
}

// The next line, without its end; takes it off `text`.
std::string_view takeLine(std::string_view& text) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  return line;
}

}  // namespace

const char* sceneKindName(SceneKind kind) { return nameOf(kKindNames, kind); }
const char* recordOrderName(RecordOrder order) { return nameOf(kOrderNames, order); }

Result<SceneKind> parseSceneKind(std::string_view name) {
  return valueOf(kKindNames, name, "terrain, city or volume");
}

Result<RecordOrder> parseRecordOrder(std::string_view name) {
  return valueOf(kOrderNames, name, "scan or shuffled");
}

Result<std::uint64_t> parseSurfelCount(std::string_view text) {
  constexpr std::pair<std::string_view, double> kUnits[] = {{"", 1},    {"k", 1e3}, {"K", 1e3},
                                                            {"M", 1e6}, {"G", 1e9}, {"T", 1e12}};
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto [unit_begin, error] = std::from_chars(text.data(), end, value);
  const std::string_view unit = text.substr(static_cast<std::size_t>(unit_begin - text.data()));
  double factor = 0;
  for (const auto& [name, its_factor] : kUnits) {
    if (unit == name) factor = its_factor;
  }
  const double count = std::round(value * factor);
  const bool is_whole = std::abs(count - value * factor) <= 1e-12 * count;  // 1.005k is rounded
  if (error != std::errc() || !is_whole || !(count >= 1 && count <= double(kMaxRecipeSurfels))) {
    return Status::invalidArgument(
        fmt::format("found {}, expected a whole number of 1 to 2^40, such as 500k, 10M, 1G or 4096",
                    quoteText(text)));
  }
  return static_cast<std::uint64_t>(count);
}

Status parseScenePart(std::string_view text, SceneRecipe& recipe) {
  constexpr const char* kExpected = "a part such as 2/5";
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) {
    return Status::invalidArgument(
        fmt::format("found {}, expected {}", quoteText(text), kExpected));
  }
  SURFEIT_RETURN_IF_ERROR(parseNumber(text.substr(0, slash), kExpected, recipe.part));
  return parseNumber(text.substr(slash + 1), kExpected, recipe.part_count);
}

Status checkSceneRecipe(const SceneRecipe& recipe) {
  if (recipe.surfels < 1 || recipe.surfels > kMaxRecipeSurfels) {
    return Status::invalidArgument(fmt::format("surfels {}: expected 1 to 2^40", recipe.surfels));
  }
  if (recipe.part < 1 || recipe.part > recipe.part_count) {
    return Status::invalidArgument(
        fmt::format("part {}/{}: expected K/N with 1 <= K <= N", recipe.part, recipe.part_count));
  }
  if (!(recipe.outlier_distance >= 0 && recipe.outlier_distance <= double(kLargestLength) / 2)) {
    return Status::invalidArgument(
        fmt::format("outlier {}: expected 0 to 5e11", recipe.outlier_distance));
  }
  if (!(recipe.duplicate_percent >= 0 && recipe.duplicate_percent <= 100)) {
    return Status::invalidArgument(
        fmt::format("duplicates {}: expected 0 to 100", recipe.duplicate_percent));
  }
  return {};
}

std::string formatSceneRecipe(const SceneRecipe& recipe) {
  std::string text = fmt::format("{}{}\nkind {}\nsurfels {}\nseed {}\norder {}\n", kRecipeMagic,
                                 kVersion, sceneKindName(recipe.kind), recipe.surfels, recipe.seed,
                                 recordOrderName(recipe.order));
  if (recipe.part_count > 1) text += fmt::format("part {}/{}\n", recipe.part, recipe.part_count);
  if (recipe.outlier_distance > 0) text += fmt::format("outlier {}\n", recipe.outlier_distance);
  if (recipe.duplicate_percent > 0) {
    text += fmt::format("duplicates {}\n", recipe.duplicate_percent);
  }
  return text;
}

Result<SceneRecipe> parseSceneRecipe(std::string_view text, const std::string& path) {
  // The first line says what this is
  const std::string_view first = takeLine(text);
  if (!first.starts_with(kRecipeMagic) || first.substr(kRecipeMagic.size()) != kVersion) {
    return Status::corruption(fmt::format("{}: line 1: found {}, expected '{}{}'", path,
                                          quoteText(first), kRecipeMagic, kVersion));
  }

  // A key and a value a line; blank lines and comments are skipped
  SceneRecipe recipe;
  std::set<std::string, std::less<>> keys;
  for (int number = 2; !text.empty(); ++number) {
    const std::string_view line = takeLine(text);
    if (line.empty() || line.front() == '#') continue;
    const std::size_t blank = std::min(line.find(' '), line.size());
    const std::string_view key = line.substr(0, blank);
    const std::string_view value = line.substr(std::min(blank + 1, line.size()));
    Status status = keys.emplace(key).second ? setValue(key, value, recipe)
                                             : Status::invalidArgument("found a second time");
    if (status.ok()) status = checkSceneRecipe(recipe);
    if (!status.ok()) {
      return Status::corruption(
          fmt::format("{}: line {}: {}: {}", path, number, quoteText(key), status.message()));
    }
  }
  for (const char* key : {"kind", "surfels"}) {
    if (!keys.contains(key)) {
      return Status::corruption(fmt::format("{}: found no line '{} ...'", path, key));
    }
  }
  return recipe;
}

}  // namespace surfeit
