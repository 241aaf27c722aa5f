// Runs are made of units of some 28 KiB, the last of a run of fewer records:
//
//   [ checksum : 8 | records | zeros up to the next page ]
#include "storage/external_sorter.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "storage/block_writer.h"
#include "storage/held_bytes.h"

namespace surfeit {
namespace {

// Units end and begin with pages, as direct I/O wants them.
constexpr std::size_t kUnitHeaderBytes = 8;
constexpr std::size_t kUsualUnitBytes = 7 * kDirectAlignment;
// Blocks, what a merge reads at once, are some units. Larger ones are not read faster.
constexpr std::uint64_t kMostBlockBytes = 1 << 20;
// Space is given back in pieces of about this size: each takes a call.
constexpr std::uint64_t kReleaseBytes = 1 << 20;

constexpr std::size_t kFileBlocks = 2;
// The file's blocks, the list of runs, and as much again for what is small.
constexpr std::uint64_t kRunListBytes = ExternalSorter::kMostRuns * 16;
constexpr std::uint64_t kSpillBytes = kFileBlocks * BlockWriter::kBlockBytes + 2 * kRunListBytes;
constexpr std::uint64_t kLeastRunBytes = 1 << 20;
// What a merge holds of a run beside its block: state, and what aligning the block costs.
constexpr std::uint64_t kStateBytes = 256;
constexpr std::uint64_t kInputBytes = kStateBytes + kDirectAlignment;

// The offset is part of it, so that a unit read from elsewhere does not pass.
std::uint64_t checksumOf(Bytes records, std::uint64_t unit_offset) {
  return XXH3_64bits_withSeed(records.data(), records.size(), unit_offset);
}

// How many runs can be merged in `bytes`, with one block more for what comes out.
std::uint64_t mostInputs(std::uint64_t bytes, std::uint64_t block_bytes) {
  return std::max<std::uint64_t>(
      (bytes - std::min(bytes, block_bytes)) / (block_bytes + kInputBytes), 2);
}

// The largest sensible blocks with which so many runs, or the most that can be, are merged.
std::uint64_t mergeBlockBytes(std::uint64_t bytes, std::uint64_t runs, std::uint64_t unit_bytes) {
  const std::uint64_t share = bytes / (runs + 1);
  const std::uint64_t block = std::min(share - std::min(share, kInputBytes), kMostBlockBytes);
  return std::max<std::uint64_t>(block / unit_bytes, 1) * unit_bytes;
}

}  // namespace

ExternalSorter::Unit::Unit(std::size_t record_size)
    : record_bytes(record_size),
      records(std::max<std::size_t>((kUsualUnitBytes - kUnitHeaderBytes) / record_bytes, 1)),
      bytes(alignedUp(kUnitHeaderBytes + records * record_bytes)) {}

std::uint64_t ExternalSorter::Unit::runBytes(std::uint64_t run_records) const {
  const std::uint64_t rest = run_records % records;
  return run_records / records * bytes +
         (rest > 0 ? alignedUp(kUnitHeaderBytes + rest * record_bytes) : 0);
}

// Merges runs of a file by a tree of losers (Knuth, The Art of Computer Programming 3, 5.4.1): one
// comparison per level, with the same nodes for every record of a run.
class ExternalSorter::Merge {
 public:
  Merge(ExternalSorter& sorter, std::span<const Run> runs, std::uint64_t block_bytes)
      : file_(*sorter.file_),
        directory_(sorter.options_.temporary_directory),
        unit_(sorter.unit_),
        block_bytes_(block_bytes),
        inputs_(runs.size()),
        losers_(runs.size()) {
    for (std::size_t i = 0; i < runs.size(); ++i) inputs_[i].all = inputs_[i].held = runs[i];
  }

  // Reads the first blocks: from a mark on, or from the front.
  Status begin(std::span<const std::uint64_t> mark = {}) {
    // From the leaves up, the less of two goes on and the other stays
    std::vector<Head> winners(2 * inputs_.size());
    for (std::uint32_t i = 0; i < inputs_.size(); ++i) {
      SURFEIT_RETURN_IF_ERROR(goTo(inputs_[i], mark.empty() ? 0 : mark[i]));
      winners[inputs_.size() + i] = headOf(i);
    }
    for (std::size_t node = inputs_.size() - 1; node > 0; --node) {
      Head winner = winners[2 * node], loser = winners[2 * node + 1];
      if (isLess(loser, winner)) std::swap(winner, loser);
      winners[node] = winner;
      losers_[node] = loser;
    }
    winner_ = winners[1];
    return {};
  }

  const std::byte* current() const {
    return winner_.input != kNoInput ? inputs_[winner_.input].next : nullptr;
  }

  // Goes on by `most` records unless the end comes, and copies them to `out` unless it is null.
  // Returns how many.
  Result<std::size_t> pass(std::size_t most, std::byte* out) {
    const std::size_t bytes = unit_.record_bytes;
    std::size_t count = 0;
    for (; count < most && winner_.input != kNoInput; ++count) {
      Input& input = inputs_[winner_.input];
      if (out != nullptr) copyRecord(input.next, out + count * bytes, bytes);
      input.next += bytes;
      if (input.next == input.end) SURFEIT_RETURN_IF_ERROR(nextUnit(input));
      Head head = headOf(winner_.input);
      for (std::size_t node = (inputs_.size() + winner_.input) / 2; node > 0; node /= 2) {
        if (isLess(losers_[node], head)) std::swap(losers_[node], head);
      }
      winner_ = head;
    }
    return count;
  }

  // How many records of every run are behind.
  Mark mark() {
    keeps_space_ = true;
    Mark mark;
    for (const Input& input : inputs_) {
      const auto ahead = static_cast<std::uint64_t>(input.end - input.next);
      mark.push_back(input.all.records - input.run.records - ahead / unit_.record_bytes);
    }
    return mark;
  }

 private:
  struct Input {
    Run all;
    Run run;   // from the next unit on
    Run held;  // what has not been given back
    AlignedBuffer block;
    Bytes units;                      // in the block, that have not been begun
    const std::byte* next = nullptr;  // in a unit
    const std::byte* end = nullptr;
  };
  static constexpr std::uint32_t kNoInput = std::numeric_limits<std::uint32_t>::max();
  // The keys of an input's next record, copied so that comparing need not look into blocks. Without
  // an input it comes after all others.
  struct Head {
    std::uint64_t first = ~std::uint64_t{0}, second = ~std::uint64_t{0};
    std::uint32_t input = kNoInput;
  };
  static_assert(sizeof(Input) + 3 * sizeof(Head) + sizeof(Run) <= kStateBytes);

  bool isLess(const Head& a, const Head& b) const {
    if (a.first != b.first) return a.first < b.first;
    if (a.second != b.second) return a.second < b.second;
    if (a.input == kNoInput || b.input == kNoInput) return a.input < b.input;
    return recordLess(inputs_[a.input].next, inputs_[b.input].next, unit_.record_bytes);
  }

  Head headOf(std::uint32_t input) const {
    Head head;
    if (inputs_[input].next == inputs_[input].end) return head;
    std::memcpy(&head.first, inputs_[input].next, sizeof head.first);
    std::memcpy(&head.second, inputs_[input].next + sizeof head.first, sizeof head.second);
    head.input = input;
    return head;
  }

  // To the record behind which so many of the run are.
  Status goTo(Input& input, std::uint64_t behind) {
    const std::uint64_t units = behind / unit_.records;
    input.run = {input.all.offset + units * unit_.bytes, input.all.records - units * unit_.records};
    input.units = {};
    SURFEIT_RETURN_IF_ERROR(nextUnit(input));
    if (input.next != nullptr) input.next += behind % unit_.records * unit_.record_bytes;
    return {};
  }

  // Goes on with the next unit of a run; none is left of a run that has ended.
  Status nextUnit(Input& input) {
    input.next = input.end = nullptr;
    if (input.units.empty()) SURFEIT_RETURN_IF_ERROR(readBlock(input));
    const std::uint64_t count = std::min<std::uint64_t>(unit_.records, input.run.records);
    if (count == 0) return {};
    const Bytes unit = input.units.first(unit_.runBytes(count));
    const Bytes records = unit.subspan(kUnitHeaderBytes, count * unit_.record_bytes);
    std::uint64_t checksum = 0;
    std::memcpy(&checksum, unit.data(), sizeof checksum);
    if (const std::uint64_t found = checksumOf(records, input.run.offset); found != checksum) {
      return Status::ioError(
          fmt::format("{} (temporary file): {} records at {}: checksum {:016x}, expected {:016x}",
                      directory_, count, input.run.offset, found, checksum));
    }
    input.next = records.data();
    input.end = input.next + records.size();
    input.units = input.units.subspan(unit.size());
    input.run.offset += unit.size();
    input.run.records -= count;
    return {};
  }

  // Reads the next block of a run over the one before, which is given back.
  Status readBlock(Input& input) {
    const std::uint64_t behind = input.run.offset - input.held.offset;
    if (!keeps_space_ && behind > 0 && (behind >= kReleaseBytes || input.run.records == 0)) {
      file_.release(input.held.offset, behind);
      input.held = input.run;
    }
    const std::uint64_t bytes = std::min(block_bytes_, unit_.runBytes(input.run.records));
    if (bytes == 0) {
      input.block = {};
      return {};
    }
    SURFEIT_ASSIGN_OR_RETURN(input.units, file_.readView(input.run.offset, bytes, input.block));
    return {};
  }

  TemporaryFile& file_;
  const std::string& directory_;
  const Unit unit_;
  const std::uint64_t block_bytes_;
  bool keeps_space_ = false;
  std::vector<Input> inputs_;
  // losers_[1] is the root; the parent of node n is n / 2, and that of input i is (inputs + i) / 2.
  std::vector<Head> losers_;
  Head winner_;
};

std::uint64_t ExternalSorter::leastMemoryBytes(std::uint64_t count, std::size_t record_bytes) {
  constexpr std::uint64_t kLeast = kSpillBytes + kLeastRunBytes;
  return count < kLeast / record_bytes ? count * record_bytes : kLeast;
}

ExternalSorter::ExternalSorter(Options options)
    : options_(std::move(options)), unit_(options_.record_bytes) {
  static_assert(kMostRuns * sizeof(Run) <= kRunListBytes);
  SURFEIT_CHECK(unit_.record_bytes >= kRecordKeyBytes && unit_.record_bytes % 4 == 0);
  SURFEIT_CHECK(options_.most_runs >= 2 && options_.most_runs <= kMostRuns);
  const bool is_told = options_.reading_bytes > 0;
  const std::uint64_t least = leastMemoryBytes(options_.count, unit_.record_bytes);
  const std::uint64_t memory = options_.memory_bytes;
  const std::uint64_t reading = is_told ? options_.reading_bytes : std::max(memory / 4, least);
  SURFEIT_CHECK(std::min(memory, reading) >= least);
  most_kept_ = (is_told ? reading : memory) / unit_.record_bytes;
  std::uint64_t most = std::min(memory / unit_.record_bytes, most_kept_);
  if (options_.count > most) {
    merge_bytes_ = memory - kSpillBytes;
    reading_bytes_ = reading - kSpillBytes;
    most_kept_ = (is_told ? reading_bytes_ : merge_bytes_) / unit_.record_bytes;
    const std::uint64_t units = merge_bytes_ / unit_.record_bytes / unit_.records;
    most = std::max<std::uint64_t>(units, 1) * unit_.records;
    runs_.reserve(options_.most_runs);
  }
  capacity_ = static_cast<std::size_t>(std::min(options_.count, most));
  memory_.reserve(capacity_ * unit_.record_bytes);
}

ExternalSorter::~ExternalSorter() = default;

// What has failed is not tried again: what it worked on may be half done.
template <typename Work>
Status ExternalSorter::attempt(const Work& work) {
  if (!failure_.ok()) return failure_;
  try {
    Status status = work();
    if (!status.ok()) fail(status);
    return status;
  } catch (...) {
    fail(Status::failed("out of memory"));
    throw;
  }
}

void ExternalSorter::fail(Status status) {
  failure_ = std::move(status);
  current_ = nullptr;
  filled_ = capacity_;  // so that add() asks for room
}

Status ExternalSorter::add(const std::byte* record) {
  SURFEIT_CHECK(count_ < options_.count);
  if (filled_ == capacity_) SURFEIT_RETURN_IF_ERROR(attempt([this] { return makeRoom(); }));
  copyRecord(record, memory_.data() + filled_ * unit_.record_bytes, unit_.record_bytes);
  ++filled_;
  ++count_;
  return {};
}

Status ExternalSorter::makeRoom() {
  SURFEIT_RETURN_IF_ERROR(spill());
  if (runs_.size() == options_.most_runs) {
    memory_ = {};
    SURFEIT_RETURN_IF_ERROR(mergeDownTo(options_.most_runs / 2));
    memory_.reserve(capacity_ * unit_.record_bytes);
  }
  filled_ = 0;
  return {};
}

// Writes what is in memory as a run.
Status ExternalSorter::spill() {
  if (file_ == nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file,
                             TemporaryFile::create(options_.temporary_directory, kFileBlocks));
    file_ = std::make_unique<TemporaryFile>(std::move(file));
  }
  sortRecords(memory_.data(), filled_, unit_.record_bytes);
  runs_.push_back({.offset = file_->size(), .records = filled_});
  return appendUnits({memory_.data(), filled_ * unit_.record_bytes});
}

Status ExternalSorter::appendUnits(Bytes sorted) {
  static constexpr std::array<std::byte, kDirectAlignment> kZeros{};
  while (!sorted.empty()) {
    const Bytes records = sorted.first(std::min(sorted.size(), unit_.records * unit_.record_bytes));
    const std::array<std::uint64_t, 1> checksum = {checksumOf(records, file_->size())};
    const std::size_t bytes = kUnitHeaderBytes + records.size();
    const Bytes padding = Bytes(kZeros).first(alignedUp(bytes) - bytes);
    for (const Bytes part : {Bytes(std::as_bytes(std::span(checksum))), records, padding}) {
      SURFEIT_RETURN_IF_ERROR(file_->append(part).status());
    }
    sorted = sorted.subspan(records.size());
  }
  return {};
}

// Merges runs until no more than so many are left, from the oldest on and to the end of the list,
// so that all are merged about as often.
Status ExternalSorter::mergeDownTo(std::size_t most_runs) {
  while (runs_.size() > most_runs) {
    const std::uint64_t surplus = runs_.size() - most_runs + 1;
    const std::uint64_t block_bytes = mergeBlockBytes(merge_bytes_, surplus, unit_.bytes);
    const std::size_t inputs = static_cast<std::size_t>(
        std::min({mostInputs(merge_bytes_, block_bytes), surplus, options_.most_runs}));
    Merge merge(*this, std::span(runs_).first(inputs), block_bytes);
    SURFEIT_RETURN_IF_ERROR(merge.begin());
    std::vector<std::byte> block(block_bytes / unit_.bytes * unit_.records * unit_.record_bytes);
    Run merged{.offset = file_->size(), .records = 0};
    for (std::size_t count = 1; count > 0; merged.records += count) {
      SURFEIT_ASSIGN_OR_RETURN(count, merge.pass(block.size() / unit_.record_bytes, block.data()));
      SURFEIT_RETURN_IF_ERROR(appendUnits(Bytes(block).first(count * unit_.record_bytes)));
    }
    runs_.erase(runs_.begin(), runs_.begin() + static_cast<std::ptrdiff_t>(inputs));
    runs_.push_back(merged);
  }
  return {};
}

Status ExternalSorter::finish() {
  return attempt([this]() -> Status {
    // Fewer may have come than were told
    if (runs_.empty() && filled_ <= most_kept_) {
      sortRecords(memory_.data(), filled_, unit_.record_bytes);
      noteHeldBytes(filled_ * unit_.record_bytes, most_kept_ * unit_.record_bytes);
    } else {
      SURFEIT_RETURN_IF_ERROR(spill());
      memory_ = {};
      const std::uint64_t most =
          std::min<std::uint64_t>(mostInputs(reading_bytes_, unit_.bytes), options_.most_runs);
      SURFEIT_RETURN_IF_ERROR(mergeDownTo(static_cast<std::size_t>(most)));
      merge_ = std::make_unique<Merge>(*this, runs_,
                                       mergeBlockBytes(reading_bytes_, runs_.size(), unit_.bytes));
      SURFEIT_RETURN_IF_ERROR(merge_->begin());
    }
    standAt(0);
    return {};
  });
}

// A merge knows its place.
void ExternalSorter::standAt(std::size_t place) {
  place_ = place;
  if (merge_ != nullptr) {
    current_ = merge_->current();
  } else {
    current_ = place < filled_ ? memory_.data() + place * unit_.record_bytes : nullptr;
  }
}

Status ExternalSorter::advance() {
  return attempt([this]() -> Status {
    SURFEIT_ASSERT(current_ != nullptr);
    if (merge_ != nullptr) SURFEIT_RETURN_IF_ERROR(merge_->pass(1, nullptr).status());
    standAt(place_ + 1);
    return {};
  });
}

Result<std::size_t> ExternalSorter::read(std::span<std::byte> out) {
  std::size_t count = out.size() / unit_.record_bytes;
  SURFEIT_RETURN_IF_ERROR(attempt([&]() -> Status {
    if (merge_ != nullptr) {
      SURFEIT_ASSIGN_OR_RETURN(count, merge_->pass(count, out.data()));
    } else {
      count = std::min(count, filled_ - place_);
      if (count > 0) std::memcpy(out.data(), current_, count * unit_.record_bytes);
    }
    standAt(place_ + count);
    return {};
  }));
  return count;
}

ExternalSorter::Mark ExternalSorter::mark() {
  return merge_ != nullptr ? merge_->mark() : Mark{place_};
}

Status ExternalSorter::reset(const Mark& mark) {
  return attempt([&]() -> Status {
    if (merge_ != nullptr) SURFEIT_RETURN_IF_ERROR(merge_->begin(mark));
    standAt(static_cast<std::size_t>(mark.front()));
    return {};
  });
}

}  // namespace surfeit
