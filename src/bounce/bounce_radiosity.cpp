// A record: [ checksum : 8 | radiosity : 12 each | lobes, where there are some : 10 each ]
#include "bounce/bounce_radiosity.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <cstring>
#include <utility>

#include "core/thread_scratch.h"
#include "storage/block_writer.h"

namespace surfeit {
namespace {

constexpr std::size_t kFileBlocks = 2;

constexpr std::size_t kChecksumBytes = sizeof(std::uint64_t);

// The page is part of it, so that the record of another page does not pass.
std::uint64_t checksumOf(std::span<const std::byte> record, std::uint32_t surfel_page) {
  return XXH3_64bits_withSeed(record.data() + kChecksumBytes, record.size() - kChecksumBytes,
                              surfel_page);
}

std::vector<std::byte>& recordFor(std::size_t surfels, std::size_t lobes) {
  std::vector<std::byte>& record = threadScratch<std::vector<std::byte>>([] {});
  record.resize(kChecksumBytes + surfels * sizeof(glm::vec3) + lobes * sizeof(Lobe));
  return record;
}

}  // namespace

Result<BounceRadiosity> BounceRadiosity::create(const std::string& directory,
                                                std::uint32_t surfel_pages, bool has_lobes) {
  SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file, TemporaryFile::create(directory, kFileBlocks));
  return BounceRadiosity(std::move(file), surfel_pages, has_lobes);
}

BounceRadiosity::BounceRadiosity(BounceRadiosity&& other) noexcept
    : file_(std::move(other.file_)),
      offsets_(std::move(other.offsets_)),
      has_lobes_(other.has_lobes_),
      content_(other.content_.load()) {}

std::uint64_t BounceRadiosity::memoryBytes(std::uint32_t surfel_pages) {
  return surfel_pages * sizeof(std::uint64_t) + kFileBlocks * BlockWriter::kBlockBytes;
}

Status BounceRadiosity::put(std::uint32_t surfel_page, std::span<const glm::vec3> radiosity,
                            std::span<const Lobe> lobes) {
  std::vector<std::byte>& record = recordFor(radiosity.size(), lobes.size());
  std::byte* const values = record.data() + kChecksumBytes;
  std::memcpy(values, radiosity.data(), radiosity.size_bytes());
  if (!lobes.empty()) {
    std::memcpy(values + radiosity.size_bytes(), lobes.data(), lobes.size_bytes());
  }
  const std::uint64_t checksum = checksumOf(record, surfel_page);
  std::memcpy(record.data(), &checksum, sizeof checksum);
  SURFEIT_ASSIGN_OR_RETURN(offsets_[surfel_page], file_.append(record));
  content_ += checksum;  // a sum does not depend on the order
  return {};
}

// Through the page cache: records lie about in the order in which they are read, so that the system
// reads ahead. (Directly, a read of some KiB at a time, took ten times as long.)
Status BounceRadiosity::read(std::uint32_t surfel_page, std::span<glm::vec3> radiosity,
                             std::span<Lobe> lobes) {
  std::vector<std::byte>& record = recordFor(radiosity.size(), has_lobes_ ? radiosity.size() : 0);
  const std::uint64_t offset = offsets_[surfel_page];
  std::uint64_t expected = 0;
  SURFEIT_RETURN_IF_ERROR(file_.readAt(offset, record));
  std::memcpy(&expected, record.data(), sizeof expected);
  const std::byte* const values = record.data() + kChecksumBytes;
  std::memcpy(radiosity.data(), values, radiosity.size_bytes());
  if (!lobes.empty()) {
    std::memcpy(lobes.data(), values + radiosity.size_bytes(), lobes.size_bytes());
  }
  const std::uint64_t found = checksumOf(record, surfel_page);
  if (found != expected) {
    return Status::ioError(
        fmt::format("temporary file of a bounce: radiosity of surfel page {} at {}: checksum "
                    "{:016x}, expected {:016x}",
                    surfel_page, offset, found, expected));
  }
  return {};
}

}  // namespace surfeit
