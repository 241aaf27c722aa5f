// One receiver, gathered alone with a recorder that keeps what the pixels got.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <utility>

#include "batch/gather_memory.h"
#include "batch/gather_options.h"
#include "batch/receiver_rows.h"
#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "core/guard.h"
#include "core/program_memory.h"
#include "engine/gatherer_memory.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/gather_rules.h"
#include "octree/read/scene_file.h"
#include "surfeit/cube.h"

namespace surfeit {
namespace {

bool isFinite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// In double: squares of floats overflow.
glm::vec3 unitOrZero(const glm::vec3& v) {
  const double length = glm::length(glm::dvec3(v));
  return length > 0 ? glm::vec3(glm::dvec3(v) / length) : glm::vec3(0);
}

// About the scene's origin.
Result<LocalReceiver> checkedReceiver(const Receiver& given, const GatherOptions& options,
                                      const glm::dvec3& origin) {
  const auto refuse = [](const char* what, const auto& found) {
    return Status::invalidArgument(
        fmt::format("{} is {} {} {}, expected finite numbers", what, found.x, found.y, found.z));
  };
  if (!isFinite(given.position)) return refuse("position of the receiver", given.position);
  if (!isFinite(given.normal)) return refuse("normal of the receiver", given.normal);
  if (!isFinite(given.view)) return refuse("view of the receiver", given.view);
  const LocalReceiver receiver{glm::vec3(given.position - origin), unitOrZero(given.normal),
                               unitOrZero(given.view)};
  if (options.mode != GatherMode::kGlossy) return receiver;
  if (receiver.isSpherical()) {
    return Status::invalidArgument("the receiver has no normal, expected one to reflect the view");
  }
  if (receiver.view == glm::vec3(0) && !isFinite(options.eye)) {
    return Status::invalidArgument(
        "the receiver has no view, expected one, or the position of a camera (--camera X,Y,Z)");
  }
  return receiver;
}

// Bytes beside the caches.
std::uint64_t fixedBytes(const SceneFile& file, const GatherRules& rules,
                         const LoadedEnvironment* environment) {
  const std::size_t pixels = RasterGeometry::pixelCount(rules.quality.raster_resolution);
  const std::uint64_t held = environment == nullptr ? 0 : environment->memoryBytes();
  return programBytes(1) + PagedOctree::fixedBytes(file, 1) + PacketGatherer::memoryBytes(rules) +
         pixels * (PixelRecorder::kPixelBytes + sizeof(PixelContent) + sizeof(CubePixel)) + held +
         largeCutBytes(rules, file.header().surfel_count, 4 * sizeof(std::uint64_t));
}

Result<PagedOctree::Memory> planCubeMemory(const SceneFile& file, const GatherOptions& options,
                                           const GatherRules& rules,
                                           const LoadedEnvironment* environment) {
  const std::uint64_t fixed = fixedBytes(file, rules, environment);
  const std::uint64_t least = fixed + PagedOctree::leastCacheBytes(file, 1);
  if (options.memory_bytes < least) {
    return refuseBudget(options.memory_bytes, file.path(), least);
  }
  return PagedOctree::planMemory(
      file, options.memory_bytes - fixed, 1,
      options.cache_split < 0 ? PagedOctree::kEvenSplit : options.cache_split);
}

std::vector<CubeFace> facesOf(const LocalReceiver& receiver, const GatherRules& rules) {
  if (rules.hasConeRaster()) {
    const ConeFrame frame(lobeAxis(receiver, rules));
    const float slope = std::tan(rules.weights.cone_angle);
    return {{frame.x, slope * frame.y, slope * frame.z}};
  }
  std::vector<CubeFace> faces(RasterGeometry::kFaces);
  for (std::size_t face = 0; face < faces.size(); ++face) {
    const int axis = int(face) / 2;
    faces[face].forward[axis] = face % 2 == 0 ? 1.f : -1.f;
    faces[face].u[(axis + 1) % 3] = 1;
    faces[face].v[(axis + 2) % 3] = 1;
  }
  return faces;
}

CubePixel cubePixel(float solid_angle, const PixelContent& content, const PixelRecord& record) {
  return {.direction = content.direction,
          .solid_angle = solid_angle,
          .weight = content.weight,
          .coverage = content.coverage,
          .occlusion = content.occlusion,
          .light = content.radiosity,
          .environment = content.open * content.environment,
          .depth = record.depth,
          .layers = record.things,
          .filled = std::max(0.f, content.coverage - record.total),
          .kind = record.kind()};
}

Result<CubeImage> gatherCubeOrThrow(const std::string& scene_path, const Receiver& given,
                                    const GatherOptions& given_options, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkGatherOptions(given_options));
  GatherOptions options = withDefaults(given_options);
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(scene_path, sceneAccess(options)));
  const glm::dvec3 origin = scene.header().origin;
  SURFEIT_ASSIGN_OR_RETURN(const LocalReceiver receiver, checkedReceiver(given, options, origin));
  options.eye -= origin;
  SURFEIT_RETURN_IF_ERROR(checkGroupsFor(scene, options, progress));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<const LoadedEnvironment> environment,
                           loadEnvironment(options, scene.header().up, progress));
  const GatherRules rules = gatherRules(options, environment.get());
  SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                           planCubeMemory(scene, options, rules, environment.get()));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory));
  if (progress.isCancelled()) return Status::interrupted();

  // Gather
  progress.beginPhase("gather", 1, "receivers");
  PixelRecorder recorder;
  PacketGatherer gatherer(rules);
  gatherer.raster().setRecorder(&recorder);
  PagedOctree::Reader reader(*octree);
  GatherResult result;
  SURFEIT_RETURN_IF_ERROR(gatherer.gather({&receiver, 1}, reader, {&result, 1}));
  progress.advance(1);

  // Keep what the raster holds
  const PacketRaster& raster = gatherer.raster();
  CubeImage image;
  image.receiver = {given.position, receiver.normal, receiver.view};
  image.resolution = raster.geometry().resolution();
  image.faces = facesOf(receiver, rules);
  std::vector<PixelContent> contents(raster.geometry().pixels().size());
  raster.readPixels(contents);
  image.pixels.reserve(contents.size());
  for (std::size_t i = 0; i < contents.size(); ++i) {
    image.pixels.push_back(
        cubePixel(raster.geometry().pixels()[i].solid_angle, contents[i], recorder.record(i)));
  }
  image.occlusion = result.occlusion;
  image.irradiance = result.irradiance;
  image.environment = result.environment;
  image.contributions = raster.patchCount();
  image.traced_surfels = raster.tracedCount();
  return image;
}

Result<Receiver> readCubeReceiverOrThrow(const std::string& path, std::uint64_t number,
                                         const std::string& channels, const std::string& part,
                                         const std::string& filter, Progress& progress) {
  RowReaderOptions reading;
  SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(channels));
  reading.part = part;
  reading.filter = filter;
  reading.color_range.reset();  // a receiver has none
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openRowReader(path, reading));
  const RowLayout& rows = reader->element();
  SURFEIT_ASSIGN_OR_RETURN(const ReceiverMapping mapping, ReceiverMapping::create(rows, path));
  if (number >= rows.count) {
    return Status::invalidArgument(
        fmt::format("{}: receiver number {}, expected less than {}", path, number, rows.count));
  }

  for (const std::string& note : reader->notes()) {
    progress.note(fmt::format("{}: {}", path, note));
  }

  AlignedBuffer buffer;
  std::uint64_t place = 0;
  if (reader->isSeekable()) {
    SURFEIT_RETURN_IF_ERROR(reader->seekRow(number));
    place = number;
  }
  for (;;) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const Bytes slice, reader->readRows(kSliceRows, buffer));
    const std::uint64_t count = slice.size() / rows.row_bytes;
    if (count == 0) {
      return Status::corruption(fmt::format("{}: ends before row {}", path, number));
    }
    if (number - place >= count) {
      place += count;
      continue;
    }
    const std::byte* const row = slice.data() + (number - place) * rows.row_bytes;
    LocalReceiver receiver;
    SurfelDefects defects;
    if (!mapping.decode(row, number, receiver, defects)) {
      return Status::corruption(
          fmt::format("{}: record {}: {}", path, number, mapping.describeDefect(row)));
    }
    return Receiver{mapping.positionOf(row), receiver.normal, receiver.view};
  }
}

}  // namespace

Result<CubeImage> gatherCube(const std::string& scene_path, const Receiver& receiver,
                             const GatherOptions& options, Progress& progress) {
  return guarded(scene_path,
                 [&] { return gatherCubeOrThrow(scene_path, receiver, options, progress); });
}

Result<Receiver> readCubeReceiver(const std::string& cloud_path, std::uint64_t number,
                                  const std::string& channels, const std::string& part,
                                  Progress& progress, const std::string& filter) {
  return guarded(cloud_path, [&] {
    return readCubeReceiverOrThrow(cloud_path, number, channels, part, filter, progress);
  });
}

}  // namespace surfeit
