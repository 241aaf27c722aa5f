#include "tools/look_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <string_view>
#include <utility>

#include "surfeit/group_names.h"
#include "surfeit/scene.h"
#include "surfeit/surfel.h"
#include "tools/number_list.h"

namespace surfeit {
namespace {

constexpr const char* kLookGroup = "Look of bounce light";
constexpr const char* kBounceFilter = "--bounce-filter";
constexpr double kMostLookFactor = 1e6;
constexpr const char* kGlossy = "--glossy";
constexpr double kLeastRoughness = 0.05;

// Numbers from 0 to kMostLookFactor.
template <std::size_t N>
std::array<float, N> parseFactors(const std::string& option, std::string_view text,
                                  std::string_view expected) {
  const std::array<double, N> numbers = parseNumberList<N>(option, text, expected);
  std::array<float, N> factors{};
  for (std::size_t i = 0; i < N; ++i) {
    if (!(numbers[i] >= 0 && numbers[i] <= kMostLookFactor)) {
      throw CLI::ValidationError(option, fmt::format("found \"{}\", expected {}", text, expected));
    }
    factors[i] = float(numbers[i]);
  }
  return factors;
}

float parseFactor(const std::string& option, std::string_view text) {
  return parseFactors<1>(option, text, "a factor from 0 to 1e6")[0];
}

glm::vec3 parseTint(const std::string& option, std::string_view text) {
  const auto tint = parseFactors<3>(option, text, "r,g,b, factors from 0 to 1e6");
  return {tint[0], tint[1], tint[2]};
}

// The words of a filter, "key=value", by key; each once.
std::map<std::string, std::string, std::less<>> filterWords(const std::string& text) {
  constexpr std::array<std::string_view, 7> kKeys = {"centre", "radius",     "direction", "angle",
                                                     "gain",   "saturation", "tint"};
  std::map<std::string, std::string, std::less<>> words;
  std::size_t at = 0;
  while ((at = text.find_first_not_of(" \t", at)) != text.npos) {
    const std::size_t end = std::min(text.find_first_of(" \t", at), text.size());
    const std::string word = text.substr(at, end - at);
    at = end;
    const std::size_t equals = word.find('=');
    const std::string key = word.substr(0, equals);
    if (equals == word.npos || std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end()) {
      throw CLI::ValidationError(
          kBounceFilter, fmt::format("found \"{}\" in \"{}\", expected words such as gain=.5: {}",
                                     word, text, fmt::join(kKeys, ", ")));
    }
    if (!words.emplace(key, word.substr(equals + 1)).second) {
      throw CLI::ValidationError(kBounceFilter, fmt::format("found {} twice in \"{}\"", key, text));
    }
  }
  return words;
}

// Fills `inner` and `outer` of a fall from "1,4", or "4" where there is no fall.
void parseFall(const std::string& key, const std::string& text, double unit, double most,
               float& inner, float& outer) {
  const bool has_two = text.find(',') != text.npos;
  const std::string expected =
      fmt::format("{0}=INNER,OUTER or {0}=BOTH, from 0, the outer one not smaller", key);
  const std::array<double, 2> ends =
      has_two ? parseNumberList<2>(kBounceFilter, text, expected)
              : std::array<double, 2>{parseNumberList<1>(kBounceFilter, text, expected)[0],
                                      parseNumberList<1>(kBounceFilter, text, expected)[0]};
  if (!(ends[0] >= 0 && ends[1] >= ends[0] && ends[1] <= most)) {
    throw CLI::ValidationError(kBounceFilter,
                               fmt::format("found {}={}, expected {}", key, text, expected));
  }
  inner = float(unit * ends[0]);
  outer = float(unit * ends[1]);
}

BounceFilter parseBounceFilter(const std::string& text) {
  const auto words = filterWords(text);
  const auto has = [&words](std::string_view key) { return words.find(key) != words.end(); };
  const auto of = [&words](std::string_view key) { return words.find(key)->second; };
  const auto refuse = [&text](const char* what) {
    return CLI::ValidationError(kBounceFilter, fmt::format("found \"{}\": {}", text, what));
  };
  if (has("centre") != has("radius")) throw refuse("centre and radius need each other");
  if (has("direction") != has("angle")) throw refuse("direction and angle need each other");
  if (!has("centre") && !has("direction")) {
    throw refuse(
        "neither a centre nor a direction; --bounce-gain, --bounce-saturation and "
        "--bounce-tint work everywhere");
  }
  if (!has("gain") && !has("saturation") && !has("tint")) {
    throw refuse("changes nothing; expected gain, saturation or tint");
  }
  BounceFilter filter;
  if (has("centre")) {
    const auto at = parseNumberList<3>(kBounceFilter, of("centre"), "centre=x,y,z");
    filter.centre = {at[0], at[1], at[2]};
    parseFall("radius", of("radius"), 1, 1e30, filter.inner_radius, filter.outer_radius);
  }
  if (has("direction")) {
    const auto to = parseNumberList<3>(kBounceFilter, of("direction"), "direction=x,y,z");
    filter.direction = {float(to[0]), float(to[1]), float(to[2])};
    if (filter.direction == glm::vec3(0)) throw refuse("the direction is zero");
    constexpr double kDegree = std::numbers::pi / 180;
    parseFall("angle", of("angle"), kDegree, 180, filter.inner_angle, filter.outer_angle);
  }
  if (has("gain")) filter.correction.gain = parseFactor(kBounceFilter, of("gain"));
  if (has("saturation"))
    filter.correction.saturation = parseFactor(kBounceFilter, of("saturation"));
  if (has("tint")) filter.correction.tint = parseTint(kBounceFilter, of("tint"));
  return filter;
}

// ".8" or ".8,.2"
GroupGloss parseGloss(const std::string& text) {
  constexpr const char* kExpected = "SHARE or SHARE,ROUGHNESS: 0 to 1, and .05 to 1";
  GroupGloss gloss;
  const bool has_two = text.find(',') != text.npos;
  std::array<double, 2> numbers = {0, double(gloss.roughness)};
  if (has_two) {
    numbers = parseNumberList<2>(kGlossy, text, kExpected);
  } else {
    numbers[0] = parseNumberList<1>(kGlossy, text, kExpected)[0];
  }
  const bool is_valid =
      numbers[0] >= 0 && numbers[0] <= 1 && numbers[1] >= kLeastRoughness && numbers[1] <= 1;
  if (!is_valid) {
    throw CLI::ValidationError(kGlossy, fmt::format("found \"{}\", expected {}", text, kExpected));
  }
  gloss.share = float(numbers[0]);
  gloss.roughness = float(numbers[1]);
  return gloss;
}

// Repeatable; the words of each are one value.
CLI::Option* addRepeated(CLI::App& command, const std::string& name,
                         std::function<void(const std::vector<std::string>&)> parse,
                         const std::string& type, const std::string& description) {
  return command.add_option_function<std::vector<std::string>>(name, std::move(parse), description)
      ->type_name(type)
      ->type_size(1)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group(kLookGroup);
}

// "lamp,tree=.5": the groups, and what stands behind the last sign.
Result<std::pair<std::uint64_t, std::string>> splitGroups(const std::string& option,
                                                          const std::string& text,
                                                          const std::vector<GroupName>& names) {
  const std::size_t equals = text.rfind('=');
  if (equals == text.npos) {
    return Status::invalidArgument(fmt::format(
        "{}: found \"{}\", expected GROUPS=VALUE, such as walls=.5 or 2,5-7=.5", option, text));
  }
  const std::string groups = text.substr(0, equals);
  // Lists of numbers need no names
  Result<std::uint64_t> set = parseGroups(groups);
  if (!set.ok()) set = parseGroupNames(groups, names);
  if (!set.ok()) return Status::invalidArgument(option + ": " + set.status().message());
  return std::pair(*set, text.substr(equals + 1));
}

// Calls set(group, value) for each group of each "GROUPS=VALUE"; no group twice.
template <typename Set>
Status forEachGroup(const std::string& option, const std::vector<std::string>& texts,
                    const std::vector<GroupName>& names, Set&& set) {
  std::uint64_t seen = 0;
  for (const std::string& text : texts) {
    SURFEIT_ASSIGN_OR_RETURN(const auto split, splitGroups(option, text, names));
    if ((seen & split.first) != 0) {
      return Status::invalidArgument(
          fmt::format("{}: \"{}\" has a group that another value has", option, text));
    }
    seen |= split.first;
    try {
      for (std::uint32_t group = 0; group < kMaxGroups; ++group) {
        if ((split.first & groupBit(group)) != 0) set(group, split.second);
      }
    } catch (const CLI::ValidationError& error) {
      return Status::invalidArgument(error.what());
    }
  }
  return {};
}

}  // namespace

void addLookOptions(CLI::App& command, BounceLook& look) {
  ColorCorrection& correction = look.correction;
  command.add_option("--bounce-gain", correction.gain, "Factor of all bounce light")
      ->check(CLI::Range(0.0, kMostLookFactor))
      ->capture_default_str()
      ->group(kLookGroup);
  command
      .add_option("--bounce-saturation", correction.saturation,
                  "Saturation of all bounce light; 0: grey, 1: as it is")
      ->check(CLI::Range(0.0, kMostLookFactor))
      ->capture_default_str()
      ->group(kLookGroup);
  command
      .add_option_function<std::string>(
          "--bounce-tint",
          [&correction](const std::string& text) {
            correction.tint = parseTint("--bounce-tint", text);
          },
          "Factors of red, green and blue of all bounce light")
      ->type_name("R,G,B")
      ->group(kLookGroup);
  addRepeated(
      command, kBounceFilter,
      [&look](const std::vector<std::string>& texts) {
        look.filters.clear();
        for (const std::string& text : texts) look.filters.push_back(parseBounceFilter(text));
      },
      "\"KEY=VALUE ...\"",
      "Corrects bounce light by gain, saturation, tint within radius=INNER,OUTER of centre=X,Y,Z, "
      "or where normals lie within angle=INNER,OUTER degrees of direction=X,Y,Z, or both; it fades "
      "from inner to outer. Repeatable, in their order");
}

void addGroupLookOptions(CLI::App& command, GroupLookArguments& arguments) {
  const auto add = [&command](const std::string& name, std::vector<std::string>& values,
                              const std::string& type, const std::string& description) {
    addRepeated(
        command, name, [&values](const std::vector<std::string>& texts) { values = texts; }, type,
        description);
  };
  add("--group-gain", arguments.gains, "GROUPS=GAIN",
      "Factor of the light that surfels of these object groups reflect, by name or number: "
      "walls=.5; repeatable");
  add("--group-saturation", arguments.saturations, "GROUPS=SATURATION",
      "Saturation of that light: 0 is grey, 1 as it is; repeatable");
  add("--group-tint", arguments.tints, "GROUPS=R,G,B",
      "Factors of red, green and blue of that light; repeatable");
  add(kGlossy, arguments.glossy, "GROUPS=SHARE[,ROUGHNESS]",
      "The part of that light, 0 to 1, that goes into a lobe around the mirror direction, of this "
      "roughness, .05 to 1 (default .2): floor=.8,.2; without groups 0=.8,.2; repeatable");
}

Result<std::vector<GroupCorrection>> GroupLookArguments::corrections(
    const std::string& scene) const {
  std::vector<GroupCorrection> result;
  if (gains.empty() && saturations.empty() && tints.empty()) return result;
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<GroupName> names, readGroupNames(scene));
  std::map<std::uint32_t, ColorCorrection> of_group;
  const auto apply = [&](const std::string& option, const std::vector<std::string>& texts,
                         auto set) -> Status {
    return forEachGroup(option, texts, names, [&](std::uint32_t group, const std::string& text) {
      set(of_group[group], option, text);
    });
  };
  SURFEIT_RETURN_IF_ERROR(apply("--group-gain", gains, [](auto& of, auto& option, auto& text) {
    of.gain = parseFactor(option, text);
  }));
  SURFEIT_RETURN_IF_ERROR(
      apply("--group-saturation", saturations,
            [](auto& of, auto& option, auto& text) { of.saturation = parseFactor(option, text); }));
  SURFEIT_RETURN_IF_ERROR(apply("--group-tint", tints, [](auto& of, auto& option, auto& text) {
    of.tint = parseTint(option, text);
  }));
  for (const auto& [group, correction] : of_group) result.push_back({group, correction});
  return result;
}

Result<std::vector<GroupGloss>> GroupLookArguments::gloss(const std::string& scene) const {
  std::vector<GroupGloss> result;
  if (glossy.empty()) return result;
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<GroupName> names, readGroupNames(scene));
  SURFEIT_RETURN_IF_ERROR(
      forEachGroup(kGlossy, glossy, names, [&](std::uint32_t group, const std::string& text) {
        result.push_back(parseGloss(text));
        result.back().group = group;
      }));
  return result;
}

}  // namespace surfeit
