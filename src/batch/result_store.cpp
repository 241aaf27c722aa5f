// A block, of whole pages:
//
//   [ checksum : 8 | offset of the block before : 8 | records | zeros ]
//   record = [ index in the bucket : 4 | packed result : 4 per float ]
#include "batch/result_store.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "core/assert.h"
#include "gather/rules/gather_outputs.h"
#include "storage/block_writer.h"

namespace surfeit {
namespace {

constexpr std::size_t kFileBlocks = 2;
// The file's blocks and what is small.
constexpr std::uint64_t kFileBytes =
    kFileBlocks * BlockWriter::kBlockBytes + (std::uint64_t{128} << 10);
// Plans are made in steps, so that more memory is never worse.
constexpr std::uint64_t kStepBytes = 1 << 16;
// Shorter blocks are slow to read, longer ones no faster.
constexpr std::uint64_t kLeastBlockBytes = 1 << 14;
constexpr std::uint64_t kMostBlockBytes = 1 << 20;

// What the receivers without a result have.
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

struct BlockHeader {
  std::uint64_t checksum = 0;
  std::uint64_t previous = 0;
};

// The offset is part of it, so that a block read from elsewhere does not pass.
std::uint64_t checksumOf(Bytes block, std::uint64_t offset) {
  return XXH3_64bits_withSeed(block.data() + sizeof BlockHeader::checksum,
                              block.size() - sizeof BlockHeader::checksum, offset);
}

}  // namespace

struct ResultStore::Plan {
  std::uint64_t bucket_indices = 0;
  std::uint64_t buckets = 0;
  std::uint64_t block_bytes = 0;  // below kLeastBlockBytes: cannot be
};

// Buckets as large as can be read at once, since each has an open block until then.
ResultStore::Plan ResultStore::planFor(std::uint64_t memory_bytes, std::uint64_t reading_bytes,
                                       std::uint64_t count, std::size_t result_floats) {
  const auto wholeSteps = [](std::uint64_t bytes) {
    return (bytes - std::min(bytes, kFileBytes)) / kStepBytes * kStepBytes;
  };
  const std::uint64_t writing = wholeSteps(memory_bytes), reading = wholeSteps(reading_bytes);
  if (std::min(writing, reading) == 0) return {};
  const std::uint64_t list_bytes = reading / 512;
  const std::uint64_t most_block = std::clamp(reading / 16 / kDirectAlignment * kDirectAlignment,
                                              kLeastBlockBytes, kMostBlockBytes);
  const std::uint64_t most_indices =
      std::min<std::uint64_t>((reading - list_bytes - most_block) / (result_floats * sizeof(float)),
                              std::numeric_limits<std::uint32_t>::max());
  Plan plan;
  plan.buckets = (count - 1) / most_indices + 1;
  if (plan.buckets > list_bytes / sizeof(Bucket)) return {};
  plan.bucket_indices = (count - 1) / plan.buckets + 1;
  const std::uint64_t share = writing / plan.buckets - sizeof(Bucket);
  plan.block_bytes = std::min(most_block, share / kDirectAlignment * kDirectAlignment);
  return plan;
}

std::uint64_t ResultStore::leastMemoryBytes(std::uint64_t count, std::size_t result_floats) {
  if (count == 0) return 0;
  const auto suffices = [=](std::uint64_t bytes) {
    return planFor(bytes, bytes, count, result_floats).block_bytes >= kLeastBlockBytes;
  };
  std::uint64_t enough = kFileBytes + kStepBytes;
  while (!suffices(enough)) enough = kFileBytes + 2 * (enough - kFileBytes);
  std::uint64_t too_few = kFileBytes;
  while (enough - too_few > kStepBytes) {
    const std::uint64_t steps = (enough - too_few) / kStepBytes;
    const std::uint64_t middle = too_few + steps / 2 * kStepBytes;
    (suffices(middle) ? enough : too_few) = middle;
  }
  const std::uint64_t result_bytes = result_floats * sizeof(float);
  return count <= enough / result_bytes ? count * result_bytes : enough;
}

ResultStore::ResultStore(Options options)
    : options_(std::move(options)), floats_(resultFloats(options_.outputs)) {
  const std::uint64_t reading =
      options_.reading_bytes > 0 ? options_.reading_bytes : options_.memory_bytes;
  const std::uint64_t least = std::min(options_.memory_bytes, reading);
  SURFEIT_CHECK(floats_ > 0 && least >= leastMemoryBytes(options_.count, floats_));
  if (options_.count <= least / (floats_ * sizeof(float))) {
    bucket_indices_ = options_.count;
    results_.assign(static_cast<std::size_t>(options_.count) * floats_, kNan);
    return;
  }
  const Plan plan = planFor(options_.memory_bytes, reading, options_.count, floats_);
  SURFEIT_CHECK(plan.block_bytes >= kLeastBlockBytes);
  bucket_indices_ = plan.bucket_indices;
  block_bytes_ = plan.block_bytes;
  buckets_.resize(static_cast<std::size_t>(plan.buckets));
  blocks_.reserve(static_cast<std::size_t>(plan.buckets * plan.block_bytes));
}

ResultStore::~ResultStore() = default;

std::size_t ResultStore::blockRecords() const {
  return (block_bytes_ - sizeof(BlockHeader)) / recordBytes();
}

std::byte* ResultStore::openBlock(std::size_t bucket) const {
  return blocks_.data() + bucket * block_bytes_;
}

Status ResultStore::put(std::span<const Entry> entries) {
  if (block_bytes_ == 0) {
    // Others write other places
    for (const Entry& entry : entries) {
      SURFEIT_CHECK(entry.index < options_.count);
      packResult(entry.result, options_.outputs, &results_[entry.index * floats_]);
    }
    return {};
  }
  // One lock for all buckets: what is done under it takes nanoseconds, a gather microseconds
  const std::lock_guard lock(mutex_);
  if (failure_.ok()) failure_ = putAll(entries);
  return failure_;
}

// Into open blocks, which are written when they are full.
Status ResultStore::putAll(std::span<const Entry> entries) {
  const std::size_t block_records = blockRecords();
  for (const Entry& entry : entries) {
    SURFEIT_CHECK(entry.index < options_.count);
    const std::size_t b = static_cast<std::size_t>(entry.index / bucket_indices_);
    const auto in_bucket = static_cast<std::uint32_t>(entry.index - b * bucket_indices_);
    std::array<float, kResultFloats> row;
    packResult(entry.result, options_.outputs, row.data());
    const std::size_t place = buckets_[b].entries++ % block_records;
    std::byte* const record = openBlock(b) + sizeof(BlockHeader) + place * recordBytes();
    std::memcpy(record, &in_bucket, sizeof in_bucket);
    std::memcpy(record + sizeof in_bucket, row.data(), floats_ * sizeof(float));
    if (place + 1 == block_records) SURFEIT_RETURN_IF_ERROR(writeBlock(b, block_records));
  }
  return {};
}

// Writes the open block of a bucket.
Status ResultStore::writeBlock(std::size_t bucket, std::size_t records) {
  if (file_ == nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file,
                             TemporaryFile::create(options_.temporary_directory, kFileBlocks));
    file_ = std::make_unique<TemporaryFile>(std::move(file));
  }
  std::byte* const block = openBlock(bucket);
  const std::size_t used = sizeof(BlockHeader) + records * recordBytes();
  const std::size_t bytes = alignedUp(used);
  std::memset(block + used, 0, bytes - used);
  const std::uint64_t offset = file_->size();
  BlockHeader header{.previous = buckets_[bucket].last_block};
  std::memcpy(block, &header, sizeof header);
  header.checksum = checksumOf({block, bytes}, offset);
  std::memcpy(block, &header, sizeof header);
  SURFEIT_RETURN_IF_ERROR(file_->append({block, bytes}).status());
  buckets_[bucket].last_block = offset;
  return {};
}

Status ResultStore::finish() {
  if (block_bytes_ == 0) return {};
  for (std::size_t b = 0; b < buckets_.size() && failure_.ok(); ++b) {
    const std::size_t open = buckets_[b].entries % blockRecords();
    if (open > 0) failure_ = writeBlock(b, open);
  }
  SURFEIT_RETURN_IF_ERROR(failure_);
  blocks_ = {};
  results_.reserve(static_cast<std::size_t>(bucket_indices_) * floats_);
  if (file_ != nullptr) failure_ = file_->flush();
  return failure_;
}

Status ResultStore::take(std::span<GatherResult> results) {
  SURFEIT_CHECK(results.size() <= options_.count - taken_);
  SURFEIT_RETURN_IF_ERROR(failure_);
  while (!results.empty()) {
    const std::uint64_t begin = taken_ % bucket_indices_;
    if (begin == 0 && block_bytes_ > 0) {
      failure_ = loadBucket(static_cast<std::size_t>(taken_ / bucket_indices_));
      SURFEIT_RETURN_IF_ERROR(failure_);
    }
    const std::size_t count = std::min(results.size(), results_.size() / floats_ - begin);
    for (std::size_t i = 0; i < count; ++i) {
      results[i] = unpackResult(&results_[(begin + i) * floats_], options_.outputs);
    }
    results = results.subspan(count);
    taken_ += count;
  }
  return {};
}

// Reads the blocks of a bucket, from the last, which need not be full, to the first.
Status ResultStore::loadBucket(std::size_t bucket) {
  const std::uint64_t rest = options_.count - bucket * bucket_indices_;
  results_.assign(static_cast<std::size_t>(std::min(bucket_indices_, rest)) * floats_, kNan);
  const std::size_t block_records = blockRecords();
  std::uint64_t offset = buckets_[bucket].last_block;
  for (std::uint64_t left = buckets_[bucket].entries; left > 0;) {
    const std::size_t records = static_cast<std::size_t>((left - 1) % block_records + 1);
    const std::size_t bytes = alignedUp(sizeof(BlockHeader) + records * recordBytes());
    SURFEIT_ASSIGN_OR_RETURN(const Bytes block, file_->readView(offset, bytes, blocks_));
    BlockHeader header;
    std::memcpy(&header, block.data(), sizeof header);
    if (const std::uint64_t found = checksumOf(block, offset); found != header.checksum) {
      return Status::ioError(
          fmt::format("{} (temporary file): {} results at {}: checksum {:016x}, expected {:016x}",
                      options_.temporary_directory, records, offset, found, header.checksum));
    }
    for (std::size_t i = 0; i < records; ++i) {
      const std::byte* const record = block.data() + sizeof header + i * recordBytes();
      std::uint32_t place;
      std::memcpy(&place, record, sizeof place);
      std::memcpy(&results_[place * floats_], record + sizeof place, floats_ * sizeof(float));
    }
    file_->release(offset, bytes);
    left -= records;
    offset = header.previous;
  }
  return {};
}

std::uint64_t ResultStore::temporaryBytes() const {
  const std::lock_guard lock(mutex_);
  return file_ != nullptr ? file_->size() : 0;
}

}  // namespace surfeit
