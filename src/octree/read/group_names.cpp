// In the provenance: "groups": {"1": "lamp", "2": "tree"}, "crs": "EPSG:32610".
#include "surfeit/group_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "core/text_case.h"
#include "octree/read/provenance.h"
#include "octree/read/scene_file.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

constexpr std::size_t kLongestName = 200;

std::string listOf(const std::vector<GroupName>& names) {
  std::string text;
  for (const GroupName& name : names) text += (text.empty() ? "" : ", ") + name.name;
  return text.empty() ? "none" : text;
}

}  // namespace

Status checkGroupName(std::string_view name) {
  const char* wrong = nullptr;
  if (name.empty()) wrong = "is empty";
  if (name.size() > kLongestName) wrong = "has more than 200 bytes";
  if (!name.empty() && isDigit(name.front())) wrong = "begins with a digit";
  for (const char c : name) {
    if (c == ',') wrong = "has a comma";
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) wrong = "has a control character";
  }
  if (wrong == nullptr) return {};
  return Status::invalidArgument(
      fmt::format("name of a group \"{}\": {}, expected such as lamp or left_wall",
                  name.substr(0, kLongestName), wrong));
}

Result<std::vector<GroupName>> readGroupNames(const std::string& scene_path) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, SceneFile::open(scene_path));
  return groupNamesOf(scene.provenance());
}

std::string sceneCrs(const std::string& provenance) {
  const nlohmann::json json = nlohmann::json::parse(provenance, nullptr, false);
  if (!json.is_object() || !json.contains("crs") || !json["crs"].is_string()) return {};
  return json["crs"];
}

std::vector<GroupName> groupNamesOf(const std::string& provenance) {
  const nlohmann::json json = nlohmann::json::parse(provenance, nullptr, false);
  std::vector<GroupName> names;
  if (!json.is_object() || !json.contains("groups") || !json["groups"].is_object()) return names;
  for (const auto& [number, name] : json["groups"].items()) {
    std::uint32_t group = 0;
    const char* const end = number.data() + number.size();
    const auto [stop, error] = std::from_chars(number.data(), end, group);
    if (error != std::errc() || stop != end || group >= kMaxGroups || !name.is_string()) continue;
    if (checkGroupName(name.get_ref<const std::string&>()).ok()) names.push_back({group, name});
  }
  std::sort(names.begin(), names.end(),
            [](const GroupName& a, const GroupName& b) { return a.group < b.group; });
  return names;
}

Result<std::uint64_t> parseGroupNames(std::string_view text, const std::vector<GroupName>& names) {
  std::uint64_t groups = 0;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view part = text.substr(begin, end - begin);
    begin = end + 1;
    if (part.empty() || isDigit(part.front())) {
      SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t numbers, parseGroups(part));
      groups |= numbers;
      continue;
    }
    const auto found = std::find_if(names.begin(), names.end(),
                                    [&](const GroupName& name) { return name.name == part; });
    if (found == names.end()) {
      return Status::invalidArgument(
          fmt::format("found \"{}\", expected groups by number, as 0,2-5, or by the names of the "
                      "scene: {}",
                      part, listOf(names)));
    }
    groups |= groupBit(found->group);
  }
  return groups;
}

}  // namespace surfeit
