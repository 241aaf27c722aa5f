// Runs are made of units of 511 receivers, the last of fewer:
//
//   [ checksum : 8 | zeros : 48 | receivers : 56 each | zeros up to the next page ]
#include "batch/receiver_sorter.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <limits>
#include <utility>

#include "core/assert.h"
#include "core/parallel.h"
#include "storage/block_writer.h"

namespace surfeit {
namespace {

// Units end and begin with pages, as direct I/O wants them.
constexpr std::size_t kUnitReceivers = 511;
constexpr std::size_t kUnitHeaderBytes = 56;
constexpr std::size_t kUnitBytes = kUnitHeaderBytes + kUnitReceivers * sizeof(SortedReceiver);
static_assert(kUnitBytes % kDirectAlignment == 0);

// Bytes of a run.
std::uint64_t runBytes(std::uint64_t receivers) {
  const std::uint64_t rest = receivers % kUnitReceivers;
  return receivers / kUnitReceivers * kUnitBytes +
         (rest > 0 ? alignedUp(kUnitHeaderBytes + rest * sizeof(SortedReceiver)) : 0);
}

// The offset is part of it, so that a unit read from elsewhere does not pass.
std::uint64_t checksumOf(Bytes receivers, std::uint64_t unit_offset) {
  return XXH3_64bits_withSeed(receivers.data(), receivers.size(), unit_offset);
}

// Blocks, what a merge reads at once, are some units. Larger ones are not read faster.
constexpr std::uint64_t kMostBlockUnits = 36;
// Space is given back in pieces of about this size: each takes a call.
constexpr std::uint64_t kReleaseBytes = 1 << 20;

constexpr std::size_t kFileBlocks = 2;
// The file's blocks, the list of runs, and as much again for what is small.
constexpr std::uint64_t kRunListBytes = ReceiverSorter::kMostRuns * 16;
constexpr std::uint64_t kSpillBytes = kFileBlocks * BlockWriter::kBlockBytes + 2 * kRunListBytes;
constexpr std::uint64_t kLeastRunBytes = 1 << 20;
// What a merge holds of a run beside its block: state, and what aligning the block costs.
constexpr std::uint64_t kStateBytes = 256;
constexpr std::uint64_t kInputBytes = kStateBytes + kDirectAlignment;

// How many runs can be merged in `bytes`, with one block more for what comes out.
std::uint64_t mostInputs(std::uint64_t bytes, std::uint64_t block_bytes) {
  return (bytes - block_bytes) / (block_bytes + kInputBytes);
}

// The largest sensible blocks with which so many runs, or the most that can be, are merged.
std::uint64_t mergeBlockBytes(std::uint64_t bytes, std::uint64_t runs) {
  const std::uint64_t share = bytes / (runs + 1);
  const std::uint64_t units = share > kInputBytes ? (share - kInputBytes) / kUnitBytes : 0;
  return std::clamp<std::uint64_t>(units, 1, kMostBlockUnits) * kUnitBytes;
}

}  // namespace

// Merges runs of a file by a tree of losers (Knuth, The Art of Computer Programming 3, 5.4.1): one
// comparison per level, with the same nodes for every receiver of a run.
class ReceiverSorter::Merge {
 public:
  Merge(ReceiverSorter& sorter, std::span<const Run> runs, std::uint64_t block_bytes)
      : file_(*sorter.file_),
        directory_(sorter.options_.temporary_directory),
        block_bytes_(block_bytes),
        inputs_(runs.size()),
        losers_(runs.size()) {
    for (std::size_t i = 0; i < runs.size(); ++i) inputs_[i].run = inputs_[i].held = runs[i];
  }

  // Reads the first blocks.
  Status begin() {
    if (inputs_.empty()) return {};
    // From the leaves up, the less of two goes on and the other stays
    std::vector<Head> winners(2 * inputs_.size());
    for (std::uint32_t i = 0; i < inputs_.size(); ++i) {
      SURFEIT_RETURN_IF_ERROR(nextUnit(inputs_[i]));
      winners[inputs_.size() + i] = headOf(i);
    }
    for (std::size_t node = inputs_.size() - 1; node > 0; --node) {
      Head winner = winners[2 * node], loser = winners[2 * node + 1];
      if (loser < winner) std::swap(winner, loser);
      winners[node] = winner;
      losers_[node] = loser;
    }
    winner_ = winners[1];
    return {};
  }

  Result<std::size_t> next(std::span<SortedReceiver> out) {
    std::size_t count = 0;
    while (count < out.size() && winner_.input != kNoInput) {
      Input& input = inputs_[winner_.input];
      out[count++] = *input.next++;
      if (input.next == input.end) SURFEIT_RETURN_IF_ERROR(nextUnit(input));
      Head head = headOf(winner_.input);
      for (std::size_t node = (inputs_.size() + winner_.input) / 2; node > 0; node /= 2) {
        if (losers_[node] < head) std::swap(losers_[node], head);
      }
      winner_ = head;
    }
    return count;
  }

 private:
  struct Input {
    Run run;   // from the next unit on
    Run held;  // what has not been given back
    AlignedBuffer block;
    Bytes units;                           // in the block, that have not been begun
    const SortedReceiver* next = nullptr;  // in a unit
    const SortedReceiver* end = nullptr;
  };
  static constexpr std::uint32_t kNoInput = std::numeric_limits<std::uint32_t>::max();
  // The next receiver of an input, copied so that comparing need not look into blocks. Without an
  // input it comes after all others.
  struct Head {
    CurveKey key = std::numeric_limits<CurveKey>::max();
    std::uint64_t index = 0;
    std::uint32_t input = kNoInput;

    bool operator<(const Head& other) const {
      return key != other.key ? key < other.key : index < other.index;
    }
  };
  static_assert(sizeof(Input) + 3 * sizeof(Head) + sizeof(Run) <= kStateBytes);

  Head headOf(std::uint32_t input) const {
    const SortedReceiver* next = inputs_[input].next;
    return next != inputs_[input].end ? Head{next->key, next->index, input} : Head();
  }

  // Goes on with the next unit of a run; none is left of a run that has ended.
  Status nextUnit(Input& input) {
    input.next = input.end = nullptr;
    if (input.units.empty()) SURFEIT_RETURN_IF_ERROR(readBlock(input));
    const std::size_t count =
        static_cast<std::size_t>(std::min<std::uint64_t>(kUnitReceivers, input.run.receivers));
    if (count == 0) return {};
    const Bytes unit = input.units.first(runBytes(count));
    const Bytes receivers = unit.subspan(kUnitHeaderBytes, count * sizeof(SortedReceiver));
    std::uint64_t checksum = 0;
    std::memcpy(&checksum, unit.data(), sizeof checksum);
    if (const std::uint64_t found = checksumOf(receivers, input.run.offset); found != checksum) {
      return Status::ioError(
          fmt::format("{} (temporary file): {} receivers at {}: checksum {:016x}, expected {:016x}",
                      directory_, count, input.run.offset, found, checksum));
    }
    input.next = reinterpret_cast<const SortedReceiver*>(receivers.data());
    input.end = input.next + count;
    input.units = input.units.subspan(unit.size());
    input.run.offset += unit.size();
    input.run.receivers -= count;
    return {};
  }

  // Reads the next block of a run over the one before.
  Status readBlock(Input& input) {
    giveBack(input);
    const std::uint64_t bytes = std::min(block_bytes_, runBytes(input.run.receivers));
    if (bytes == 0) {
      input.block = {};
      return {};
    }
    SURFEIT_ASSIGN_OR_RETURN(input.units, file_.readView(input.run.offset, bytes, input.block));
    return {};
  }

  void giveBack(Input& input) {
    const std::uint64_t bytes = input.run.offset - input.held.offset;
    if (bytes == 0 || (bytes < kReleaseBytes && input.run.receivers > 0)) return;
    file_.release(input.held.offset, bytes);
    input.held = input.run;
  }

  TemporaryFile& file_;
  const std::string& directory_;
  const std::uint64_t block_bytes_;
  std::vector<Input> inputs_;
  // losers_[1] is the root; the parent of node n is n / 2, and that of input i is (inputs + i) / 2.
  std::vector<Head> losers_;
  Head winner_;
};

std::uint64_t ReceiverSorter::leastMemoryBytes(std::uint64_t count) {
  constexpr std::uint64_t kLeast = kSpillBytes + kLeastRunBytes;
  return count < kLeast / sizeof(SortedReceiver) ? count * sizeof(SortedReceiver) : kLeast;
}

ReceiverSorter::ReceiverSorter(Options options) : options_(std::move(options)) {
  static_assert(kMostRuns * sizeof(Run) <= kRunListBytes);
  const std::uint64_t reading =
      options_.reading_bytes > 0 ? options_.reading_bytes : options_.memory_bytes;
  SURFEIT_CHECK(std::min(options_.memory_bytes, reading) >= leastMemoryBytes(options_.count));
  SURFEIT_CHECK(options_.most_runs >= 2 && options_.most_runs <= kMostRuns);
  std::uint64_t most = std::min(options_.memory_bytes, reading) / sizeof(SortedReceiver);
  if (options_.count > most) {
    merge_bytes_ = options_.memory_bytes - kSpillBytes;
    reading_bytes_ = reading - kSpillBytes;
    most = merge_bytes_ / sizeof(SortedReceiver) / kUnitReceivers * kUnitReceivers;
    runs_.reserve(options_.most_runs);
  }
  capacity_ = static_cast<std::size_t>(std::min(options_.count, most));
  memory_.reserve(capacity_ * sizeof(SortedReceiver));
}

ReceiverSorter::~ReceiverSorter() = default;

std::span<SortedReceiver> ReceiverSorter::receivers() const {
  return {reinterpret_cast<SortedReceiver*>(memory_.data()), filled_};
}

Status ReceiverSorter::add(const SortedReceiver& receiver) {
  SURFEIT_CHECK(added_ < options_.count);
  SURFEIT_ASSERT(receiver.key >> 63 == 0);
  if (filled_ == capacity_) {
    SURFEIT_RETURN_IF_ERROR(spill());
    if (runs_.size() == options_.most_runs) {
      memory_ = {};
      SURFEIT_RETURN_IF_ERROR(mergeDownTo(options_.most_runs / 2));
      memory_.reserve(capacity_ * sizeof(SortedReceiver));
    }
  }
  ++filled_;
  receivers().back() = receiver;
  ++added_;
  return {};
}

// Writes what is in memory as a run.
Status ReceiverSorter::spill() {
  if (file_ == nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file,
                             TemporaryFile::create(options_.temporary_directory, kFileBlocks));
    file_ = std::make_unique<TemporaryFile>(std::move(file));
  }
  parallelSort(receivers().begin(), receivers().end(), std::less<>());
  runs_.push_back({.offset = file_->size(), .receivers = filled_});
  SURFEIT_RETURN_IF_ERROR(appendUnits(receivers()));
  filled_ = 0;
  return {};
}

Status ReceiverSorter::appendUnits(std::span<const SortedReceiver> sorted) {
  static constexpr std::array<std::byte, kDirectAlignment> kZeros{};
  while (!sorted.empty()) {
    const std::size_t count = std::min(sorted.size(), kUnitReceivers);
    const Bytes receivers = std::as_bytes(sorted.first(count));
    std::array<std::byte, kUnitHeaderBytes> header{};
    const std::uint64_t checksum = checksumOf(receivers, file_->size());
    std::memcpy(header.data(), &checksum, sizeof checksum);
    const std::size_t padding = runBytes(count) - header.size() - receivers.size();
    for (const Bytes part : {Bytes(header), receivers, Bytes(kZeros).first(padding)}) {
      SURFEIT_RETURN_IF_ERROR(file_->append(part).status());
    }
    sorted = sorted.subspan(count);
  }
  return {};
}

// Merges runs until no more than so many are left, from the oldest on and to the end of the list,
// so that all are merged about as often.
Status ReceiverSorter::mergeDownTo(std::size_t most_runs) {
  while (runs_.size() > most_runs) {
    const std::uint64_t surplus = runs_.size() - most_runs + 1;
    const std::uint64_t block_bytes = mergeBlockBytes(merge_bytes_, surplus);
    const std::size_t count = static_cast<std::size_t>(
        std::min({mostInputs(merge_bytes_, block_bytes), surplus, options_.most_runs}));
    SURFEIT_ASSIGN_OR_RETURN(const Run merged,
                             mergeToRun(std::span(runs_).first(count), block_bytes));
    runs_.erase(runs_.begin(), runs_.begin() + static_cast<std::ptrdiff_t>(count));
    runs_.push_back(merged);
  }
  return {};
}

Result<ReceiverSorter::Run> ReceiverSorter::mergeToRun(std::span<const Run> runs,
                                                       std::uint64_t block_bytes) {
  Merge merge(*this, runs, block_bytes);
  SURFEIT_RETURN_IF_ERROR(merge.begin());
  std::vector<SortedReceiver> block(block_bytes / kUnitBytes * kUnitReceivers);
  Run merged{.offset = file_->size(), .receivers = 0};
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, merge.next(block));
    if (count == 0) break;
    SURFEIT_RETURN_IF_ERROR(appendUnits(std::span(block).first(count)));
    merged.receivers += count;
  }
  return merged;
}

Status ReceiverSorter::finish() {
  // Fewer may have come than were told
  const bool fits = reading_bytes_ == 0 || filled_ <= reading_bytes_ / sizeof(SortedReceiver);
  if (runs_.empty() && fits) {
    parallelSort(receivers().begin(), receivers().end(), std::less<>());
    return {};
  }
  SURFEIT_RETURN_IF_ERROR(spill());
  memory_ = {};
  const std::uint64_t most =
      std::min<std::uint64_t>(mostInputs(reading_bytes_, kUnitBytes), options_.most_runs);
  SURFEIT_RETURN_IF_ERROR(mergeDownTo(static_cast<std::size_t>(most)));
  merge_ = std::make_unique<Merge>(*this, runs_, mergeBlockBytes(reading_bytes_, runs_.size()));
  return merge_->begin();
}

Result<std::size_t> ReceiverSorter::next(std::span<SortedReceiver> out) {
  if (merge_ != nullptr) return merge_->next(out);
  const std::size_t count = std::min(out.size(), filled_ - place_);
  std::copy_n(receivers().begin() + static_cast<std::ptrdiff_t>(place_), count, out.begin());
  place_ += count;
  return count;
}

}  // namespace surfeit
