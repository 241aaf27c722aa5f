// A gather streams its receivers in chunks. A chunk is read, sorted along the scene's curve, handed
// to the threads in runs of neighbours, and written in the order it was read:
//
//   rows of the input --read--> chunk --sort--> runs --gather (all threads)--> results --> rows
//
// No result depends on any other, so that chunks, runs and threads show nowhere in them.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/curve_key.h"
#include "core/job_limits.h"
#include "gather/chunk_gatherer.h"
#include "gather/gather_point.h"
#include "gather/receiver_rows.h"
#include "io/ply_reader.h"
#include "io/ply_writer.h"
#include "octree/paged_octree.h"
#include "octree/scene_file.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

// Rows read or written between two looks at Progress::isCancelled, and of the output buffer.
constexpr std::size_t kSliceRows = 4096;

// Chunks are large, since neighbours can only meet inside one. Beyond the most, a chunk is as
// coherent as it gets: the walk along its curve already fills the scene.
constexpr std::uint64_t kLeastChunkReceivers = std::uint64_t{1} << 14;
constexpr std::uint64_t kMostChunkReceivers = std::uint64_t{1} << 20;

// Buffers of the PLY reader (0.3 MiB) and writer (1.1 MiB).
constexpr std::uint64_t kStreamBytes = std::uint64_t{3} << 19;
// Stack and allocator of a thread.
constexpr std::uint64_t kThreadBytes = std::uint64_t{128} << 10;

constexpr int kMostThreads = 4096;

std::string formatMebibytes(std::uint64_t bytes) {
  return fmt::format("{:.1f} MiB", std::ceil(double(bytes) / (1 << 20) * 10) / 10);
}

Status checkOptions(const GatherOptions& options) {
  const auto refuse = [](const char* what, auto found, const std::string& expected) {
    return Status::invalidArgument(fmt::format("{} is {}, expected {}", what, found, expected));
  };
  // No NaN passes any of these
  const auto isFromZero = [](float value) { return value >= 0 && std::isfinite(value); };
  const GatherQuality& quality = options.quality;
  if (!isFromZero(quality.max_solid_angle)) {
    return refuse("max solid angle", quality.max_solid_angle, "0 or more steradians");
  }
  if (!RasterGeometry::isValidResolution(quality.raster_resolution)) {
    return refuse("raster resolution", quality.raster_resolution,
                  fmt::format("an even number from {} to {}", RasterGeometry::kMinResolution,
                              RasterGeometry::kMaxResolution));
  }
  if (!isFromZero(quality.bias)) return refuse("bias", quality.bias, "0 or more surfel radii");
  if (!isFromZero(quality.near_field_radii)) {
    return refuse("near field", quality.near_field_radii, "0 or more surfel radii");
  }
  if (!(quality.max_distance > 0)) {
    return refuse("max distance", quality.max_distance, "more than 0 scene units");
  }
  if (options.threads < 0 || options.threads > kMostThreads) {
    return refuse("thread count", options.threads, fmt::format("0 to {}", kMostThreads));
  }
  return {};
}

// How the budget is spent.
struct MemoryPlan {
  std::uint64_t chunk_receivers = 0;
  PagedOctree::Memory caches;
};

// Bytes of one receiver in a chunk.
std::uint64_t receiverBytes(std::size_t row_bytes) {
  return row_bytes + sizeof(Receiver) + sizeof(GatherResult) + sizeof(OrderedReceiver);
}

// Bytes of a thread beside its part of the caches. A cut larger than a gatherer has room for from
// the start is foreseen by estimate: some layers of surfaces, seen in pieces of about the max solid
// angle. With a max solid angle of 0 it is the whole scene.
std::uint64_t threadBytes(const SceneFile& file, const GatherQuality& quality) {
  constexpr double kLayers = 8;
  constexpr double kBytes = 128;  // of a contribution, in vectors that grow by doubling
  const double cut = 4 * double(kPi) / double(quality.max_solid_angle) * kLayers;
  const double most = std::min(double(file.header().surfel_count), cut);
  const double more = std::max(0.0, most - double(ReceiverRaster::kReservedContributions));
  return PointGatherer::memoryBytes(quality) + kThreadBytes +
         static_cast<std::uint64_t>(more * kBytes);
}

// The fewest cache bytes that PagedOctree::planMemory accepts, by bisection; nothing when even
// the whole file decoded is refused.
std::optional<std::uint64_t> leastCacheBytes(const SceneFile& file, int threads) {
  std::uint64_t refused = 0;
  std::uint64_t accepted = PagedOctree::unlimitedCacheBytes(file);
  if (!PagedOctree::planMemory(file, accepted, threads).ok()) return std::nullopt;
  while (refused + 1 < accepted) {
    const std::uint64_t middle = refused + (accepted - refused) / 2;
    (PagedOctree::planMemory(file, middle, threads).ok() ? accepted : refused) = middle;
  }
  return accepted;
}

// Gives a quarter of the budget to the chunk, within its limits, what is fixed to what is fixed,
// and all the rest to the caches.
Result<MemoryPlan> planGatherMemory(const SceneFile& file, std::uint64_t memory_bytes, int threads,
                                    const GatherQuality& quality, const PlyElement& receivers,
                                    std::size_t result_row_bytes) {
  const std::uint64_t per_receiver = receiverBytes(receivers.row_bytes);
  const std::uint64_t most = std::min(receivers.count, kMostChunkReceivers);
  const std::uint64_t least = std::min(receivers.count, kLeastChunkReceivers);
  const std::uint64_t fixed = PagedOctree::fixedBytes(file, threads) +
                              static_cast<std::uint64_t>(threads) * threadBytes(file, quality) +
                              kSliceRows * result_row_bytes + kStreamBytes;

  const std::optional<std::uint64_t> least_cache = leastCacheBytes(file, threads);
  if (!least_cache) {
    return PagedOctree::planMemory(file, PagedOctree::unlimitedCacheBytes(file), threads).status();
  }
  const std::uint64_t needed = fixed + least * per_receiver + *least_cache;
  if (memory_bytes < needed) {
    return Status::budgetTooSmall(fmt::format(
        "a memory budget of {:.1f} MiB is too small for {} with {} {}: {} is the least that works",
        double(memory_bytes) / (1 << 20), file.path(), threads, threads == 1 ? "thread" : "threads",
        formatMebibytes(needed)));
  }

  MemoryPlan plan;
  const std::uint64_t spare = memory_bytes - fixed - *least_cache;
  plan.chunk_receivers = std::clamp(
      std::min(memory_bytes / 4, spare) / std::max<std::uint64_t>(per_receiver, 1), least, most);
  SURFEIT_ASSIGN_OR_RETURN(
      plan.caches, PagedOctree::planMemory(
                       file, memory_bytes - fixed - plan.chunk_receivers * per_receiver, threads));
  return plan;
}

// Streams the receivers through a ChunkGatherer. The buffers of a chunk are allocated once and
// touched only as far as receivers come.
class CloudGather {
 public:
  CloudGather(PlyReader& reader, const ReceiverMapping& mapping, const ResultRows& result_rows,
              const RootCube& cube, std::size_t row_bytes, std::uint64_t chunk_receivers,
              bool strict, Progress& progress)
      : reader_(reader),
        mapping_(mapping),
        result_rows_(result_rows),
        cube_(cube),
        row_bytes_(row_bytes),
        chunk_receivers_(chunk_receivers),
        strict_(strict),
        progress_(progress) {
    rows_.reserve(chunk_receivers * row_bytes);
    receivers_.reserve(chunk_receivers);
    order_.reserve(chunk_receivers);
    results_.reserve(chunk_receivers);
    output_.resize(kSliceRows * result_rows.rowBytes());
  }

  // Reads, gathers and writes until the input ends.
  Status run(ChunkGatherer& gatherer, PlyWriter& writer) {
    for (;;) {
      SURFEIT_RETURN_IF_ERROR(readChunk());
      if (receivers_.empty()) return {};
      std::sort(order_.begin(), order_.end());

      const auto begin = std::chrono::steady_clock::now();
      SURFEIT_RETURN_IF_ERROR(gatherer.gather(order_, receivers_, results_));
      gather_seconds_ += std::chrono::steady_clock::now() - begin;

      SURFEIT_RETURN_IF_ERROR(writeChunk(writer));
      record_ += receivers_.size();
    }
  }

  std::uint64_t receiverCount() const { return record_; }
  const SurfelDefects& defects() const { return defects_; }
  double gatherSeconds() const { return gather_seconds_.count(); }

 private:
  // Reads the next receivers and their places on the curve. Invalid ones get no place, and thus
  // keep the NaN that every result begins with.
  Status readChunk() {
    rows_.clear();
    receivers_.clear();
    order_.clear();
    while (receivers_.size() < chunk_receivers_) {
      if (progress_.isCancelled()) return Status::interrupted();
      const std::size_t begin = receivers_.size();
      const std::size_t room = std::min<std::size_t>(kSliceRows, chunk_receivers_ - begin);
      rows_.resize((begin + room) * row_bytes_);
      SURFEIT_ASSIGN_OR_RETURN(
          const std::size_t count,
          reader_.readRows(std::span(rows_).subspan(begin * row_bytes_, room * row_bytes_)));
      if (count == 0) break;
      for (std::size_t i = begin; i < begin + count; ++i) SURFEIT_RETURN_IF_ERROR(addReceiver(i));
    }
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    results_.assign(receivers_.size(), {.occlusion = kNan, .irradiance = glm::vec3(kNan)});
    progress_.advance(receivers_.size() - order_.size());
    return {};
  }

  Status addReceiver(std::size_t index) {
    Receiver& receiver = receivers_.emplace_back();
    const std::byte* row = rows_.data() + index * row_bytes_;
    if (mapping_.decode(row, record_ + index, receiver, defects_)) {
      order_.push_back({curveKey(receiver.position, cube_), static_cast<std::uint32_t>(index)});
    } else if (strict_) {
      return Status::corruption(fmt::format("{}: record {}: {}", reader_.path(), record_ + index,
                                            mapping_.describeDefect(row)));
    }
    return {};
  }

  Status writeChunk(PlyWriter& writer) {
    const std::size_t output_bytes = result_rows_.rowBytes();
    for (std::size_t begin = 0; begin < receivers_.size(); begin += kSliceRows) {
      if (progress_.isCancelled()) return Status::interrupted();
      const std::size_t count = std::min(kSliceRows, receivers_.size() - begin);
      for (std::size_t i = 0; i < count; ++i) {
        result_rows_.make(rows_.data() + (begin + i) * row_bytes_, results_[begin + i],
                          output_.data() + i * output_bytes);
      }
      SURFEIT_RETURN_IF_ERROR(writer.writeRows({output_.data(), count * output_bytes}));
    }
    return {};
  }

  PlyReader& reader_;
  const ReceiverMapping& mapping_;
  const ResultRows& result_rows_;
  const RootCube cube_;
  const std::size_t row_bytes_;
  const std::uint64_t chunk_receivers_;
  const bool strict_;
  Progress& progress_;

  // The chunk, in the order of the input but for `order_`
  std::vector<std::byte> rows_;
  std::vector<Receiver> receivers_;
  std::vector<GatherResult> results_;
  std::vector<OrderedReceiver> order_;
  std::vector<std::byte> output_;  // a slice of rows on their way out

  std::uint64_t record_ = 0;  // of the chunk's first receiver
  SurfelDefects defects_;
  std::chrono::duration<double> gather_seconds_{0};
};

// Tells what of the input the result does not keep, and what the gather makes of the rest.
void noteInput(const PlyReader& reader, std::size_t element, const ReceiverMapping& mapping,
               Progress& progress) {
  const PlyHeader& header = reader.header();
  if (!mapping.hasNormals()) {
    progress.note(fmt::format("{}: no normals: gathering over the whole sphere", reader.path()));
  }
  for (const PlyProperty& property : header.elements[element].properties) {
    if (!property.is_list) continue;
    progress.note(fmt::format("{}: list property {} is not kept", reader.path(), property.name));
  }
  for (std::size_t i = 0; i < header.elements.size(); ++i) {
    if (i == element) continue;
    progress.note(
        fmt::format("{}: element {} is not kept", reader.path(), header.elements[i].name));
  }
}

// The comments of the input, but for the blank ones that PlyWriter leaves for a count to grow.
std::vector<std::string> keptComments(const PlyHeader& header) {
  std::vector<std::string> comments = header.comments;
  std::erase_if(comments, [](const std::string& comment) {
    return comment.find_first_not_of(' ') == std::string::npos;
  });
  return comments;
}

GatherCacheStats cacheStats(const CacheCounters& counters) {
  return {.requests = counters.requests,
          .hits = counters.hits,
          .misses = counters.misses,
          .evictions = counters.evictions,
          .bytes_read = counters.bytes_read,
          .peak_bytes = counters.peak_bytes,
          .budget_bytes = counters.budget_bytes,
          .decoded_bytes = counters.decoded_bytes};
}

Result<GatherStats> gatherCloudOrThrow(const std::string& scene_path,
                                       const std::string& receivers_path,
                                       const std::string& result_path, const GatherOptions& options,
                                       Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  if (result_path == scene_path) {
    return Status::invalidArgument(
        fmt::format("{}: the result would replace the scene", scene_path));
  }
  GatherStats stats;
  stats.threads = options.threads > 0 ? options.threads : defaultThreadCount();
  stats.memory_bytes = options.memory_bytes > 0 ? options.memory_bytes : memoryLimitBytes() / 4 * 3;

  // Open scene and receivers
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(scene_path));
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(receivers_path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t element,
                           findSurfelElement(reader.header(), receivers_path));
  const PlyElement& receivers = reader.header().elements[element];
  SURFEIT_ASSIGN_OR_RETURN(const ReceiverMapping mapping,
                           ReceiverMapping::create(receivers, receivers_path));
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(element));
  const ResultRows result_rows(receivers, options.mode);

  // Spend the budget before anything large is allocated
  SURFEIT_ASSIGN_OR_RETURN(const MemoryPlan plan,
                           planGatherMemory(scene, stats.memory_bytes, stats.threads,
                                            options.quality, receivers, result_rows.rowBytes()));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), plan.caches));
  SURFEIT_ASSIGN_OR_RETURN(
      PlyWriter writer, PlyWriter::create(result_path, PlyEncoding::kBinaryLittleEndian,
                                          result_rows.properties(), keptComments(reader.header())));

  noteInput(reader, element, mapping, progress);
  progress.beginPhase("gather", receivers.count, "receivers");
  CloudGather gather(reader, mapping, result_rows, octree->file().header().cube,
                     receivers.row_bytes, plan.chunk_receivers, options.strict, progress);
  {
    ChunkGatherer gatherer(*octree, options, stats.threads, progress);
    SURFEIT_RETURN_IF_ERROR(gather.run(gatherer, writer));
  }  // the readers go, and with them their last counts reach the caches
  SURFEIT_RETURN_IF_ERROR(writer.finish());

  stats.receivers = gather.receiverCount();
  stats.invalid_receivers = gather.defects().total();
  if (stats.invalid_receivers > 0) {
    progress.note(fmt::format("{}: no result (NaN) at invalid receivers: {}", receivers_path,
                              gather.defects().describe()));
  }
  stats.gather_seconds = gather.gatherSeconds();
  stats.node_cache = cacheStats(octree->nodeCounters());
  stats.surfel_cache = cacheStats(octree->surfelCounters());
  return stats;
}

}  // namespace

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress) {
  try {
    return gatherCloudOrThrow(scene_path, receivers_path, result_path, options, progress);
  } catch (const std::bad_alloc&) {
    return Status::failed("out of memory");
  }
}

}  // namespace surfeit
