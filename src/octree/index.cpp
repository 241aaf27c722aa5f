#include "surfeit/index.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/job_limits.h"
#include "io/surfel_source.h"
#include "octree/local_density.h"
#include "octree/octree_builder.h"
#include "octree/paged_octree.h"
#include "octree/scene_writer.h"
#include "octree/surfel_sorter.h"
#include "surfeit/version.h"

namespace surfeit {
namespace {

constexpr std::size_t kBatch = 16384;
// What the process takes beside sorter and caches: program, readers, builder, encoder.
constexpr std::uint64_t kOverheadBytes = 16 << 20;
constexpr std::uint64_t kLeastMemory = 32 << 20;

// What one pass over the inputs finds out.
struct Scan {
  Bounds3 bounds;
  std::uint64_t surfels = 0;
  std::uint64_t skipped = 0;
  std::uint64_t content = 0;  // sum of the surfels' hashes: the same in any order
  CloudChannels channels;
  std::uint64_t missing_both = 0, missing_area = 0, missing_radius = 0, spheres = 0;
};

// Seconds by phase.
class PhaseClock {
 public:
  explicit PhaseClock(IndexStats& stats) : stats_(stats) {}
  void finish(const char* phase) {
    const auto now = std::chrono::steady_clock::now();
    stats_.phase_seconds.emplace_back(phase, std::chrono::duration<double>(now - last_).count());
    last_ = now;
  }

 private:
  IndexStats& stats_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// The rules that need no neighbourhood (docs/format.md, "Rules for what is missing").
void applySizeRules(Surfel& surfel, float overlap) {
  if (surfel.radius > 0 && surfel.area > 0) return;
  if (surfel.radius > 0) {
    surfel.area = areaOfDisk(surfel.radius, overlap);
  } else if (surfel.area > 0) {
    surfel.radius = std::sqrt(surfel.area * overlap / kPi);
  } else {
    surfel.radius = surfel.area = kPlaceholderSize;
    surfel.flags |= kSurfelNeedsSize;
  }
}

class Indexer {
 public:
  Indexer(const std::vector<std::string>& inputs, const std::string& output,
          const IndexOptions& options, Progress& progress)
      : inputs_(inputs), output_(output), options_(options), progress_(progress) {
    threads_ = options.threads > 0 ? options.threads : defaultThreadCount();
    temporary_directory_ =
        options.temporary_directory.empty() ? directoryOf(output) : options.temporary_directory;
  }

  Result<IndexStats> run() {
    SURFEIT_RETURN_IF_ERROR(checkOptions());
    PhaseClock clock(stats_);
    SURFEIT_RETURN_IF_ERROR(scan());
    clock.finish("scan");
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<SurfelSorter> sorter, sort());
    clock.finish("sort");
    if (scan_.missing_both > 0) {
      SURFEIT_RETURN_IF_ERROR(buildWithDensity(std::move(sorter), clock));
    } else {
      SURFEIT_RETURN_IF_ERROR(build(output_, *sorter, options_.full_precision, "build"));
      clock.finish("build");
      stats_.temporary_bytes += sorter->temporaryBytes();
    }
    return stats_;
  }

 private:
  Status checkOptions() const;
  Status scan();
  Status scanInput(const std::string& path);
  void noteRules() const;
  Result<std::unique_ptr<SurfelSorter>> sort();
  Status build(const std::string& path, SortedSurfelStream& stream, bool full_precision,
               const char* phase);
  Status buildWithDensity(std::unique_ptr<SurfelSorter> sorter, PhaseClock& clock);
  std::uint64_t identity(bool full_precision) const;
  std::string provenance() const;

  const std::vector<std::string>& inputs_;
  const std::string& output_;
  const IndexOptions& options_;
  Progress& progress_;
  int threads_;
  std::string temporary_directory_;
  Scan scan_;
  IndexStats stats_;
};

Status Indexer::checkOptions() const {
  if (inputs_.empty()) return Status::invalidArgument("index: no input cloud");
  if (options_.leaf_capacity < 1 || options_.leaf_capacity > 4096) {
    return Status::invalidArgument(
        fmt::format("leaf capacity {}, expected 1 to 4096", options_.leaf_capacity));
  }
  if (!(options_.overlap >= 1 && options_.overlap <= 16)) {
    return Status::invalidArgument(
        fmt::format("overlap factor {}, expected 1 to 16", options_.overlap));
  }
  if (options_.memory_bytes < kLeastMemory) {
    return Status::budgetTooSmall(
        fmt::format("--memory of {} MiB is too small to index: {} MiB is "
                    "the least that works",
                    options_.memory_bytes >> 20, kLeastMemory >> 20));
  }
  return {};
}

Status Indexer::scan() {
  std::uint64_t records = 0;
  for (const std::string& path : inputs_) {
    SURFEIT_ASSIGN_OR_RETURN(const auto source, openSurfelSource(path, options_.strict));
    records += source->recordCount();
  }
  progress_.beginPhase("scan", records, "surfels");
  for (const std::string& path : inputs_) SURFEIT_RETURN_IF_ERROR(scanInput(path));
  if (scan_.surfels == 0) {
    return Status::corruption(
        fmt::format("{}: no valid surfel in {} records", inputs_.front(), records));
  }
  stats_.skipped_records = scan_.skipped;
  noteRules();
  return {};
}

Status Indexer::scanInput(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const auto source, openSurfelSource(path, options_.strict));
  std::vector<Surfel> batch(kBatch);
  for (;;) {
    if (progress_.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, source->read(batch));
    if (count == 0) break;
    for (const Surfel& surfel : std::span(batch).first(count)) {
      scan_.missing_both += surfel.radius <= 0 && surfel.area <= 0 ? 1 : 0;
      scan_.missing_area += surfel.radius > 0 && surfel.area <= 0 ? 1 : 0;
      scan_.missing_radius += surfel.radius <= 0 && surfel.area > 0 ? 1 : 0;
      scan_.spheres += surfel.isSphere() ? 1 : 0;
      scan_.bounds.add(surfel.position);
      scan_.content += XXH3_64bits(&surfel, sizeof surfel);
    }
    scan_.surfels += count;
    progress_.advance(count);
  }
  const CloudChannels channels = source->channels();
  scan_.channels.normal |= channels.normal;
  scan_.channels.radius |= channels.radius;
  scan_.channels.area |= channels.area;
  scan_.channels.radiosity |= channels.radiosity;
  scan_.channels.albedo |= channels.albedo;
  scan_.channels.two_sided |= channels.two_sided;
  if (const std::string defects = source->defects().describe(); !defects.empty()) {
    progress_.note(fmt::format("{}: skipped {}", path, defects));
  }
  scan_.skipped += source->defects().total();
  return {};
}

void Indexer::noteRules() const {
  if (scan_.missing_both > 0) {
    progress_.note(
        fmt::format("{} surfels have neither radius nor area: both follow from the "
                    "distance to their neighbours",
                    scan_.missing_both));
  }
  if (scan_.missing_area > 0) {
    progress_.note(fmt::format("{} surfels have no area: pi r^2 / {} is used", scan_.missing_area,
                               options_.overlap));
  }
  if (scan_.missing_radius > 0) {
    progress_.note(fmt::format("{} surfels have no radius: a disk of {} times the area is used",
                               scan_.missing_radius, options_.overlap));
  }
  if (scan_.spheres > 0) {
    progress_.note(
        fmt::format("warning: {} surfels have no normal: they are spheres, which look "
                    "the same from everywhere",
                    scan_.spheres));
  }
}

Result<std::unique_ptr<SurfelSorter>> Indexer::sort() {
  const std::uint64_t sorter_bytes = options_.memory_bytes - kOverheadBytes;
  SURFEIT_ASSIGN_OR_RETURN(
      std::unique_ptr<SurfelSorter> sorter,
      SurfelSorter::create(sorter_bytes / SurfelSorter::kBytesPerSurfel, scan_.surfels,
                           rootCube(scan_.bounds), temporary_directory_));
  progress_.beginPhase("sort", scan_.surfels, "surfels");
  std::vector<Surfel> batch(kBatch);
  for (const std::string& path : inputs_) {
    SURFEIT_ASSIGN_OR_RETURN(const auto source, openSurfelSource(path, options_.strict));
    for (;;) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, source->read(batch));
      if (count == 0) break;
      const std::span<Surfel> surfels = std::span(batch).first(count);
      for (Surfel& surfel : surfels) applySizeRules(surfel, options_.overlap);
      SURFEIT_RETURN_IF_ERROR(sorter->add(surfels));
      progress_.advance(count);
    }
  }
  SURFEIT_RETURN_IF_ERROR(sorter->finish());
  return sorter;
}

Status Indexer::build(const std::string& path, SortedSurfelStream& stream, bool full_precision,
                      const char* phase) {
  SceneHeader header;
  header.leaf_capacity = options_.leaf_capacity;
  header.node_group_capacity = kDefaultNodeGroup;
  header.surfel_group_capacity = kDefaultSurfelGroup;
  header.flatness_limit = kDefaultFlatnessLimit;
  header.bounds = scan_.bounds;
  header.cube = rootCube(scan_.bounds);
  header.channels = scan_.channels;
  header.full_precision = full_precision;
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<SceneWriter> writer,
      SceneWriter::create(path, header, identity(full_precision), temporary_directory_));
  progress_.beginPhase(phase, scan_.surfels, "surfels");
  OctreeBuilder builder(*writer);
  SURFEIT_RETURN_IF_ERROR(builder.build(stream, progress_));
  if (writer->header().surfel_count != scan_.surfels) {
    return Status::failed(
        fmt::format("{}: {} surfels in the second pass, {} in the first: an "
                    "input changed meanwhile",
                    output_, writer->header().surfel_count, scan_.surfels));
  }
  SURFEIT_RETURN_IF_ERROR(writer->finish(provenance()));
  stats_.surfels = writer->header().surfel_count;
  stats_.nodes = writer->header().node_count;
  stats_.node_pages = writer->nodePages();
  stats_.surfel_pages = writer->surfelPages();
  stats_.file_bytes = writer->fileBytes();
  stats_.temporary_bytes = std::max(stats_.temporary_bytes, writer->temporaryBytes());
  return {};
}

// Without sizes, an octree over the bare positions is built first; its neighbour searches give
// every surfel its size, and its curve order is the input of the real build.
Status Indexer::buildWithDensity(std::unique_ptr<SurfelSorter> sorter, PhaseClock& clock) {
  const std::string bare_path =
      fmt::format("{}/surfeit-density-{}.sft", temporary_directory_, getpid());
  SURFEIT_RETURN_IF_ERROR(build(bare_path, *sorter, /* full_precision= */ true, "order"));
  const std::uint64_t spilled = sorter->temporaryBytes();
  sorter.reset();
  Result<SceneFile> bare = SceneFile::open(bare_path);
  // The open file stays readable without its name, and goes with this process
  unlink(bare_path.c_str());
  if (!bare.ok()) return bare.status();
  const std::uint64_t bare_bytes = bare->fileBytes();
  const std::uint64_t order_bytes = spilled + stats_.temporary_bytes + bare_bytes;
  stats_.temporary_bytes = 0;
  clock.finish("order");

  const std::uint64_t cache_bytes = std::min<std::uint64_t>(
      options_.memory_bytes - kOverheadBytes, PagedOctree::unlimitedCacheBytes(*bare));
  SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                           PagedOctree::planMemory(*bare, cache_bytes, threads_));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(*bare), memory));
  SizedSurfelStream sized(*octree, options_.overlap, threads_);
  SURFEIT_RETURN_IF_ERROR(sized.prepare());
  SURFEIT_RETURN_IF_ERROR(build(output_, sized, options_.full_precision, "build"));
  stats_.temporary_bytes = std::max(order_bytes, stats_.temporary_bytes + bare_bytes);
  clock.finish("build");
  return {};
}

// Two files of one identity hold the same surfels built the same way.
std::uint64_t Indexer::identity(bool full_precision) const {
  const std::uint64_t parts[] = {scan_.content,
                                 scan_.surfels,
                                 kFormatVersion,
                                 options_.leaf_capacity,
                                 full_precision ? 1u : 0u,
                                 static_cast<std::uint64_t>(double(options_.overlap) * 65536)};
  return XXH3_64bits(parts, sizeof parts);
}

// Only what the surfels themselves do not say, and nothing that differs between equal runs: no
// time, no paths, no order.
std::string Indexer::provenance() const {
  const nlohmann::json json = {{"program", "surfeit"},
                               {"version", kVersion},
                               {"leaf_capacity", options_.leaf_capacity},
                               {"overlap", options_.overlap},
                               {"precision", options_.full_precision ? "full" : "quantized"},
                               {"skipped_records", scan_.skipped},
                               {"sizes_from_neighbours", scan_.missing_both},
                               {"areas_from_radius", scan_.missing_area},
                               {"radii_from_area", scan_.missing_radius},
                               {"spheres", scan_.spheres}};
  return json.dump();
}

}  // namespace

Result<IndexStats> indexClouds(const std::vector<std::string>& inputs, const std::string& output,
                               const IndexOptions& options, Progress& progress) {
  Indexer indexer(inputs, output, options, progress);
  const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
  tbb::task_arena arena(threads);
  Result<IndexStats> result = Status::failed("index: not run");
  arena.execute([&] { result = indexer.run(); });
  return result;
}

}  // namespace surfeit
