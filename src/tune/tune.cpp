// A tuning reads the receivers once, to sort them, and follows a sample of them. All the rest is
// arithmetic on two miss-ratio curves, unless the user wants it checked.

#include "surfeit/tune.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <utility>

#include "batch/gather_crew.h"
#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "batch/gather_options.h"
#include "batch/memory_advice.h"
#include "batch/sorted_receiver.h"
#include "core/guard.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "storage/output_target.h"
#include "tune/quiet_progress.h"
#include "tune/tune_sample.h"

namespace surfeit {
namespace {

// Caches of the table, as parts of what would hold the whole file.
constexpr double kTableParts[] = {0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1};
// Sizes of the curve, in equal ratios.
constexpr int kCurveSizes = 64;
std::uint64_t loads(const GatherCacheStats& stats) { return stats.misses + stats.prefetches; }

TuneCache measuredCache(const GatherCacheStats& stats) {
  return {.frame_bytes = stats.budget_bytes,
          .requests = double(stats.requests),
          .loads = double(loads(stats)),
          .bytes_read = double(stats.bytes_read)};
}

class Tuning {
 public:
  Tuning(const std::string& scene_path, const std::string& receivers_path,
         const TuneOptions& options, Progress& progress)
      : scene_path_(scene_path),
        receivers_path_(receivers_path),
        options_(options),
        gather_(options.gather),
        progress_(progress) {}

  Result<TuneReport> run();

 private:
  Result<SceneFile> openScene() const { return SceneFile::open(scene_path_, sceneAccess(gather_)); }
  Result<GatherMemory> planOwnMemory() const;
  Status sample(const GatherMemory& memory);
  void predictAll();
  GatherLoads loads() const {
    return {sample_.nodes.curve, sample_.surfels.curve, sample_.nodes.load_seconds,
            sample_.surfels.load_seconds};
  }
  TuneRow predict(std::uint64_t memory_bytes) const;
  TuneRow predictCaches(std::uint64_t cache_bytes) const {
    return predict(memoryForCaches(*scene_, work_, cache_bytes));
  }
  Result<TuneOutcome> measure(std::uint64_t memory_bytes) const;
  Status check();

  const std::string& scene_path_;
  const std::string& receivers_path_;
  const TuneOptions& options_;
  GatherOptions gather_;  // with what the caller left open filled in
  Progress& progress_;

  std::unique_ptr<SceneFile> scene_;
  std::unique_ptr<GatherInput> input_;
  GatherWork work_;
  std::uint64_t sample_receivers_ = 0;
  std::uint64_t least_memory_ = 0;
  TuneSample sample_;
  TuneReport report_;
};

Result<TuneReport> Tuning::run() {
  SURFEIT_RETURN_IF_ERROR(checkGatherOptions(gather_));
  if (gather_.quality.max_variation > 0) {
    return Status::invalidArgument(
        "max variation: tuning follows every receiver and cannot tell which ones would be "
        "interpolated: leave it out (--max-variation); the gather then needs no more memory");
  }
  gather_ = withDefaults(gather_);
  if (gather_.temporary_directory.empty()) gather_.temporary_directory = spoolDirectory();

  // Open scene and receivers
  {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openScene());
    scene_ = std::make_unique<SceneFile>(std::move(scene));
    gather_.eye -= scene_->header().origin;
    SURFEIT_ASSIGN_OR_RETURN(GatherInput input,
                             GatherInput::open(receivers_path_, gather_.channels, gather_.part,
                                               gather_.filter, gather_.color_range));
    input_ = std::make_unique<GatherInput>(std::move(input));
  }
  SURFEIT_RETURN_IF_ERROR(checkGroupsFor(*scene_, gather_, progress_));
  SURFEIT_RETURN_IF_ERROR(input_->check(GatherRules(gather_)));
  work_ = gatherWork(input_->receivers(), gather_);
  sample_receivers_ = options_.sample_receivers == 0
                          ? work_.receivers
                          : std::min(options_.sample_receivers, work_.receivers);
  least_memory_ = leastGatherMemory(*scene_, work_);
  report_.receivers = work_.receivers;
  report_.threads = gather_.threads;
  report_.memory_bytes = gather_.memory_bytes;
  report_.decoded_cache_bytes = PagedOctree::unlimitedCacheBytes(*scene_);

  SURFEIT_ASSIGN_OR_RETURN(const GatherMemory memory, planOwnMemory());
  SURFEIT_RETURN_IF_ERROR(sample(memory));
  predictAll();
  if (options_.check) SURFEIT_RETURN_IF_ERROR(check());
  return report_;
}

// Beside a gather's own, a tuning needs memory for what it samples.
Result<GatherMemory> Tuning::planOwnMemory() const {
  const std::uint64_t beside = tuneSampleBytes(*scene_, sample_receivers_, gather_.threads);
  const std::uint64_t least = least_memory_ + beside;
  if (gather_.memory_bytes < least) {
    return refuseBudget(gather_.memory_bytes,
                        fmt::format("tuning {} with {} and a sample of {} receivers", scene_path_,
                                    describeThreads(gather_.threads), sample_receivers_),
                        least);
  }
  return planGatherMemory(*scene_, gather_.memory_bytes - beside, work_);
}

Status Tuning::sample(const GatherMemory& memory) {
  input_->note(progress_);
  progress_.beginPhase("sort", work_.receivers, "receivers");
  ExternalSorter sorter({.record_bytes = sizeof(SortedReceiver),
                         .count = work_.receivers,
                         .memory_bytes = memory.sorter_bytes,
                         .reading_bytes = memory.sorter_reading_bytes,
                         .temporary_directory = gather_.temporary_directory});
  SURFEIT_RETURN_IF_ERROR(
      input_->sort(gather_.order, scene_->header(), gather_.strict, sorter, progress_));
  report_.invalid_receivers = input_->defects().total();
  if (report_.invalid_receivers == report_.receivers) {
    return Status::corruption(
        fmt::format("{}: {} receivers, {} of them invalid, expected at least one that is valid",
                    receivers_path_, report_.receivers, report_.invalid_receivers));
  }
  if (report_.invalid_receivers > 0) {
    progress_.note(fmt::format("{}: invalid receivers left out: {}", receivers_path_,
                               input_->defects().describe()));
  }
  const std::uint64_t valid = report_.receivers - report_.invalid_receivers;
  SURFEIT_ASSIGN_OR_RETURN(
      sample_, sampleGather(scene_path_, sorter, valid, sample_receivers_, memory.caches, gather_,
                            gather_.threads, progress_));
  report_.sampled_receivers = sample_.receivers;
  report_.sample_seconds = sample_.seconds;
  report_.receiver_seconds = sample_.receiver_seconds;
  report_.node_load_seconds = sample_.nodes.load_seconds;
  report_.surfel_load_seconds = sample_.surfels.load_seconds;
  return {};
}

void Tuning::predictAll() {
  // The table
  const std::uint64_t all = report_.decoded_cache_bytes;
  report_.rows = {predict(least_memory_)};
  for (const double part : kTableParts) {
    const TuneRow row = predictCaches(static_cast<std::uint64_t>(part * double(all)));
    if (row.memory_bytes > report_.rows.back().memory_bytes) report_.rows.push_back(row);
  }

  // The curve, from the least to all
  const double least = double(report_.rows.front().cache_bytes);
  for (int i = 0; i < kCurveSizes; ++i) {
    const double size = least * std::pow(double(all) / least, double(i) / (kCurveSizes - 1));
    const TuneRow row = predictCaches(static_cast<std::uint64_t>(size));
    if (report_.curve.empty() || row.cache_bytes > report_.curve.back().cache_bytes) {
      report_.curve.push_back(row);
    }
  }

  // Beyond the knees of both, whatever the split
  const auto knee_loads = [](const MissRatioCurve& curve) { return curve.misses(curve.knee()); };
  const double most_loads = knee_loads(sample_.nodes.curve) + knee_loads(sample_.surfels.curve);
  report_.knee = predict(leastMemoryThat(*scene_, work_, [&](const GatherMemory& plan) {
    const CacheSplit split = predictSplit(*scene_, plan, loads());
    return sample_.nodes.curve.misses(split.first_frames) +
               sample_.surfels.curve.misses(split.second_frames) <=
           most_loads;
  }));
  // All seconds are those of all threads together
  const double working = double(report_.receivers - report_.invalid_receivers) *
                         sample_.receiver_seconds * gather_.threads;
  const double best = working + loads().leastLoadSeconds();
  report_.recommended =
      predict(memoryForLoads(*scene_, work_, loads(), (1 + kTuneTimeMargin) * best - working));
}

TuneRow Tuning::predict(std::uint64_t memory_bytes) const {
  TuneRow row;
  row.memory_bytes = memory_bytes;
  const Result<GatherMemory> plan = planGatherMemory(*scene_, memory_bytes, work_);
  if (!plan.ok()) return row;  // never: no budget here is below the least
  row.cache_bytes = std::min(plan->cache_bytes, report_.decoded_cache_bytes);

  const CacheSplit split = predictSplit(*scene_, *plan, loads());

  const auto outcome = [](const CacheSample& cache, std::size_t frames, std::size_t frame_bytes) {
    const double pages = cache.curve.misses(frames);
    return TuneCache{.frame_bytes = frames * frame_bytes,
                     .requests = cache.curve.lookups(),
                     .loads = pages,
                     .bytes_read = pages * cache.page_bytes};
  };
  row.predicted.node_cache =
      outcome(sample_.nodes, split.first_frames, PagedOctree::nodeFrameBytes(*scene_));
  row.predicted.surfel_cache =
      outcome(sample_.surfels, split.second_frames, PagedOctree::surfelFrameBytes(*scene_));
  row.predicted.seconds =
      double(report_.receivers - report_.invalid_receivers) * sample_.receiver_seconds +
      split.load_seconds / gather_.threads;
  return row;
}

// The gather as it is, but for its results.
Result<TuneOutcome> Tuning::measure(std::uint64_t memory_bytes) const {
  QuietProgress progress(progress_);
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openScene());
  SURFEIT_ASSIGN_OR_RETURN(const GatherMemory memory, planGatherMemory(scene, memory_bytes, work_));
  ExternalSorter sorter({.record_bytes = sizeof(SortedReceiver),
                         .count = work_.receivers,
                         .memory_bytes = memory.sorter_bytes,
                         .reading_bytes = memory.sorter_reading_bytes,
                         .temporary_directory = gather_.temporary_directory});
  progress.beginPhase("sort", work_.receivers, "receivers");
  SURFEIT_RETURN_IF_ERROR(
      input_->sort(gather_.order, scene.header(), gather_.strict, sorter, progress));
  GatherStats stats;
  stats.receivers = work_.receivers;
  stats.invalid_receivers = report_.invalid_receivers;
  stats.threads = gather_.threads;
  stats.memory_bytes = memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<SortedGather> gather,
      SortedGather::create(std::move(scene), memory, gather_, stats, progress));
  SURFEIT_RETURN_IF_ERROR(
      gather->gather(sorter, [](std::span<const ResultStore::Entry>) { return Status(); }));
  gather->finish();
  return TuneOutcome{measuredCache(stats.node_cache), measuredCache(stats.surfel_cache),
                     stats.gather_seconds};
}

Status Tuning::check() {
  const auto measure_row = [&](TuneRow& row) -> Status {
    if (row.memory_bytes > gather_.memory_bytes) return {};
    SURFEIT_ASSIGN_OR_RETURN(row.measured, measure(row.memory_bytes));
    return {};
  };
  for (TuneRow& row : report_.rows) SURFEIT_RETURN_IF_ERROR(measure_row(row));
  return measure_row(report_.recommended);
}

}  // namespace

std::optional<double> TuneReport::hitRateError() const {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const TuneRow& row = rows[i];
    if (!row.measured) continue;
    for (const auto cache : {&TuneOutcome::node_cache, &TuneOutcome::surfel_cache}) {
      sum += std::abs((row.predicted.*cache).hitRate() - ((*row.measured).*cache).hitRate());
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  return 100 * sum / count;
}

Result<TuneReport> tuneGather(const std::string& scene_path, const std::string& receivers_path,
                              const TuneOptions& options, Progress& progress) {
  return guarded(receivers_path, [&]() -> Result<TuneReport> {
    return Tuning(scene_path, receivers_path, options, progress).run();
  });
}

}  // namespace surfeit
