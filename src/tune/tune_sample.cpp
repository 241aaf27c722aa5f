// Half of the sample are stretches of neighbours, which tell how caches do that hold what
// neighbours share; the other half are single receivers spread evenly over the order, which tell
// what the gather as a whole comes back to. docs/tune.md.

#include "tune/tune_sample.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "batch/gather_options.h"
#include "core/first_failure.h"
#include "core/seconds_since.h"
#include "core/worker_threads.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "tune/look_up_trace.h"
#include "tune/sample_curve.h"
#include "tune/sampled_gather.h"

namespace surfeit {
namespace {

// Pages watched per cache.
constexpr std::size_t kTrackedPages = 16384;
// More stretches than this meet no more kinds of neighbourhoods that matter.
constexpr std::uint64_t kStretches = 64;
// Half of a stretch warms up: the threads' runs follow each other some times in it.
constexpr std::uint64_t kStretchRuns = 8;
// Stretches get this part of the sample; the rest are single clusters, which must be many to touch
// most of the pages that the whole gather touches.
constexpr std::uint64_t kStretchPart = 5;
// Receivers gathered at for their time: so many, or this part of the sample if that is more.
constexpr std::uint64_t kLeastTimed = 4096, kTimedPart = 16;
// A sample has some clusters of either kind.
constexpr std::uint64_t kLeastSample = 4 * kStretchPart * kClusterReceivers;

using Clock = std::chrono::steady_clock;

// Pieces of the order, evenly spread: piece i begins at place i * receivers / count.
class Pieces {
 public:
  Pieces(std::uint64_t receivers, std::uint64_t count, std::uint64_t length)
      : receivers_(receivers),
        length_(std::clamp(length, std::uint64_t{1}, receivers)),
        count_(std::clamp(count, std::uint64_t{1}, receivers / length_)) {
    drawn_.reserve(count_ * length_);
  }

  // Takes what belongs to them of the receivers at the next places of the order.
  void draw(std::span<const SortedReceiver> block) {
    const std::uint64_t block_end = place_ + block.size();
    while (piece_ < count_) {
      const std::uint64_t begin = beginOf(piece_), end = begin + length_;
      const std::uint64_t from = std::max(begin, place_), to = std::min(end, block_end);
      if (from < to) {
        const auto taken = block.subspan(from - place_, to - from);
        drawn_.insert(drawn_.end(), taken.begin(), taken.end());
      }
      if (end > block_end) break;
      ++piece_;
    }
    place_ = block_end;
  }

  std::uint64_t count() const { return count_; }
  std::span<const SortedReceiver> all() const { return drawn_; }
  std::span<const SortedReceiver> piece(std::uint64_t i) const {
    return all().subspan(i * length_, length_);
  }

 private:
  std::uint64_t beginOf(std::uint64_t piece) const {
    // Without overflow, and exact enough: the step is at least the length
    const std::uint64_t step = receivers_ / count_, rest = receivers_ % count_;
    return piece * step + piece * rest / count_;
  }

  std::uint64_t receivers_, length_, count_;
  std::uint64_t piece_ = 0, place_ = 0;
  std::vector<SortedReceiver> drawn_;
};

std::uint64_t stretchLength(std::uint64_t stretch_receivers, int threads) {
  const std::uint64_t least =
      kStretchRuns / 2 * PagingController::kFirstRun * static_cast<std::uint64_t>(threads);
  return std::max(stretch_receivers / kStretches, least);
}

class Sampling {
 public:
  Sampling(const std::string& scene_path, const PagedOctree::Memory& memory,
           const GatherOptions& options, int threads, Progress& progress)
      : scene_path_(scene_path),
        memory_(memory),
        options_(options),
        threads_(threads),
        progress_(progress) {}

  Result<TuneSample> run(ExternalSorter& sorter, std::uint64_t receivers,
                         std::uint64_t sample_receivers);

 private:
  Result<SceneFile> openScene() const {
    return SceneFile::open(scene_path_, sceneAccess(options_));
  }
  Status followAll(ExternalSorter& sorter, Pieces& timed);
  Status followPieces(const Pieces& stretches, const Pieces& spread, double share);
  Status followStretch(LookUpTrace& trace, std::span<const SortedReceiver> stretch,
                       StretchMisses& node_misses, StretchMisses& surfel_misses);
  Status timeGather(std::span<const SortedReceiver> receivers);

  const std::string& scene_path_;
  const PagedOctree::Memory& memory_;
  const GatherOptions& options_;
  const int threads_;
  Progress& progress_;
  std::unique_ptr<PagedOctree> octree_;
  TuneSample sample_;
};

Result<TuneSample> Sampling::run(ExternalSorter& sorter, std::uint64_t receivers,
                                 std::uint64_t sample_receivers) {
  const Clock::time_point begin = Clock::now();
  const std::uint64_t wanted = std::max(sample_receivers, kLeastSample);
  const bool takes_all = sample_receivers == 0 || wanted >= receivers;
  const std::uint64_t sampled = takes_all ? receivers : wanted;
  const std::uint64_t timed = std::max(kLeastTimed, sampled / kTimedPart);
  progress_.beginPhase("sample", sampled + 2 * std::min(timed, sampled), "receivers");
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openScene());
  PagedOctree::Memory memory = memory_;
  memory.tracked_pages = 0;  // they are tracked as receivers ask, not as a cache sees them
  SURFEIT_ASSIGN_OR_RETURN(octree_, PagedOctree::create(std::move(scene), memory));

  std::vector<SortedReceiver> timed_receivers;
  if (takes_all) {
    const std::uint64_t length = stretchLength(timed, threads_);
    Pieces pieces(receivers, timed / length, length);
    SURFEIT_RETURN_IF_ERROR(followAll(sorter, pieces));
    timed_receivers.assign(pieces.all().begin(), pieces.all().end());
  } else {
    const std::uint64_t in_stretches = sampled / kStretchPart;
    const std::uint64_t length = stretchLength(in_stretches, threads_);
    Pieces stretches(receivers, in_stretches / length, length);
    Pieces spread(receivers, (sampled - in_stretches) / kClusterReceivers, kClusterReceivers);
    std::vector<SortedReceiver> block(kQueueReceivers);
    for (std::size_t count = 1; count > 0;) {
      SURFEIT_ASSIGN_OR_RETURN(count, sorter.next(block));
      stretches.draw(std::span(block).first(count));
      spread.draw(std::span(block).first(count));
    }
    const double share = double(spread.all().size()) / double(receivers);
    SURFEIT_RETURN_IF_ERROR(followPieces(stretches, spread, share));
    const std::uint64_t skip = std::max<std::uint64_t>(stretches.all().size() / timed, 1);
    for (std::uint64_t i = 0; i < stretches.count(); i += skip) {
      const auto stretch = stretches.piece(i);
      timed_receivers.insert(timed_receivers.end(), stretch.begin(), stretch.end());
    }
  }
  octree_.reset();
  SURFEIT_RETURN_IF_ERROR(timeGather(timed_receivers));
  sample_.seconds = secondsSince(begin);
  return sample_;
}

// Draws those to be timed on the way.
Status Sampling::followAll(ExternalSorter& sorter, Pieces& timed) {
  LookUps look_ups(octree_->file(), kTrackedPages);
  LookUpTrace trace(*octree_, GatherRules(options_), threads_, progress_);
  SURFEIT_RETURN_IF_ERROR(trace.follow(
      [&](std::vector<SortedReceiver>& run) -> Status {
        run.resize(PagingController::kFirstRun);
        SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, sorter.next(run));
        run.resize(count);
        timed.draw(run);
        return {};
      },
      look_ups));
  sample_.nodes.curve = look_ups.node_distances.curve(look_ups.node_requests);
  sample_.surfels.curve = look_ups.surfel_distances.curve(look_ups.surfel_requests);
  sample_.receivers = look_ups.receivers;
  return {};
}

// The spread receivers are followed by one thread, in their order, and the stretches by the others
// meanwhile. What stretches add up to does not depend on who adds when: all counts are whole.
Status Sampling::followPieces(const Pieces& stretches, const Pieces& spread, double share) {
  const SceneFile& file = octree_->file();
  LookUps every(file, kTrackedPages), second(file, kTrackedPages);
  StretchMisses node_misses, surfel_misses;
  std::mutex misses_mutex;
  std::atomic<std::uint64_t> next_stretch{0};
  FirstFailure failure;
  std::atomic<bool> spread_is_taken{false};
  const auto work = [&]() -> Status {
    LookUpTrace trace(*octree_, GatherRules(options_), threads_, progress_);
    if (!spread_is_taken.exchange(true)) {
      SURFEIT_RETURN_IF_ERROR(trace.follow(spread.all(), every, &second));
    }
    StretchMisses node_part, surfel_part;
    while (!failure.happened()) {
      const std::uint64_t i = next_stretch++;
      if (i >= stretches.count()) break;
      SURFEIT_RETURN_IF_ERROR(followStretch(trace, stretches.piece(i), node_part, surfel_part));
    }
    const std::lock_guard lock(misses_mutex);
    node_misses.add(node_part);
    surfel_misses.add(surfel_part);
    return {};
  };
  SURFEIT_RETURN_IF_ERROR(runOnThreads(threads_, failure, "sample", work));

  const auto whole = [&](const StretchMisses& misses, const ReuseDistances& of_every,
                         std::uint64_t every_requests, const ReuseDistances& of_second,
                         std::uint64_t second_requests, std::uint64_t pages) {
    return wholeCurve(misses,
                      {of_every.curve(every_requests), of_second.curve(second_requests), share},
                      pages, of_every.pagesPerSample());
  };
  sample_.nodes.curve = whole(node_misses, every.node_distances, every.node_requests,
                              second.node_distances, second.node_requests, file.nodePageCount());
  sample_.surfels.curve =
      whole(surfel_misses, every.surfel_distances, every.surfel_requests, second.surfel_distances,
            second.surfel_requests, file.surfelPageCount());
  sample_.receivers = spread.all().size() + stretches.all().size();
  return {};
}

Status Sampling::followStretch(LookUpTrace& trace, std::span<const SortedReceiver> stretch,
                               StretchMisses& node_misses, StretchMisses& surfel_misses) {
  LookUps look_ups(octree_->file(), kTrackedPages);
  SURFEIT_RETURN_IF_ERROR(trace.follow(stretch.first(stretch.size() / 2), look_ups));
  node_misses.begin(look_ups.node_distances, look_ups.node_requests);
  surfel_misses.begin(look_ups.surfel_distances, look_ups.surfel_requests);
  SURFEIT_RETURN_IF_ERROR(trace.follow(stretch.subspan(stretch.size() / 2), look_ups));
  node_misses.end(look_ups.node_distances, look_ups.node_requests);
  surfel_misses.end(look_ups.surfel_distances, look_ups.surfel_requests);
  return {};
}

// Once to load the pages, and once more for the time without loading.
Status Sampling::timeGather(std::span<const SortedReceiver> receivers) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openScene());
  const auto page_bytes = [](const auto& bytesOf, std::uint64_t pages) {
    double bytes = 0;
    for (std::uint64_t page = 0; page < pages; ++page) bytes += double(bytesOf(page));
    return pages > 0 ? bytes / double(pages) : 0;
  };
  sample_.nodes.page_bytes =
      page_bytes([&](std::uint64_t page) { return scene.nodePageBytes(PageNumber(page)); },
                 scene.nodePageCount());
  sample_.surfels.page_bytes =
      page_bytes([&](std::uint64_t page) { return scene.surfelPageBytes(PageNumber(page)); },
                 scene.surfelPageCount());

  PagedOctree::Memory memory = memory_;
  memory.tracked_pages = 1;  // the controller asks for them
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<SampledGather> gather,
      SampledGather::create(std::move(scene), memory, options_, threads_, progress_));
  SURFEIT_RETURN_IF_ERROR(gather->gather(receivers).status());
  OctreeCaches& caches = gather->caches();
  const auto stalled = [&] {
    return double(caches.nodes().counters().stall_ns + caches.surfels().counters().stall_ns) * 1e-9;
  };
  const double stalled_before = stalled();
  SURFEIT_ASSIGN_OR_RETURN(double seconds, gather->gather(receivers));
  seconds -= (stalled() - stalled_before) / threads_;
  sample_.receiver_seconds = std::max(seconds, 0.0) / double(receivers.size());

  const auto load_seconds = [](const CacheCounters& counters) {
    return counters.misses > 0 ? double(counters.load_ns) * 1e-9 / double(counters.misses) : 0;
  };
  sample_.nodes.load_seconds = load_seconds(caches.nodes().counters());
  sample_.surfels.load_seconds = load_seconds(caches.surfels().counters());
  return {};
}

}  // namespace

std::uint64_t tuneSampleBytes(const SceneFile& file, std::uint64_t sample_receivers, int threads) {
  // Look-ups of a stretch on every thread, and twice those of the spread ones, each with a curve
  // and what is summed up of them; the receivers, and those timed once more
  const std::uint64_t look_ups =
      LookUps::memoryBytes(file, kTrackedPages) + 4 * sizeof(double) * std::uint64_t{kTrackedPages};
  const std::uint64_t timed = std::max(kLeastTimed, sample_receivers / kTimedPart);
  return (static_cast<std::uint64_t>(threads) + 2) * look_ups +
         (sample_receivers + 2 * timed + kQueueReceivers) * sizeof(SortedReceiver);
}

Result<TuneSample> sampleGather(const std::string& scene_path, ExternalSorter& sorter,
                                std::uint64_t receivers, std::uint64_t sample_receivers,
                                const PagedOctree::Memory& memory, const GatherOptions& options,
                                int threads, Progress& progress) {
  return Sampling(scene_path, memory, options, threads, progress)
      .run(sorter, receivers, sample_receivers);
}

}  // namespace surfeit
