#include "octree/build/surfel_store.h"

#include <algorithm>

#include "core/assert.h"
#include "core/thread_scratch.h"
#include "octree/build/surfel_block.h"

namespace surfeit {
namespace {

constexpr int kTableBits = 14;
constexpr std::size_t kChunkBytes = 4 << 20;

}  // namespace

struct SurfelStore::Bucket {
  std::mutex mutex;        // guards all below; held for copying and bookkeeping only
  std::span<Surfel> open;  // room for a block
  std::size_t open_count = 0;
  std::vector<Block> blocks;
  std::uint64_t surfels = 0;
};

SurfelStore::SurfelStore(Plan plan)
    : plan_(std::move(plan)),
      bucket_count_(plan_.splitters.size() + 1),
      first_bucket_((std::size_t{1} << kTableBits) + 1),
      buckets_(new Bucket[bucket_count_]) {
  SURFEIT_CHECK(std::is_sorted(plan_.splitters.begin(), plan_.splitters.end()));
  // In one piece, which goes back to the system when all is packed
  open_.reserve(bucket_count_ * plan_.block_surfels * sizeof(Surfel));
  for (std::size_t b = 0; b < bucket_count_; ++b) {
    buckets_[b].open = {reinterpret_cast<Surfel*>(open_.data()) + b * plan_.block_surfels,
                        plan_.block_surfels};
  }
  for (std::size_t i = 0; i + 1 < first_bucket_.size(); ++i) {
    const SortWord word = SortWord{i} << (64 - kTableBits);
    first_bucket_[i] = static_cast<std::uint32_t>(
        std::upper_bound(plan_.splitters.begin(), plan_.splitters.end(), word) -
        plan_.splitters.begin());
  }
  first_bucket_.back() = static_cast<std::uint32_t>(plan_.splitters.size());
}

SurfelStore::~SurfelStore() = default;

std::size_t SurfelStore::bucketOf(SortWord word) const {
  const std::size_t top = word >> (64 - kTableBits);
  const auto begin = plan_.splitters.begin() + first_bucket_[top];
  const auto end = plan_.splitters.begin() + first_bucket_[top + 1];
  return static_cast<std::size_t>(std::upper_bound(begin, end, word) - plan_.splitters.begin());
}

Status SurfelStore::add(std::span<const Surfel> surfels, std::span<const SortWord> words) {
  SURFEIT_ASSERT(surfels.size() == words.size());
  if (bucket_count_ == 1) return append(buckets_[0], surfels);

  // Group by bucket, so that a bucket is locked once for all its surfels
  std::vector<std::uint32_t>& bucket_of = threadScratch<std::vector<std::uint32_t>>([] {});
  std::vector<std::uint32_t>& next = threadScratch<std::vector<std::uint32_t>>([] {});
  std::vector<Surfel>& grouped = threadScratch<std::vector<Surfel>>([] {});
  bucket_of.resize(surfels.size());
  grouped.resize(surfels.size());
  next.assign(bucket_count_ + 1, 0);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    bucket_of[i] = static_cast<std::uint32_t>(bucketOf(words[i]));
    ++next[bucket_of[i] + 1];
  }
  for (std::size_t b = 0; b < bucket_count_; ++b) next[b + 1] += next[b];
  for (std::size_t i = 0; i < surfels.size(); ++i) grouped[next[bucket_of[i]]++] = surfels[i];
  // next[b] is now where bucket b ends
  std::size_t begin = 0;
  for (std::size_t b = 0; b < bucket_count_; ++b) {
    const std::size_t end = next[b];
    if (end == begin) continue;
    SURFEIT_RETURN_IF_ERROR(append(buckets_[b], std::span(grouped).subspan(begin, end - begin)));
    begin = end;
  }
  return {};
}

Status SurfelStore::append(Bucket& bucket, std::span<const Surfel> surfels) {
  // Full blocks leave the bucket before they are packed, so that others can go on filling it
  std::vector<Surfel>& full = threadScratch<std::vector<Surfel>>([] {});
  while (!surfels.empty()) {
    full.clear();
    {
      const std::lock_guard lock(bucket.mutex);
      const std::size_t count = std::min(bucket.open.size() - bucket.open_count, surfels.size());
      std::copy_n(surfels.begin(), count,
                  bucket.open.begin() + static_cast<std::ptrdiff_t>(bucket.open_count));
      surfels = surfels.subspan(count);
      bucket.open_count += count;
      bucket.surfels += count;
      if (bucket.open_count == bucket.open.size()) {
        full.assign(bucket.open.begin(), bucket.open.end());
        bucket.open_count = 0;
      }
    }
    if (!full.empty()) SURFEIT_RETURN_IF_ERROR(store(bucket, full));
  }
  return {};
}

Status SurfelStore::store(Bucket& bucket, std::span<const Surfel> surfels) {
  std::vector<std::byte>& packed = threadScratch<std::vector<std::byte>>([] {});
  packSurfels(surfels, packed);
  Block block;
  block.bytes = static_cast<std::uint32_t>(packed.size());
  block.surfels = static_cast<std::uint32_t>(surfels.size());
  if (std::byte* memory = allocate(packed.size()); memory != nullptr) {
    std::copy(packed.begin(), packed.end(), memory);
    block.place = reinterpret_cast<std::uintptr_t>(memory);
    block.in_memory = 1;
  } else {
    {
      const std::lock_guard lock(file_mutex_);
      if (file_ == nullptr) {
        SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file,
                                 TemporaryFile::create(plan_.temporary_directory));
        file_ = std::make_unique<TemporaryFile>(std::move(file));
      }
    }
    // Whole pages, so that nothing is left of a block that is given back: the remains of a million
    // blocks took the file system minutes to remove
    if (plan_.gives_back) packed.resize(alignedUp(packed.size()));
    SURFEIT_ASSIGN_OR_RETURN(block.place, file_->append(packed));
    temporary_bytes_ += packed.size();
  }
  const std::lock_guard lock(bucket.mutex);
  bucket.blocks.push_back(block);
  return {};
}

// Room in memory, or nullptr when the allowance is used up: from then on all goes to the file.
std::byte* SurfelStore::allocate(std::size_t bytes) {
  const std::lock_guard lock(memory_mutex_);
  if (memory_full_) return nullptr;
  if (chunks_.empty() || chunk_used_ + bytes > chunks_.back().capacity()) {
    const std::size_t chunk_bytes = std::max(kChunkBytes, bytes);
    if (memory_used_ + chunk_bytes > plan_.memory_bytes) {
      memory_full_ = true;
      return nullptr;
    }
    chunks_.emplace_back(chunk_bytes);
    memory_used_ += chunk_bytes;
    chunk_used_ = 0;
  }
  std::byte* memory = chunks_.back().data() + chunk_used_;
  chunk_used_ += bytes;
  return memory;
}

Status SurfelStore::finish() {
  for (std::size_t b = 0; b < bucket_count_; ++b) {
    Bucket& bucket = buckets_[b];
    if (bucket.open_count > 0) {
      SURFEIT_RETURN_IF_ERROR(store(bucket, bucket.open.first(bucket.open_count)));
    }
    bucket.open = {};
  }
  open_ = {};
  return file_ != nullptr ? file_->flush() : Status();
}

std::uint64_t SurfelStore::surfelCount(std::size_t bucket) const {
  return buckets_[bucket].surfels;
}

std::span<const SurfelStore::Block> SurfelStore::blocks(std::size_t bucket) const {
  return buckets_[bucket].blocks;
}

Result<Bytes> SurfelStore::fetch(const Block& block, AlignedBuffer& buffer) const {
  if (block.in_memory) return inMemory(block);
  return file_->readView(block.place, block.bytes, buffer);
}

Bytes SurfelStore::inMemory(const Block& block) const {
  SURFEIT_ASSERT(block.in_memory);
  return {reinterpret_cast<const std::byte*>(block.place), block.bytes};
}

void SurfelStore::release(const Block& block) const {
  if (plan_.gives_back && !block.in_memory) file_->release(block.place, alignedUp(block.bytes));
}

}  // namespace surfeit
