#include "index/steps/scene_description.h"

#include <xxhash.h>

#include <bit>
#include <nlohmann/json.hpp>
#include <string>

#include "index/steps/pinned_cube.h"
#include "index/steps/scene_place.h"
#include "octree/build/scene_writer.h"
#include "surfeit/version.h"

namespace surfeit {

SceneHeader SceneDescription::header(bool full_precision) const {
  SceneHeader header;
  header.leaf_capacity = options.leaf_capacity;
  header.node_group_capacity = kDefaultNodeGroup;
  header.surfel_group_capacity = kDefaultSurfelGroup;
  header.flatness_limit = kDefaultFlatnessLimit;
  header.origin = origin;
  header.up = up;
  header.bounds = totals.bounds;
  header.cube = cubeAsked(options, totals.bounds, origin);
  header.channels = totals.channels;
  header.channels.normal = header.channels.normal || normals != nullptr;
  // Sizes from neighbours may tell the shape
  header.channels.long_side =
      header.channels.long_side || totals.missing_both + totals.missing_radius > 0;
  header.format_version = formatVersionFor(header.channels);
  header.full_precision = full_precision;
  header.has_variances = header.has_slopes = header.channels.radiosity;
  return header;
}

std::uint64_t SceneDescription::identity(bool full_precision) const {
  const CloudChannels& channels = totals.channels;
  const std::string text = provenance();
  const std::uint64_t parts[] = {
      totals.content,
      std::bit_cast<std::uint64_t>(origin.x),
      std::bit_cast<std::uint64_t>(origin.y),
      std::bit_cast<std::uint64_t>(origin.z),
      totals.surfels,
      formatVersionFor(channels),
      full_precision ? 1u : 0u,
      std::uint64_t{channels.normal} | std::uint64_t{channels.radius} << 1 |
          std::uint64_t{channels.area} << 2 | std::uint64_t{channels.radiosity} << 3 |
          std::uint64_t{channels.albedo} << 4 | std::uint64_t{channels.two_sided} << 5 |
          std::uint64_t{channels.group} << 6 | std::uint64_t{channels.long_side} << 7 |
          std::uint64_t{channels.opacity} << 8 | std::uint64_t{channels.tint} << 9,
      XXH3_64bits(text.data(), text.size())};
  return XXH3_64bits(parts, sizeof parts);
}

std::string SceneDescription::provenance() const {
  nlohmann::json json = {{"program", "surfeit"},
                         {"version", kVersion},
                         {"leaf_capacity", options.leaf_capacity},
                         {"overlap", options.disk_overlap},
                         {"precision", options.full_precision ? "full" : "quantized"},
                         {"skipped_records", totals.skipped},
                         {"sizes_from_neighbours", totals.missing_both},
                         {"areas_from_radius", totals.missing_area},
                         {"radii_from_area", totals.radius_from_area},
                         {"spheres", totals.spheres}};
  if (totals.missing_radius > 0) json["radii_from_neighbours"] = totals.missing_radius;
  if (options.repeats == Repeats::kThin) json["repeats"] = "thin";
  const auto cube =
      options.cube ? PinnedCube(*options.cube).unusualNumbers(totals.bounds, origin) : std::nullopt;
  if (cube) json["cube"] = *cube;
  if (!crs.empty()) json["crs"] = crs;
  if (normals != nullptr) json["normals"] = normals->describe();
  for (const auto& [group, name] : groups) json["groups"][std::to_string(group)] = name;
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace surfeit
