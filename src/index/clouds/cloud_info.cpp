#include "surfeit/cloud_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/ply/ply_reader.h"
#include "cloud/rows/channels.h"
#include "core/bounds.h"
#include "core/crs_comment.h"
#include "core/guard.h"
#include "index/clouds/cloud_density.h"
#include "index/notes/radius_note.h"
#include "index/notes/stray_note.h"
#include "octree/read/scene_file.h"
#include "storage/byte_input.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {
namespace {

constexpr std::size_t kBatchSurfels = 16384, kSizeSample = 4096;

Result<RowReaderOptions> rowOptions(const ReadOptions& options) {
  RowReaderOptions reading;
  SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(options.channels));
  reading.part = options.part;
  reading.filter = options.filter;
  reading.color_range = options.color_range;
  return reading;
}

// The first bytes of a file, decompressed.
Result<std::string> firstBytes(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput file, ByteInput::open(path));
  std::string bytes(8, '\0');
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size,
                           file.readSome(0, std::as_writable_bytes(std::span(bytes))));
  bytes.resize(size);
  return bytes;
}

// What a pass over a cloud finds.
struct CloudScan {
  glm::dvec3 origin;  // of the sample
  Bounds3d bounds;
  std::uint64_t spheres = 0;
  PlaceSample sample;
  std::vector<Surfel> surfels;  // some from all over, for their sizes
};

// Reads all surfels, which are counted from `origin`.
Result<CloudScan> scanSurfels(SurfelSource& source, const glm::dvec3& origin, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(source.rewind());
  source.setOrigin(origin);
  CloudScan scan{origin, {}, 0, PlaceSample(source.recordCount()), {}};
  const std::uint64_t step = source.recordCount() / kSizeSample + 1;
  std::uint64_t record = 0;
  std::vector<Surfel> batch(kBatchSurfels);
  progress.beginPhase("scan", source.recordCount(), "surfels");
  for (;;) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, source.read(batch));
    if (count == 0) return scan;
    for (const Surfel& surfel : std::span(batch).first(count)) {
      scan.bounds.add(glm::dvec3(surfel.position) + origin);
      scan.spheres += surfel.isSphere() ? 1 : 0;
      if (record++ % step == 0) scan.surfels.push_back(surfel);
    }
    scan.sample.add(std::span(batch).first(count));
    progress.advance(count);
  }
}

// Reads the records as surfels, unless they are none.
Status addSurfels(const std::string& path, const RowReaderOptions& options, CloudInfo& info,
                  Progress& progress) {
  Result<std::unique_ptr<SurfelSource>> source =
      openSurfelSource(path, /* strict= */ false, options);
  if (!source.ok()) {
    std::string_view why = source.status().message();
    if (why.starts_with(path)) why.remove_prefix(std::min(path.size() + 2, why.size()));
    info.notes.push_back(fmt::format("no surfels: {}", why));
    return {};
  }
  // Before rows are read: notes may look at some
  std::vector<std::string> notes = (*source)->notes();
  SURFEIT_ASSIGN_OR_RETURN(CloudScan scan, scanSurfels(**source, glm::dvec3(0), progress));
  // Floats about an origin near the cloud have its digits: once more when 0 is far
  if (!scan.bounds.isEmpty() && originFor(scan.bounds) != glm::dvec3(0)) {
    SURFEIT_ASSIGN_OR_RETURN(scan, scanSurfels(**source, originFor(scan.bounds), progress));
  }
  CloudSurfels surfels;
  surfels.count = scan.sample.surfelCount();
  surfels.spheres = scan.spheres;
  surfels.channels = (*source)->channels();
  surfels.defects = (*source)->defects().describe();
  info.notes = std::move(notes);
  if (!scan.bounds.isEmpty()) {
    surfels.min = scan.bounds.min;
    surfels.max = scan.bounds.max;
    const std::span<const glm::vec3> places = scan.sample.places();
    const std::string strays =
        strayNote({places.begin(), places.end()}, scan.sample.bounds(), scan.origin);
    if (!strays.empty()) info.notes.push_back(strays);
    std::string radii = noteOfRadii(scan.surfels, surfels.count, (*source)->sizeNames());
    if (!radii.empty()) info.notes.push_back(std::move(radii));
    std::string gaps = noteOfGaps(scan.surfels, (*source)->sizeNames());
    if (!gaps.empty()) info.notes.push_back(std::move(gaps));
    if (statedCrs((*source)->comments()).empty() && !places.empty()) {
      std::vector<glm::vec3> sample(places.begin(), places.end());
      Bounds3d usual = usualBounds(sample);
      usual.min += scan.origin;
      usual.max += scan.origin;
      std::string degrees = noteOfLikelyDegrees(usual);
      if (!degrees.empty()) info.notes.push_back(std::move(degrees));
    }
    SURFEIT_ASSIGN_OR_RETURN(surfels.density, measureDensity(**source, scan.sample, progress));
  }
  info.surfels = std::move(surfels);
  return {};
}

Status addElements(const std::string& path, CloudInfo& info) {
  SURFEIT_ASSIGN_OR_RETURN(const PlyReader reader, PlyReader::open(path));
  info.format = "ply";
  for (const RowLayout& element : reader.header().elements) {
    CloudElement& added = info.elements.emplace_back();
    added.name = element.name;
    added.count = element.count;
    for (const RowProperty& property : element.properties) {
      added.properties.push_back(
          {property.name, std::string(valueTypeName(property.type)), property.is_list});
    }
  }
  return {};
}

Status addRecords(const std::string& path, const RowReaderOptions& options, CloudInfo& info) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openRowReader(path, options));
  const RowLayout& element = reader->element();
  info.format = reader->formatName();
  info.records = element.count;
  info.comments = reader->comments();
  info.notes = reader->notes();
  for (const RowChannel& channel : channelsOf(element)) {
    CloudChannel& added = info.channels.emplace_back();
    added.name = channel.name;
    added.type = valueTypeName(channel.type);
    for (const std::size_t i : channel.properties) {
      added.properties.push_back(element.properties[i].name);
    }
  }
  return {};
}

}  // namespace

Result<CloudInfo> readCloudInfo(const std::string& path, const ReadOptions& options,
                                Progress& progress) {
  return guarded(path, [&]() -> Result<CloudInfo> {
    CloudInfo info;
    const bool is_as_stored =
        options.channels.empty() && options.part.empty() && options.filter.empty();
    SURFEIT_ASSIGN_OR_RETURN(const RowReaderOptions reading, rowOptions(options));
    SURFEIT_ASSIGN_OR_RETURN(const std::string bytes, firstBytes(path));
    if (is_as_stored && bytes.starts_with("ply")) {
      SURFEIT_RETURN_IF_ERROR(addElements(path, info));
    } else {
      SURFEIT_RETURN_IF_ERROR(addRecords(path, reading, info));
    }
    SURFEIT_RETURN_IF_ERROR(addSurfels(path, reading, info, progress));
    return info;
  });
}

Result<CloudDensity> measureSceneDensity(const std::string& path, Progress& progress) {
  return guarded(path, [&]() -> Result<CloudDensity> {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(path));
    return measureDensity(std::move(scene), progress);
  });
}

}  // namespace surfeit
