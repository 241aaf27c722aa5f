#include "storage/temporary_bytes.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr std::size_t kUnitBytes = 64 << 10;
constexpr std::size_t kChecksumBytes = 8;
constexpr std::uint64_t kNoUnit = ~std::uint64_t{0};

// The number is part of it, so that a unit read from elsewhere does not pass.
std::uint64_t checksumOf(Bytes unit, std::uint64_t number) {
  return XXH3_64bits_withSeed(unit.data() + kChecksumBytes, unit.size() - kChecksumBytes, number);
}

}  // namespace

Result<TemporaryBytes> TemporaryBytes::create(const std::string& directory) {
  SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file, TemporaryFile::create(directory));
  TemporaryBytes bytes(std::move(file), directory);
  bytes.unit_.reserve(kChecksumBytes + kUnitBytes);
  bytes.unit_.resize(kChecksumBytes);
  return bytes;
}

Status TemporaryBytes::keep(Status status) {
  if (!status.ok()) failure_ = status;
  return status;
}

Status TemporaryBytes::append(Bytes bytes) {
  SURFEIT_CHECK(!is_flushed_);
  SURFEIT_RETURN_IF_ERROR(failure_);
  while (!bytes.empty()) {
    const std::size_t room = kChecksumBytes + kUnitBytes - unit_.size();
    const Bytes part = bytes.first(std::min(bytes.size(), room));
    unit_.insert(unit_.end(), part.begin(), part.end());
    size_ += part.size();
    bytes = bytes.subspan(part.size());
    if (part.size() == room) SURFEIT_RETURN_IF_ERROR(keep(appendUnit()));
  }
  return {};
}

Status TemporaryBytes::appendUnit() {
  const std::uint64_t checksum = checksumOf(unit_, unit_number_++);
  std::memcpy(unit_.data(), &checksum, sizeof checksum);
  Status status = file_.append(unit_).status();
  unit_.resize(kChecksumBytes);
  return status;
}

Status TemporaryBytes::flush() {
  SURFEIT_RETURN_IF_ERROR(failure_);
  if (is_flushed_) return {};
  if (unit_.size() > kChecksumBytes) SURFEIT_RETURN_IF_ERROR(keep(appendUnit()));
  is_flushed_ = true;
  unit_number_ = kNoUnit;
  return keep(file_.flush());
}

Status TemporaryBytes::load(std::uint64_t unit) {
  unit_number_ = kNoUnit;
  const std::uint64_t begin = unit * kUnitBytes;
  const std::size_t size =
      static_cast<std::size_t>(std::min<std::uint64_t>(kUnitBytes, size_ - begin));
  unit_.resize(kChecksumBytes + size);
  SURFEIT_RETURN_IF_ERROR(file_.readAt(unit * (kChecksumBytes + kUnitBytes), unit_));
  std::uint64_t expected = 0;
  std::memcpy(&expected, unit_.data(), sizeof expected);
  if (const std::uint64_t found = checksumOf(unit_, unit); found != expected) {
    return Status::ioError(
        fmt::format("{} (temporary file): {} bytes at {}: checksum {:016x}, expected {:016x}",
                    directory_, size, begin, found, expected));
  }
  unit_number_ = unit;
  return {};
}

Status TemporaryBytes::readAt(std::uint64_t offset, std::span<std::byte> bytes) {
  SURFEIT_CHECK(is_flushed_);
  SURFEIT_RETURN_IF_ERROR(failure_);
  if (offset > size_ || bytes.size() > size_ - offset) {
    return Status::corruption(fmt::format("{} (temporary file): {} bytes, expected {} at {}",
                                          directory_, size_, bytes.size(), offset));
  }
  while (!bytes.empty()) {
    const std::uint64_t unit = offset / kUnitBytes;
    if (unit != unit_number_) SURFEIT_RETURN_IF_ERROR(keep(load(unit)));
    const std::size_t begin = static_cast<std::size_t>(offset % kUnitBytes);
    const std::size_t count = std::min(bytes.size(), unit_.size() - kChecksumBytes - begin);
    std::memcpy(bytes.data(), unit_.data() + kChecksumBytes + begin, count);
    bytes = bytes.subspan(count);
    offset += count;
  }
  return {};
}

}  // namespace surfeit
