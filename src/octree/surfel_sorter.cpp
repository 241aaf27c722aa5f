#include "octree/surfel_sorter.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstring>

namespace surfeit {
namespace {

constexpr std::size_t kMinCapacity = 1024;
// Records written at once when a run is spilled.
constexpr std::size_t kSpillRecords = 16384;

}  // namespace

bool contentLess(const Surfel& a, const Surfel& b) {
  return std::memcmp(&a, &b, sizeof(Surfel)) < 0;
}

Result<std::unique_ptr<SurfelSorter>> SurfelSorter::create(std::size_t capacity,
                                                           std::uint64_t expected_count,
                                                           const RootCube& cube,
                                                           std::string temporary_directory) {
  capacity = std::max(capacity, kMinCapacity);
  std::unique_ptr<SurfelSorter> sorter(
      new SurfelSorter(capacity, cube, std::move(temporary_directory)));
  const std::size_t room =
      static_cast<std::size_t>(std::min<std::uint64_t>(capacity, expected_count));
  sorter->surfels_.reserve(room);
  sorter->tickets_.reserve(room);
  return sorter;
}

Status SurfelSorter::add(std::span<const Surfel> surfels) {
  for (const Surfel& surfel : surfels) {
    if (surfels_.size() == capacity_) SURFEIT_RETURN_IF_ERROR(spill());
    tickets_.push_back({curveKey(surfel.position, cube_), surfels_.size()});
    surfels_.push_back(surfel);
  }
  return {};
}

void SurfelSorter::sortTickets() {
  tbb::parallel_sort(tickets_.begin(), tickets_.end(), [this](const Ticket& a, const Ticket& b) {
    if (a.key != b.key) return a.key < b.key;
    return contentLess(surfels_[a.index], surfels_[b.index]);
  });
}

Status SurfelSorter::spill() {
  if (file_ == nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file, TemporaryFile::create(directory_));
    file_ = std::make_unique<TemporaryFile>(std::move(file));
  }
  sortTickets();
  Run run;
  run.offset = file_->size();
  run.records_left = tickets_.size();
  std::vector<SortedSurfel> batch;
  batch.reserve(kSpillRecords);
  for (std::size_t i = 0; i < tickets_.size(); ++i) {
    batch.push_back({tickets_[i].key, surfels_[tickets_[i].index]});
    if (batch.size() == kSpillRecords || i + 1 == tickets_.size()) {
      SURFEIT_RETURN_IF_ERROR(file_->append(std::as_bytes(std::span(batch))));
      batch.clear();
    }
  }
  spill_bytes_ = file_->size();
  runs_.push_back(std::move(run));
  tickets_.clear();
  surfels_.clear();
  return {};
}

Status SurfelSorter::finish() {
  if (runs_.empty()) {
    sortTickets();
    return {};
  }
  if (!tickets_.empty()) SURFEIT_RETURN_IF_ERROR(spill());
  // The memory of the surfels becomes the windows of the runs
  surfels_ = {};
  tickets_ = {};
  const std::size_t window = std::max<std::size_t>(capacity_ / runs_.size(), 64);
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    runs_[i].window.reserve(window);
    SURFEIT_RETURN_IF_ERROR(refill(runs_[i]));
    heap_.push_back(i);
  }
  std::make_heap(heap_.begin(), heap_.end(),
                 [this](std::size_t a, std::size_t b) { return comesAfter(a, b); });
  return {};
}

Status SurfelSorter::refill(Run& run) {
  const std::size_t count =
      static_cast<std::size_t>(std::min<std::uint64_t>(run.window.capacity(), run.records_left));
  run.window.resize(count);
  run.at = 0;
  SURFEIT_RETURN_IF_ERROR(file_->readAt(run.offset, std::as_writable_bytes(std::span(run.window))));
  run.offset += count * sizeof(SortedSurfel);
  run.records_left -= count;
  return {};
}

bool SurfelSorter::comesAfter(std::size_t a, std::size_t b) const {
  const SortedSurfel& first = runs_[a].window[runs_[a].at];
  const SortedSurfel& second = runs_[b].window[runs_[b].at];
  if (first.key != second.key) return first.key > second.key;
  return contentLess(second.surfel, first.surfel);
}

Result<std::size_t> SurfelSorter::next(std::span<SortedSurfel> out) {
  std::size_t filled = 0;
  if (runs_.empty()) {
    for (; filled < out.size() && taken_ < tickets_.size(); ++taken_) {
      out[filled++] = {tickets_[taken_].key, surfels_[tickets_[taken_].index]};
    }
    return filled;
  }
  const auto after = [this](std::size_t a, std::size_t b) { return comesAfter(a, b); };
  while (filled < out.size() && !heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), after);
    Run& run = runs_[heap_.back()];
    out[filled++] = run.window[run.at++];
    if (run.at == run.window.size()) {
      if (run.records_left == 0) {
        heap_.pop_back();
        continue;
      }
      SURFEIT_RETURN_IF_ERROR(refill(run));
    }
    std::push_heap(heap_.begin(), heap_.end(), after);
  }
  return filled;
}

}  // namespace surfeit
