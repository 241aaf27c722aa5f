// surfeit info: what a scene file or a cloud says about itself.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "surfeit/cloud_info.h"
#include "surfeit/group_names.h"
#include "surfeit/scene.h"
#include "tools/channel_options.h"
#include "tools/command.h"

namespace surfeit {
namespace {

struct InfoArguments {
  std::string path;
  ReadOptions reading;
  bool json = false;
};

char upAxisName(UpAxis up) { return "xyz"[static_cast<int>(up)]; }

nlohmann::json vectorJson(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

std::vector<std::string> channelNames(const CloudChannels& channels) {
  std::vector<std::string> names = {"position"};
  if (channels.normal) names.emplace_back("normal");
  if (channels.radius) names.emplace_back("radius");
  if (channels.area) names.emplace_back("area");
  if (channels.radiosity) names.emplace_back("radiosity");
  if (channels.albedo) names.emplace_back("albedo");
  if (channels.two_sided) names.emplace_back("two_sided");
  if (channels.group) names.emplace_back("group");
  if (channels.long_side) names.emplace_back("long_side");
  if (channels.opacity) names.emplace_back("opacity");
  if (channels.tint) names.emplace_back("tint");
  return names;
}

// Of a cloud or a scene, into `json`; nothing without points.
void addDensity(const CloudDensity& density, nlohmann::json& json) {
  if (density.sampled == 0) return;
  if (density.median_spacing > 0) {
    json["spacing"] = {{"median", density.median_spacing},
                       {"low", density.low_spacing},
                       {"high", density.high_spacing}};
    json["points_per_area"] = density.points_per_area;
  }
  json["repeated_places"] = density.repeated_share;
  json["sampled_points"] = density.sampled;
}

std::string densityText(const nlohmann::json& json) {
  std::string text;
  if (!json.contains("sampled_points")) return text;
  const std::uint64_t sampled = json["sampled_points"];
  if (json.contains("spacing")) {
    const nlohmann::json& spacing = json["spacing"];
    text += fmt::format(
        "\n  spacing        {:.4g}, from {:.4g} (5 % are below) to {:.4g} (95 %), by a sample of "
        "{} "
        "points\n  density        {:.4g} points per unit of area",
        spacing["median"].get<double>(), spacing["low"].get<double>(),
        spacing["high"].get<double>(), formatCount(sampled), json["points_per_area"].get<double>());
  } else {
    text += "\n  spacing        none: all points are at one place";
  }
  const double repeated = json["repeated_places"];
  text += fmt::format("\n  repeated       {:.3g} % of the places have several points{}",
                      100 * repeated, repeated > 0 ? ": `index --overlap thin` keeps one" : "");
  return text;
}

// What surfels lack, and what finds it.
void addMissing(const CloudChannels& channels, const std::string& normals, const std::string& sizes,
                nlohmann::json& json) {
  nlohmann::json missing = nlohmann::json::object();
  if (!normals.empty()) missing["normals"] = normals;
  if (!sizes.empty()) missing["sizes"] = sizes;
  if (!channels.radiosity && !channels.albedo) {
    missing["colors"] =
        "occlusion needs none; --channels NAME=color reads what is called otherwise";
  }
  json["missing"] = missing;
}

std::string missingText(const nlohmann::json& json) {
  std::string text;
  if (!json.contains("missing")) return text;
  for (const auto& [what, found_by] : json["missing"].items()) {
    text += fmt::format("\n  no {:11} {}", what, found_by.get<std::string>());
  }
  return text;
}

nlohmann::json sceneJson(const SceneInfo& info, const std::vector<GroupName>& names) {
  nlohmann::json json = {
      {"format", "sft"},
      {"file_bytes", info.file_bytes},
      {"bytes_per_surfel", double(info.file_bytes) / double(info.surfels)},
      {"surfels", info.surfels},
      {"nodes", info.nodes},
      {"leaf_capacity", info.leaf_capacity},
      {"precision", info.full_precision ? "full" : "quantized"},
      {"input_channels", channelNames(info.channels)},
      {"lobes", info.has_lobes},
      {"bounds", {vectorJson(info.min), vectorJson(info.max)}},
      {"origin", vectorJson(info.origin)},
      {"cube", {info.cube.corner.x, info.cube.corner.y, info.cube.corner.z, info.cube.size}},
      {"up", std::string(1, upAxisName(info.up))},
      {"node_pages", info.node_pages},
      {"node_page_bytes", info.node_page_bytes},
      {"node_decoded_bytes", info.node_cache_bytes},
      {"surfel_pages", info.surfel_pages},
      {"surfel_page_bytes", info.surfel_page_bytes},
      {"surfel_decoded_bytes", info.surfel_cache_bytes},
      {"node_pages_by_level", info.level_pages},
  };
  if (info.channels.group) json["groups"] = describeGroups(info.groups);
  for (const GroupName& name : names) json["group_names"][std::to_string(name.group)] = name.name;
  json["provenance"] = nlohmann::json::parse(info.provenance, nullptr, false);
  return json;
}

// With all digits that the scene has: those of floats about its origin.
std::string placeText(const glm::dvec3& place, const glm::dvec3& origin) {
  std::string text;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string number = origin[axis] == 0 ? fmt::format("{}", float(place[axis]))
                                                 : fmt::format("{:.12g}", place[axis]);
    text += (axis == 0 ? "" : " ") + number;
  }
  return text;
}

// "0-2 (1 lamp, 2 tree)"
std::string groupText(const SceneInfo& info, const std::vector<GroupName>& names) {
  std::string text;
  for (const GroupName& name : names) {
    text += fmt::format("{}{} {}", text.empty() ? " (" : ", ", name.group, name.name);
  }
  return describeGroups(info.groups) + text + (text.empty() ? "" : ")");
}

std::string sceneText(const std::string& path, const SceneInfo& info,
                      const std::vector<GroupName>& names) {
  const std::string origin =
      info.origin == glm::dvec3(0)
          ? ""
          : fmt::format("\n  origin         {} {} {}", info.origin.x, info.origin.y, info.origin.z);
  std::string more =
      info.channels.group ? fmt::format("  groups         {}\n", groupText(info, names)) : "";
  if (info.has_lobes) more += "  lobes          of glossy bounces\n";
  return fmt::format(
      "{}: Surfeit scene, {} surfels, {} nodes\n"
      "  file           {} ({:.1f} bytes per surfel)\n"
      "  bounds         {} .. {}{}\n"
      "  cube           {},{},{},{}\n"
      "  up             {}\n"
      "  input had      {}\n"
      "{}"
      "  precision      {}\n"
      "  node pages     {} in {}, decoded {}\n"
      "  surfel pages   {} in {}, decoded {}\n"
      "  provenance     {}",
      path, formatCount(info.surfels), formatCount(info.nodes), formatBytes(info.file_bytes),
      double(info.file_bytes) / double(info.surfels), placeText(info.min, info.origin),
      placeText(info.max, info.origin), origin, info.cube.corner.x, info.cube.corner.y,
      info.cube.corner.z, info.cube.size, upAxisName(info.up),
      fmt::join(channelNames(info.channels), ", "), more,
      info.full_precision ? "full" : "quantized", formatCount(info.node_pages),
      formatBytes(info.node_page_bytes), formatBytes(info.node_cache_bytes),
      formatCount(info.surfel_pages), formatBytes(info.surfel_page_bytes),
      formatBytes(info.surfel_cache_bytes), info.provenance);
}

void addMissing(const CloudSurfels& surfels, nlohmann::json& json) {
  const CloudChannels& channels = surfels.channels;
  std::string normals, sizes;
  if (surfels.spheres > 0) {
    normals = "`surfeit normals` finds them, or `surfeit index --normals estimate`";
    if (channels.normal) {
      normals = fmt::format("of {} surfels: {}", formatCount(surfels.spheres), normals);
    }
  }
  if (!channels.radius && !channels.area) {
    sizes =
        "`surfeit index` finds them from the neighbours; `surfeit normals --sizes` writes areas";
  }
  addMissing(channels, normals, sizes, json);
}

// Of records that are surfels: how many are valid, their channels, bounds and density, and what
// they lack. Those of a cloud without surfels are left out.
void addSurfels(const CloudInfo& info, nlohmann::json& json) {
  if (!info.surfels) return;
  const CloudSurfels& surfels = *info.surfels;
  json["surfels"] = surfels.count;
  json["notes"] = info.notes;
  json["input_channels"] = channelNames(surfels.channels);
  if (!surfels.defects.empty()) json["defects"] = surfels.defects;
  if (surfels.count == 0) return;
  json["bounds"] = {vectorJson(surfels.min), vectorJson(surfels.max)};
  addMissing(surfels, json);
  addDensity(surfels.density, json);
}

std::string notesText(const nlohmann::json& json) {
  std::string text;
  if (!json.contains("notes")) return text;
  for (const nlohmann::json& line : json["notes"]) {
    text += fmt::format("\n  note           {}", line.get<std::string>());
  }
  return text;
}

std::string surfelsText(const nlohmann::json& json) {
  std::string text;
  if (json.contains("bounds")) {
    text += fmt::format("\n  surfels        {}, bounds {}",
                        formatCount(json["surfels"].get<std::uint64_t>()), json["bounds"].dump());
  }
  if (json.contains("defects")) text += "\n  defects        " + json["defects"].get<std::string>();
  return text + densityText(json) + missingText(json);
}

// A PLY as it is stored: elements and properties; bounds when the records are surfels.
nlohmann::json plyJson(const CloudInfo& info) {
  nlohmann::json json = {{"format", info.format}, {"elements", nlohmann::json::array()}};
  for (const CloudElement& element : info.elements) {
    nlohmann::json properties = nlohmann::json::array();
    for (const CloudProperty& property : element.properties) {
      properties.push_back((property.is_list ? "list " : "") + property.type + " " + property.name);
    }
    json["elements"].push_back(
        {{"name", element.name}, {"count", element.count}, {"properties", properties}});
  }
  if (!info.surfels && !info.notes.empty()) json["notes"] = info.notes;
  addSurfels(info, json);
  return json;
}

std::string plyText(const std::string& path, const nlohmann::json& json) {
  std::string text = fmt::format("{}: PLY", path);
  for (const nlohmann::json& element : json["elements"]) {
    std::string properties;
    for (const nlohmann::json& property : element["properties"]) {
      properties += (properties.empty() ? "" : ", ") + property.get<std::string>();
    }
    text += fmt::format("\n  {:14} {}: {}", element["name"].get<std::string>(),
                        formatCount(element["count"].get<std::uint64_t>()), properties);
  }
  return text + notesText(json) + surfelsText(json);
}

// Any other cloud, and a PLY whose channels are renamed: what a row holds, and what of the file it
// does not.
nlohmann::json cloudJson(const CloudInfo& info) {
  nlohmann::json json = {{"format", info.format},
                         {"count", info.records},
                         {"channels", nlohmann::json::array()},
                         {"comments", info.comments},
                         {"notes", info.notes}};
  for (const CloudChannel& channel : info.channels) {
    json["channels"].push_back(
        {{"name", channel.name}, {"type", channel.type}, {"properties", channel.properties}});
  }
  addSurfels(info, json);
  return json;
}

std::string cloudText(const std::string& path, const nlohmann::json& json) {
  std::string text = fmt::format("{}: {}, {} points", path, json["format"].get<std::string>(),
                                 formatCount(json["count"].get<std::uint64_t>()));
  for (const nlohmann::json& channel : json["channels"]) {
    text += fmt::format("\n  {:14} {} {}", channel["name"].get<std::string>(),
                        channel["type"].get<std::string>(),
                        fmt::join(channel["properties"].get<std::vector<std::string>>(), " "));
  }
  for (const nlohmann::json& line : json["comments"]) {
    text += fmt::format("\n  comment        {}", line.get<std::string>());
  }
  return text + notesText(json) + surfelsText(json);
}

// Density of a scene, and what it lacks. Where pages are damaged, that is told, and the rest all
// the same.
Status addSurfelsOfScene(const std::string& path, const SceneInfo& info, nlohmann::json& json,
                         Progress& progress) {
  addMissing(
      info.channels,
      info.channels.normal ? "" : "`surfeit index --normals estimate` of the cloud finds them", "",
      json);
  const Result<CloudDensity> density = measureSceneDensity(path, progress);
  if (density.status().code() == StatusCode::kCorruption) {
    progress.note(density.status().message() + ": the density is not known");
    return {};
  }
  SURFEIT_RETURN_IF_ERROR(density.status());
  addDensity(*density, json);
  return {};
}

Status runInfo(const InfoArguments& arguments, CommandContext& context) {
  nlohmann::json json;
  std::string text;
  SURFEIT_ASSIGN_OR_RETURN(const bool is_scene, isScene(arguments.path));
  if (is_scene) {
    if (!arguments.reading.filter.empty()) {
      return Status::invalidArgument(fmt::format(
          "{}: a scene, whose surfels are not filtered: give the filter to `surfeit index`",
          arguments.path));
    }
    SURFEIT_ASSIGN_OR_RETURN(const SceneInfo info, readSceneInfo(arguments.path));
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<GroupName> names, readGroupNames(arguments.path));
    json = sceneJson(info, names);
    SURFEIT_RETURN_IF_ERROR(addSurfelsOfScene(arguments.path, info, json, context.progress()));
    text = sceneText(arguments.path, info, names) + densityText(json) + missingText(json);
  } else {
    SURFEIT_ASSIGN_OR_RETURN(const CloudInfo info,
                             readCloudInfo(arguments.path, arguments.reading, context.progress()));
    const bool is_ply = info.format == "ply";
    json = is_ply ? plyJson(info) : cloudJson(info);
    text = is_ply ? plyText(arguments.path, json) : cloudText(arguments.path, json);
  }
  json["path"] = arguments.path;
  if (arguments.json) {
    context.answer(jsonText(json));
  } else {
    context.answer(text);
  }
  return {};
}

}  // namespace

void addInfoCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("info", "Tell what a scene file or a cloud holds");
  const auto arguments = std::make_shared<InfoArguments>();
  command->add_option("FILE", arguments->path, "Scene file (.sft) or cloud (docs/files.md)")
      ->required();
  ReadOptions& reading = arguments->reading;
  addChannelOptions(*command, reading.channels, reading.part, reading.filter);
  addColorRangeOption(*command, reading.color_range);
  command->add_flag("--json", arguments->json, "JSON on standard output");
  context.addCommonOptions(*command, {.threads = false, .memory = false, .stats = false});
  command->footer(
      "Spacing assumes points on a surface: sqrt(pi r^2 / 8), with r the distance to the 8th\n"
      "nearest point, over a sample of 1,000 points. A cloud is read twice for it, and once more "
      "if\n"
      "it lies far from 0.\n"
      "Examples:\n"
      "  surfeit info scan.las\n"
      "  surfeit info lion.sft --json");
  command->callback(
      [arguments, &context] { context.run([&] { return runInfo(*arguments, context); }); });
}

}  // namespace surfeit
