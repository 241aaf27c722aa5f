#include "storage/record_sorter.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "core/assert.h"
#include "core/parallel.h"

namespace surfeit {
namespace {

constexpr std::size_t kFileBlocks = 2;
constexpr std::uint64_t kFileBytes = std::uint64_t{2} << 20;  // of its writer
constexpr std::uint64_t kLeastBlockBytes = 64 << 10;
constexpr std::uint64_t kMostBlockBytes = 1 << 20;

std::uint64_t wordAt(const std::byte* bytes) {
  std::uint64_t word = 0;
  std::memcpy(&word, bytes, sizeof word);
  return word;
}

// Whether record `a` comes before `b`, the first words being equal.
bool restIsLess(const std::byte* a, const std::byte* b, std::size_t record_bytes) {
  const std::uint64_t second_a = wordAt(a + 8), second_b = wordAt(b + 8);
  if (second_a != second_b) return second_a < second_b;
  return std::memcmp(a + RecordSorter::kKeyBytes, b + RecordSorter::kKeyBytes,
                     record_bytes - RecordSorter::kKeyBytes) < 0;
}

}  // namespace

// A heap of the runs by their next records; the least is on top.
class RecordSorter::Merge {
 public:
  Merge(const TemporaryFile& file, std::size_t record_bytes, std::uint64_t block_bytes,
        std::span<const Run> runs)
      : file_(file), record_bytes_(record_bytes) {
    block_bytes_ = std::max<std::uint64_t>(block_bytes / record_bytes, 1) * record_bytes;
    for (const Run& run : runs) inputs_.push_back({run, {}, {}});
  }

  // Every input from the place of a mark on.
  Status begin(const Mark& places) {
    heap_.clear();
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      Input& input = inputs_[i];
      input.next_block = places[i];
      input.block = {};
      SURFEIT_RETURN_IF_ERROR(readBlock(input));
      if (!input.block.empty()) heap_.push_back({wordAt(input.block.data()), i});
    }
    std::make_heap(heap_.begin(), heap_.end(), After{this});
    return {};
  }

  const std::byte* current() const {
    return heap_.empty() ? nullptr : inputs_[heap_.front().input].block.data();
  }

  Status advance() {
    std::pop_heap(heap_.begin(), heap_.end(), After{this});
    const std::size_t index = heap_.back().input;
    Input& input = inputs_[index];
    input.block = input.block.subspan(record_bytes_);
    if (input.block.empty()) SURFEIT_RETURN_IF_ERROR(readBlock(input));
    if (input.block.empty()) {
      heap_.pop_back();
    } else {
      heap_.back().key = wordAt(input.block.data());
      std::push_heap(heap_.begin(), heap_.end(), After{this});
    }
    return {};
  }

  Mark mark() const {
    Mark places;
    for (const Input& input : inputs_) places.push_back(input.next_block - input.block.size());
    return places;
  }

 private:
  struct Input {
    Run run;
    AlignedBuffer buffer;
    Bytes block;  // from the next record on
    std::uint64_t next_block = 0;
  };
  struct Head {
    std::uint64_t key = 0;
    std::size_t input = 0;
  };
  struct After {
    const Merge* merge;
    bool operator()(const Head& a, const Head& b) const {
      if (a.key != b.key) return a.key > b.key;
      const std::byte* at_a = merge->inputs_[a.input].block.data();
      const std::byte* at_b = merge->inputs_[b.input].block.data();
      return restIsLess(at_b, at_a, merge->record_bytes_);
    }
  };

  Status readBlock(Input& input) {
    const std::uint64_t bytes = std::min(block_bytes_, input.run.end - input.next_block);
    input.block = {};
    if (bytes == 0) return {};
    SURFEIT_ASSIGN_OR_RETURN(input.block, file_.readView(input.next_block, bytes, input.buffer));
    input.next_block += bytes;
    return {};
  }

  const TemporaryFile& file_;
  std::size_t record_bytes_;
  std::uint64_t block_bytes_;
  std::vector<Input> inputs_;
  std::vector<Head> heap_;
};

RecordSorter::RecordSorter(Options options) : options_(std::move(options)) {
  SURFEIT_CHECK(options_.memory_bytes >= kLeastMemory);
  SURFEIT_CHECK(options_.record_bytes >= kKeyBytes && options_.record_bytes % 4 == 0);
  capacity_ = static_cast<std::size_t>((options_.memory_bytes - kFileBytes) /
                                       (options_.record_bytes + sizeof(Ticket)));
}

RecordSorter::~RecordSorter() = default;

std::size_t RecordSorter::mostInputs(std::uint64_t memory) const {
  // Reading takes up to two alignments more than a block
  const std::uint64_t block = std::max<std::uint64_t>(kLeastBlockBytes, options_.record_bytes);
  return static_cast<std::size_t>(
      std::max<std::uint64_t>(memory / (block + 2 * kDirectAlignment), 2));
}

Status RecordSorter::add(const std::byte* record) {
  if (filled_ == capacity_) SURFEIT_RETURN_IF_ERROR(spill());
  // Only what is written is ever touched
  memory_.reserve(capacity_ * options_.record_bytes);
  std::memcpy(memory_.data() + filled_ * options_.record_bytes, record, options_.record_bytes);
  ++filled_;
  ++count_;
  return {};
}

void RecordSorter::sortTickets() {
  tickets_.resize(filled_);
  const std::size_t bytes = options_.record_bytes;
  for (std::size_t i = 0; i < filled_; ++i) tickets_[i] = {wordAt(memory_.data() + i * bytes), i};
  parallelSort(tickets_.begin(), tickets_.end(),
               [records = memory_.data(), bytes](const Ticket& a, const Ticket& b) {
                 if (a.key != b.key) return a.key < b.key;
                 return restIsLess(records + a.index * bytes, records + b.index * bytes, bytes);
               });
}

Status RecordSorter::spill() {
  if (file_ == nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file,
                             TemporaryFile::create(options_.temporary_directory, kFileBlocks));
    file_ = std::make_unique<TemporaryFile>(std::move(file));
  }
  sortTickets();
  Run run{file_->size(), 0};
  for (const Ticket& ticket : tickets_) {
    SURFEIT_RETURN_IF_ERROR(
        file_
            ->append({memory_.data() + ticket.index * options_.record_bytes, options_.record_bytes})
            .status());
  }
  run.end = file_->size();
  runs_.push_back(run);
  filled_ = 0;
  return {};
}

// Merges the first runs into one while there are more than can be read at once.
Status RecordSorter::mergeDownTo(std::size_t most_runs) {
  while (runs_.size() > most_runs) {
    const std::size_t inputs = std::min(most_runs, runs_.size() - most_runs + 1);
    SURFEIT_RETURN_IF_ERROR(file_->flush());
    const std::span<const Run> merged(runs_.data(), inputs);
    Merge merge(*file_, options_.record_bytes, kLeastBlockBytes, merged);
    Mark places;
    for (const Run& run : merged) places.push_back(run.begin);
    SURFEIT_RETURN_IF_ERROR(merge.begin(places));
    Run result{file_->size(), 0};
    while (merge.current() != nullptr) {
      SURFEIT_RETURN_IF_ERROR(file_->append({merge.current(), options_.record_bytes}).status());
      SURFEIT_RETURN_IF_ERROR(merge.advance());
    }
    result.end = file_->size();
    for (const Run& run : merged) file_->release(run.begin, run.end - run.begin);
    runs_.erase(runs_.begin(), runs_.begin() + static_cast<std::ptrdiff_t>(inputs));
    runs_.push_back(result);
  }
  return {};
}

Status RecordSorter::finish() {
  if (file_ == nullptr) {
    sortTickets();
    return reset({0});
  }
  if (filled_ > 0) SURFEIT_RETURN_IF_ERROR(spill());
  memory_ = {};
  std::vector<Ticket>().swap(tickets_);
  const std::uint64_t memory = options_.memory_bytes / 4;
  SURFEIT_RETURN_IF_ERROR(mergeDownTo(mostInputs(memory)));
  SURFEIT_RETURN_IF_ERROR(file_->flush());
  const std::uint64_t block_bytes = std::clamp<std::uint64_t>(
      memory / runs_.size() - std::min<std::uint64_t>(memory / runs_.size(), 2 * kDirectAlignment),
      kLeastBlockBytes, kMostBlockBytes);
  merge_ = std::make_unique<Merge>(*file_, options_.record_bytes, block_bytes, runs_);
  Mark places;
  for (const Run& run : runs_) places.push_back(run.begin);
  return reset(places);
}

Status RecordSorter::advance() {
  if (merge_ != nullptr) {
    SURFEIT_RETURN_IF_ERROR(merge_->advance());
    current_ = merge_->current();
    return {};
  }
  ++place_;
  current_ =
      place_ < filled_ ? memory_.data() + tickets_[place_].index * options_.record_bytes : nullptr;
  return {};
}

RecordSorter::Mark RecordSorter::mark() const {
  return merge_ != nullptr ? merge_->mark() : Mark{place_};
}

Status RecordSorter::reset(const Mark& mark) {
  if (merge_ != nullptr) {
    SURFEIT_RETURN_IF_ERROR(merge_->begin(mark));
    current_ = merge_->current();
    return {};
  }
  place_ = static_cast<std::size_t>(mark.front());
  current_ =
      place_ < filled_ ? memory_.data() + tickets_[place_].index * options_.record_bytes : nullptr;
  return {};
}

}  // namespace surfeit
