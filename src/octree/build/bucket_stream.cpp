#include "octree/build/bucket_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "core/assert.h"
#include "core/first_failure.h"
#include "core/parallel.h"
#include "core/thread_scratch.h"
#include "octree/build/surfel_block.h"

namespace surfeit {
namespace {

// Threads that read the blocks of a bucket: blocks of 100 to 400 KiB need several to keep the
// device busy.
constexpr std::size_t kReaders = 4;
// Words that splitters are chosen from, when a bucket is distributed again.
constexpr std::size_t kSampleWords = 65536;
constexpr std::size_t kMaxFinerBuckets = 1024;

}  // namespace

BucketStream::BucketStream(std::unique_ptr<SurfelStore> store, Options options,
                           const Progress& progress)
    : options_(std::move(options)), progress_(progress) {
  levels_.push_back({std::move(store), 0, 0});
  noteTemporaryBytes();
}

BucketStream::~BucketStream() = default;

void BucketStream::noteTemporaryBytes() {
  std::uint64_t bytes = 0;
  for (const Level& level : levels_) bytes += level.store->temporaryBytes();
  peak_temporary_bytes_ = std::max(peak_temporary_bytes_, bytes);
}

Result<std::shared_ptr<const SortedBatch>> BucketStream::next() {
  while (!levels_.empty()) {
    if (equal_store_ != nullptr) {
      SURFEIT_ASSIGN_OR_RETURN(const std::shared_ptr<const SortedBatch> batch, nextOfEqual());
      if (batch != nullptr) return batch;
      continue;
    }
    Level& level = levels_.back();
    if (level.next_bucket == level.store->bucketCount()) {
      levels_.pop_back();
      continue;
    }
    const SurfelStore& store = *level.store;
    const std::size_t bucket = level.next_bucket++;
    if (store.surfelCount(bucket) == 0) continue;
    if (store.surfelCount(bucket) <= options_.capacity) return load(store, bucket);
    SURFEIT_RETURN_IF_ERROR(distribute(store, bucket, level.word));
  }
  return std::shared_ptr<const SortedBatch>();
}

// The next block of a bucket of equal surfels, which need no order; nullptr after the last.
Result<std::shared_ptr<const SortedBatch>> BucketStream::nextOfEqual() {
  const std::span<const SurfelStore::Block> blocks = equal_store_->blocks(equal_bucket_);
  if (equal_block_ == blocks.size()) {
    equal_store_ = nullptr;
    return std::shared_ptr<const SortedBatch>();
  }
  const std::span<const SurfelStore::Block> block = blocks.subspan(equal_block_++, 1);
  AlignedBuffer buffer;
  SURFEIT_ASSIGN_OR_RETURN(const Bytes packed, equal_store_->fetch(block.front(), buffer));
  const std::shared_ptr<SortedBatch> batch = batches_.take();
  SURFEIT_RETURN_IF_ERROR(unpack(block, {&packed, 1}, *batch));
  return std::shared_ptr<const SortedBatch>(batch);
}

void BucketStream::startReading(const SurfelStore& store, std::size_t bucket) {
  const std::span<const SurfelStore::Block> blocks = store.blocks(bucket);
  reading_.store = &store;
  reading_.bucket = bucket;
  reading_.views.assign(blocks.size(), {});
  if (reading_.buffers.size() < blocks.size()) reading_.buffers.resize(blocks.size());

  // What lies in memory is there; the rest is dealt to the readers
  reading_.in_file.clear();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i].in_memory) {
      reading_.views[i] = store.inMemory(blocks[i]);
    } else {
      reading_.in_file.push_back(i);
    }
  }
  const std::size_t count = reading_.in_file.size();
  const std::size_t parts = std::min(kReaders, count);
  for (std::size_t part = 0; part < parts; ++part) {
    const std::span<const std::size_t> dealt =
        std::span(reading_.in_file).first(count * (part + 1) / parts).subspan(count * part / parts);
    const auto read = [this, &store, blocks, dealt]() -> Status {
      for (const std::size_t i : dealt) {
        SURFEIT_ASSIGN_OR_RETURN(reading_.views[i], store.fetch(blocks[i], reading_.buffers[i]));
        store.release(blocks[i]);
      }
      return {};
    };
    reading_.parts.push_back(std::async(std::launch::async, read));
  }
}

Status BucketStream::finishReading() {
  Status status;
  for (std::future<Status>& part : reading_.parts) {
    const Status part_status = part.get();
    if (status.ok()) status = part_status;
  }
  reading_.parts.clear();
  reading_.store = nullptr;
  return status;
}

// Starts on the bucket that follows, when it is one that can be loaded.
void BucketStream::readAhead() {
  const Level& level = levels_.back();
  for (std::size_t b = level.next_bucket; b < level.store->bucketCount(); ++b) {
    if (level.store->surfelCount(b) == 0) continue;
    if (level.store->surfelCount(b) <= options_.capacity) startReading(*level.store, b);
    return;
  }
}

Result<std::shared_ptr<const SortedBatch>> BucketStream::load(const SurfelStore& store,
                                                              std::size_t bucket) {
  if (reading_.store == nullptr) startReading(store, bucket);
  SURFEIT_CHECK(reading_.store == &store && reading_.bucket == bucket);
  SURFEIT_RETURN_IF_ERROR(finishReading());
  const std::shared_ptr<SortedBatch> batch = batches_.take();
  SURFEIT_RETURN_IF_ERROR(unpack(store.blocks(bucket), reading_.views, *batch));
  // The buffers are free: the device works while we sort and build
  readAhead();
  sort(*batch);
  return std::shared_ptr<const SortedBatch>(batch);
}

Status BucketStream::unpack(std::span<const SurfelStore::Block> blocks,
                            std::span<const Bytes> packed, SortedBatch& batch) {
  std::vector<std::size_t> begin(blocks.size() + 1, 0);
  for (std::size_t i = 0; i < blocks.size(); ++i) begin[i + 1] = begin[i] + blocks[i].surfels;
  batch.resize(begin.back());
  FirstFailure failure;
  parallelFor(blocks.size(), [&](std::size_t i) {
    const std::size_t size = begin[i + 1] - begin[i];
    const std::span<Surfel> surfels = batch.surfels.subspan(begin[i], size);
    failure.note(unpackSurfels(packed[i], surfels));
    std::vector<CurveKey>& keys = threadScratch<std::vector<CurveKey>>([] {});
    keys.resize(size);
    if (size > 0) curveKeys(&surfels.front().position, sizeof(Surfel), options_.cube, keys);
    for (std::size_t s = 0; s < size; ++s) batch.tickets[begin[i] + s] = {keys[s], begin[i] + s};
  });
  return namedError(failure.status());
}

// Damage to a block is damage of the temporary file.
Status BucketStream::namedError(const Status& status) const {
  if (status.code() != StatusCode::kCorruption) return status;
  return Status::ioError(
      fmt::format("{} (temporary file): {}", options_.temporary_directory, status.message()));
}

Status BucketStream::fetchSurfels(const SurfelStore& store, const SurfelStore::Block& block,
                                  AlignedBuffer& buffer, std::vector<Surfel>& surfels) const {
  if (progress_.isCancelled()) return Status::interrupted();
  SURFEIT_ASSIGN_OR_RETURN(const Bytes packed, store.fetch(block, buffer));
  surfels.resize(block.surfels);
  return namedError(unpackSurfels(packed, surfels));
}

void BucketStream::sort(SortedBatch& batch) {
  if (scratch_.size() < batch.tickets.size()) scratch_.resize(batch.tickets.size());
  sortAlongCurve(batch.tickets, std::span(scratch_).first(batch.tickets.size()), batch.surfels);
}

SortWord BucketStream::wordOf(const Surfel& surfel, int word) const {
  if (word == 0) return curveKey(surfel.position, options_.cube);
  return contentWord(surfel, word - 1);
}

// Splitters for a bucket that is too large, and the word in which its surfels differ: one more than
// the last word when they do not differ at all.
Result<std::vector<SortWord>> BucketStream::chooseSplitters(const SurfelStore& store,
                                                            std::size_t bucket, int& word) {
  const std::uint64_t count = store.surfelCount(bucket);
  const std::uint64_t step = std::max<std::uint64_t>(1, count / kSampleWords);
  AlignedBuffer buffer;
  std::vector<Surfel> surfels;
  for (; word <= kContentWords; ++word) {
    SortWord least = ~SortWord{0}, most = 0;
    std::vector<SortWord> sample;
    std::uint64_t record = 0;
    for (const SurfelStore::Block& block : store.blocks(bucket)) {
      SURFEIT_RETURN_IF_ERROR(fetchSurfels(store, block, buffer, surfels));
      for (const Surfel& surfel : surfels) {
        const SortWord at = wordOf(surfel, word);
        least = std::min(least, at);
        most = std::max(most, at);
        if (record++ % step == 0) sample.push_back(at);
      }
    }
    if (least == most) continue;
    // Every value that fills a bucket by itself gets one of its own, so that what is left shrinks
    std::sort(sample.begin(), sample.end());
    const std::size_t buckets = std::min<std::size_t>(
        kMaxFinerBuckets, static_cast<std::size_t>(2 * count / options_.capacity + 2));
    std::vector<SortWord> splitters = {least + 1};
    for (std::size_t b = 1; b < buckets; ++b) {
      const SortWord value = sample[sample.size() * b / buckets];
      splitters.push_back(value);
      if (value < most) splitters.push_back(value + 1);
    }
    std::sort(splitters.begin(), splitters.end());
    splitters.erase(std::unique(splitters.begin(), splitters.end()), splitters.end());
    return splitters;
  }
  return std::vector<SortWord>();
}

Status BucketStream::distribute(const SurfelStore& store, std::size_t bucket, int word) {
  SurfelStore::Plan plan;
  SURFEIT_ASSIGN_OR_RETURN(plan.splitters, chooseSplitters(store, bucket, word));
  if (word > kContentWords) {
    equal_store_ = &store;
    equal_bucket_ = bucket;
    equal_block_ = 0;
    return {};
  }
  // Open blocks of all buckets take no more than the bucket itself would have
  plan.block_surfels =
      std::clamp<std::size_t>(options_.capacity / (plan.splitters.size() + 1), 64, 2048);
  plan.temporary_directory = options_.temporary_directory;
  // What lies in memory stays there until its level ends
  if (levels_.size() == 1) plan.memory_bytes = options_.spare_memory;
  plan.gives_back = store.givesBack();
  auto finer = std::make_unique<SurfelStore>(std::move(plan));
  const std::span<const SurfelStore::Block> blocks = store.blocks(bucket);
  FirstFailure failure;
  parallelFor(blocks.size(), [&](std::size_t i) {
    AlignedBuffer& buffer = threadScratch<AlignedBuffer>([] {});
    std::vector<Surfel>& surfels = threadScratch<std::vector<Surfel>>([] {});
    std::vector<SortWord>& words = threadScratch<std::vector<SortWord>>([] {});
    if (failure.happened()) return;
    const Status status = fetchSurfels(store, blocks[i], buffer, surfels);
    failure.note(status);
    if (!status.ok()) return;
    words.resize(surfels.size());
    for (std::size_t s = 0; s < surfels.size(); ++s) words[s] = wordOf(surfels[s], word);
    failure.note(finer->add(surfels, words));
  });
  SURFEIT_RETURN_IF_ERROR(failure.status());
  SURFEIT_RETURN_IF_ERROR(finer->finish());
  for (const SurfelStore::Block& block : blocks) store.release(block);
  levels_.push_back({std::move(finer), word, 0});
  noteTemporaryBytes();
  return {};
}

}  // namespace surfeit
