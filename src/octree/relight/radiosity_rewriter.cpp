#include "octree/relight/radiosity_rewriter.h"

#include <fmt/format.h>

#include <atomic>
#include <mutex>
#include <optional>
#include <vector>

#include "core/assert.h"
#include "core/first_failure.h"
#include "core/parallel.h"
#include "core/thread_scratch.h"
#include "octree/page/encoded_pages.h"
#include "octree/page/node_group.h"
#include "octree/page/scene_header.h"
#include "octree/page/surfel_group.h"
#include "octree/relight/radiosity_sweep.h"
#include "storage/page_codec.h"

namespace surfeit {
namespace {

// A surfel page on its way through the stages. Its memory is used again by a later one.
struct Work {
  std::uint32_t page = 0;
  std::vector<Surfel> surfels;
  std::vector<Lobe> lobes;  // of a source with lobes
  EncodedPages surfel_page;
  std::vector<SweptNodePage> swept;  // the node pages that it completed
  EncodedPages node_pages;
};

// Pages on their way: enough that stages do not wait for each other.
std::size_t pagesInFlight(int threads) { return static_cast<std::size_t>(threads) * 2 + 2; }

// Scratch of a thread.
struct Scratch {
  SceneFile::Scratch read;
  std::vector<glm::vec3> radiosity;
  std::vector<std::byte> payload, stored;
};
Scratch& threadScratchSpace() {
  return threadScratch<Scratch>([] {});
}

// The stages. What fails first ends the work: later stages pass what they get.
class Rewriting {
 public:
  Rewriting(const SceneFile& scene, RadiositySource& source, PageFileWriter& writer, int threads,
            Progress& progress)
      : scene_(scene),
        source_(source),
        writer_(writer),
        progress_(progress),
        sweep_(scene),
        works_(pagesInFlight(threads)) {
    for (std::size_t i = 0; i < works_.size(); ++i) free_works_.push_back(i);
  }

  Result<glm::dvec3> run();

 private:
  std::optional<std::size_t> takePage();
  Status replaceSurfels(Work& work);
  Status encodeNodes(Work& work);
  Status write(Work& work);
  void giveBack(Work& work);

  const SceneFile& scene_;
  RadiositySource& source_;
  PageFileWriter& writer_;
  Progress& progress_;
  RadiositySweep sweep_;
  FirstFailure failure_;
  std::uint32_t next_page_ = 0;
  std::vector<Work> works_;
  std::mutex free_mutex_;                // guards free_works_
  std::vector<std::size_t> free_works_;  // the last one given back is taken first: caches have it
};

std::optional<std::size_t> Rewriting::takePage() {
  if (progress_.isCancelled()) failure_.note(Status::interrupted());
  if (failure_.happened() || next_page_ == scene_.surfelPageCount()) return std::nullopt;
  const std::lock_guard lock(free_mutex_);
  SURFEIT_CHECK(!free_works_.empty());
  const std::size_t number = free_works_.back();
  free_works_.pop_back();
  works_[number].page = next_page_++;
  return number;
}

Status Rewriting::replaceSurfels(Work& work) {
  Scratch& scratch = threadScratchSpace();
  const SceneHeader& header = scene_.header();
  work.surfels.resize(header.surfel_group_capacity);
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                           scene_.decodeSurfels(work.page, scratch.read, work.surfels));
  work.surfels.resize(count);
  scratch.radiosity.resize(count);
  if (source_.hasLobes()) {
    work.lobes.resize(count);
    SURFEIT_RETURN_IF_ERROR(source_.read(work.page, scratch.radiosity, work.lobes));
  } else {
    SURFEIT_RETURN_IF_ERROR(source_.read(work.page, scratch.radiosity));
  }
  for (std::size_t i = 0; i < count; ++i) work.surfels[i].radiosity = scratch.radiosity[i];

  SURFEIT_ASSIGN_OR_RETURN(const std::size_t packed_bytes,
                           replaceSurfelRadiosity(scratch.read.payload, header.pageForm(),
                                                  scratch.radiosity, scratch.payload, work.lobes));
  SURFEIT_RETURN_IF_ERROR(compressPage(scratch.payload, packed_bytes, scratch.stored));
  work.surfel_page.clear();
  work.surfel_page.add(scratch.stored, scratch.payload.size());
  return {};
}

Status Rewriting::encodeNodes(Work& work) {
  Scratch& scratch = threadScratchSpace();
  work.node_pages.clear();
  for (const SweptNodePage& swept : work.swept) {
    const Result<std::size_t> packed_bytes = replaceNodeRadiosity(
        swept.payload, scene_.header().pageForm(), swept.nodes, scratch.payload, swept.lobes);
    if (!packed_bytes.ok()) {
      return scene_.pages().pageError(swept.page, packed_bytes.status().message());
    }
    SURFEIT_RETURN_IF_ERROR(compressPage(scratch.payload, *packed_bytes, scratch.stored));
    work.node_pages.add(scratch.stored, scratch.payload.size());
  }
  return {};
}

Status Rewriting::write(Work& work) {
  if (!work.surfels.empty()) {
    SURFEIT_RETURN_IF_ERROR(writer_.addSurfelPage(work.surfel_page.bytes,
                                                  work.surfel_page.pages.front().payload_bytes));
  }
  Bytes bytes = work.node_pages.bytes;
  for (std::size_t i = 0; i < work.swept.size(); ++i) {
    const EncodedPages::Page& page = work.node_pages.pages[i];
    SURFEIT_RETURN_IF_ERROR(writer_.addNodePage(bytes.first(page.stored_bytes), page.payload_bytes,
                                                static_cast<std::size_t>(work.swept[i].level)));
    bytes = bytes.subspan(page.stored_bytes);
  }
  work.swept.clear();
  progress_.advance(work.surfels.size());
  progress_.advanceBytes(work.surfel_page.bytes.size());
  return {};
}

void Rewriting::giveBack(Work& work) {
  const std::lock_guard lock(free_mutex_);
  free_works_.push_back(static_cast<std::size_t>(&work - works_.data()));
}

Result<glm::dvec3> Rewriting::run() {
  using Mode = PipelineStage::Mode;
  const auto stage = [this](Mode mode, Status (Rewriting::*work)(Work&)) {
    return PipelineStage{mode, [this, work](std::size_t i) {
                           if (!failure_.happened()) failure_.note((this->*work)(works_[i]));
                         }};
  };
  const PipelineStage sweep = {Mode::kInOrder, [this](std::size_t i) {
                                 if (failure_.happened()) return;
                                 Work& work = works_[i];
                                 failure_.note(sweep_.add(work.surfels, work.lobes, work.swept));
                               }};
  const PipelineStage stages[] = {
      stage(Mode::kParallel, &Rewriting::replaceSurfels),
      sweep,
      stage(Mode::kParallel, &Rewriting::encodeNodes),
      stage(Mode::kInOrder, &Rewriting::write),
      {Mode::kParallel, [this](std::size_t i) { giveBack(works_[i]); }}};
  runPipeline(
      works_.size(), [this] { return takePage(); }, stages);
  if (failure_.happened()) return failure_.status();

  // Node pages that no surfel completed: the last of each level
  Work rest;
  SURFEIT_RETURN_IF_ERROR(sweep_.finish(rest.swept));
  SURFEIT_RETURN_IF_ERROR(encodeNodes(rest));
  SURFEIT_RETURN_IF_ERROR(write(rest));
  const NodeSums& sums = sweep_.sums();
  if (sums.surfel_count != scene_.header().surfel_count) {
    return Status::corruption(fmt::format("{}: {} surfels on the pages, the header says {}",
                                          scene_.path(), sums.surfel_count,
                                          scene_.header().surfel_count));
  }
  return glm::dvec3(sums.radiosity[0], sums.radiosity[1], sums.radiosity[2]) / sums.area;
}

}  // namespace

Result<glm::dvec3> rewriteRadiosity(const SceneFile& scene, RadiositySource& source,
                                    PageFileWriter& writer, int threads, Progress& progress) {
  return Rewriting(scene, source, writer, threads, progress).run();
}

std::uint32_t rewrittenVersion(const SceneFile& scene, bool has_lobes) {
  const SceneHeader& header = scene.header();
  if (has_lobes) return kLobesFormatVersion;
  return header.has_lobes ? formatVersionFor(header.channels) : header.format_version;
}

std::vector<std::byte> rewrittenSceneFields(const SceneFile& scene, bool has_lobes) {
  SceneHeader header = scene.header();
  header.channels.radiosity = header.has_variances = header.has_slopes = true;
  header.has_lobes = has_lobes;
  return encodeSceneHeader(header);
}

std::uint64_t rewriteRadiosityBytes(const SceneFile& scene, int threads, bool has_lobes) {
  const SceneHeader& header = scene.header();
  const std::uint64_t lobe_bytes = has_lobes ? sizeof(Lobe) : 0;
  const std::uint64_t page_bytes =
      header.surfel_group_capacity * (sizeof(Surfel) + 64 + 2 * lobe_bytes);
  const std::uint64_t node_page_bytes =
      header.node_group_capacity * (sizeof(Node) + 2 * kMostFacets * lobe_bytes) +
      scene.pages().maxPayloadBytes();
  // A thread decodes and encodes a page; the columns of both take about as much again as the page
  const std::uint64_t thread_bytes = 3 * (page_bytes + node_page_bytes) +
                                     4 * std::uint64_t{scene.pages().maxPayloadBytes()} +
                                     (std::uint64_t{512} << 10);
  return pagesInFlight(threads) * (page_bytes + 2 * node_page_bytes) +
         (kCurveLevels + 1) * 2 * node_page_bytes +
         static_cast<std::uint64_t>(threads) * thread_bytes;
}

}  // namespace surfeit
