#include "storage/page_stage.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "storage/system_calls.h"

namespace surfeit {
namespace {

constexpr const char* kPrefix = "surfeit-stage-";

std::string pathOf(const std::string& directory, std::uint64_t identity, std::uint64_t checksum) {
  return fmt::format("{}/{}{:016x}-{:016x}.pages", directory, kPrefix, identity, checksum);
}

// Of the file systems' blocks: holes are none.
std::uint64_t storedBytes(const struct ::stat& info) { return std::uint64_t(info.st_blocks) * 512; }

std::uint64_t storedBeside(const std::string& directory, const std::string& path) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    struct ::stat info {};
    const std::string& other = entry->path().native();
    if (!entry->path().filename().native().starts_with(kPrefix) || other == path) continue;
    if (::lstat(other.c_str(), &info) == 0) bytes += storedBytes(info);
  }
  return bytes;
}

bool isHole(Bytes bytes) {
  return std::all_of(bytes.begin(), bytes.end(),
                     [](std::byte byte) { return byte == std::byte{}; });
}

}  // namespace

PageStage::PageStage(const Options& options, std::uint64_t identity,
                     std::uint64_t directory_checksum)
    : options_(options), path_(pathOf(options.directory, identity, directory_checksum)) {
  const int descriptor =
      system_calls::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (descriptor < 0) {
    stop(systemError(path_, "open").message());
    return;
  }
  PositionalFile file(FileDescriptor(descriptor), path_);
  struct ::stat info {};
  // Others may have put something there: directories for scratch are everybody's
  if (system_calls::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode) ||
      info.st_uid != ::geteuid()) {
    stop(path_ + ": no file of this user");
    return;
  }
  file_ = std::move(file);
  if (options_.limit_bytes > 0) others_bytes_ = storedBeside(options_.directory, path_);
  keeps_ = true;
}

Bytes PageStage::read(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const {
  if (!file_.isOpen()) return {};
  const Result<Bytes> bytes = file_.readView(offset, size, buffer);
  if (!bytes.ok() || bytes->size() != size || isHole(*bytes)) return {};
  return *bytes;
}

void PageStage::keep(std::uint64_t offset, Bytes page, bool had_other) {
  if (had_other) {
    // Another task may have been writing it
    AlignedBuffer buffer;
    const Bytes now = read(offset, page.size(), buffer);
    if (std::equal(now.begin(), now.end(), page.begin(), page.end())) return;
    const std::lock_guard lock(mutex_);
    if (!std::exchange(has_told_damage_, true)) {
      notes_.push_back(fmt::format(
          "{}: damaged at {}: pages are read from the scene, and kept anew", path_, offset));
    }
  }
  if (!keeps_) return;
  if (!hasRoom(page.size())) {
    return stop(path_ + (options_.limit_bytes > 0
                             ? ": the limit is reached, or nine tenths of the disk"
                             : ": nine tenths of the disk are full"));
  }
  if (const Status status = file_.writeAt(offset, page); !status.ok())
    return stop(status.message());
  bytes_kept_ += page.size();
}

bool PageStage::hasRoom(std::size_t size) const {
  struct ::stat info {};
  struct ::statvfs disk {};
  if (system_calls::fstat(file_.descriptor(), &info) != 0 ||
      system_calls::fstatvfs(file_.descriptor(), &disk) != 0) {
    return false;
  }
  const std::uint64_t stored = storedBytes(info) + others_bytes_ + size;
  if (options_.limit_bytes > 0 && stored > options_.limit_bytes) return false;
  return disk.f_bavail * disk.f_frsize >= disk.f_blocks * disk.f_frsize / kFreePart + size;
}

void PageStage::stop(const std::string& why) {
  const std::lock_guard lock(mutex_);
  keeps_ = false;
  if (std::exchange(has_told_end_, true)) return;
  notes_.push_back(
      fmt::format("{}; no more pages are kept there, what lacks is read from the scene", why));
}

std::vector<std::string> PageStage::takeNotes() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notes_, {});
}

}  // namespace surfeit
