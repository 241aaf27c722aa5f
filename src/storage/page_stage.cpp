#include "storage/page_stage.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
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

PageStage::PageStage(const Options& options, const Scene& scene)
    : options_(options),
      scene_bytes_(scene.bytes),
      path_(pathOf(options.directory, scene.identity, scene.directory_checksum)) {
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
  // As long as the scene, so that what was not written is a hole
  if (std::uint64_t(info.st_size) < scene_bytes_ &&
      system_calls::ftruncate(descriptor, scene_bytes_) != 0) {
    stop(systemError(path_, "make room").message());
    return;
  }
  file_ = std::move(file);
  if (options_.limit_bytes > 0) others_bytes_ = storedBeside(options_.directory, path_);
  keeps_ = true;
}

Bytes PageStage::find(const InputFile& scene, std::uint64_t offset, std::size_t size,
                      const IsPage& isPage, AlignedBuffer& buffer) {
  if (!file_.isOpen()) return {};
  const auto isThere = [&](Bytes bytes) {
    if (bytes.empty() || !isPage(bytes)) return false;
    bytes_read_ += size;
    return true;
  };
  if (const Bytes staged = read(offset, size, buffer); isThere(staged)) return staged;
  if (!keeps_) return {};

  // Perhaps another thread has brought its chunk meanwhile
  const std::lock_guard lock(chunk_mutex_);
  const Bytes staged = read(offset, size, buffer);
  if (isThere(staged)) return staged;
  const Range lacking = lackingChunks(offset, size, staged);
  const bool has_other = lacking.begin == lacking.end;
  const Range wanted = has_other ? chunksOf(offset, size) : lacking;
  const Result<Bytes> chunks = scene.readView(wanted.begin, wanted.end - wanted.begin, chunk_);
  if (!chunks.ok() || chunks->size() != wanted.end - wanted.begin) return {};

  // The page: what lacked, beside what was there
  buffer.reserve(size);
  if (!staged.empty()) std::memmove(buffer.data(), staged.data(), size);
  const std::uint64_t begin = std::max(wanted.begin, offset);
  const std::uint64_t end = std::min<std::uint64_t>(wanted.end, offset + size);
  std::memcpy(buffer.data() + (begin - offset), chunks->data() + (begin - wanted.begin),
              end - begin);
  const Bytes page(buffer.data(), size);
  const bool is_page = isPage(page);
  if (has_other && is_page) {
    // Another task may have been writing it
    AlignedBuffer again;
    if (const Bytes now = read(offset, size, again); !now.empty() && isPage(now)) return page;
    tellDamage(offset);
  }
  keep(wanted.begin, *chunks);
  return is_page ? page : Bytes();
}

// Empty where there are fewer, or they cannot be read.
Bytes PageStage::read(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const {
  const Result<Bytes> bytes = file_.readView(offset, size, buffer);
  return bytes.ok() && bytes->size() == size ? *bytes : Bytes();
}

PageStage::Range PageStage::chunksOf(std::uint64_t offset, std::size_t size) const {
  const std::uint64_t chunk = options_.chunk_bytes;
  return {offset / chunk * chunk,
          std::min((offset + size + chunk - 1) / chunk * chunk, scene_bytes_)};
}

// Chunks of a page that were not written, from the first to the last of them; none where all were.
PageStage::Range PageStage::lackingChunks(std::uint64_t offset, std::size_t size,
                                          Bytes staged) const {
  if (staged.empty()) return chunksOf(offset, size);
  Range lacking;
  for (std::uint64_t at = offset; at < offset + size;) {
    const Range chunk = chunksOf(at, 1);
    const std::uint64_t end = std::min<std::uint64_t>(chunk.end, offset + size);
    if (isHole(staged.subspan(at - offset, end - at))) {
      if (lacking.begin == lacking.end) lacking.begin = chunk.begin;
      lacking.end = chunk.end;
    }
    at = end;
  }
  return lacking;
}

void PageStage::keep(std::uint64_t offset, Bytes chunks) {
  if (!hasRoom(chunks.size())) {
    return stop(path_ + (options_.limit_bytes > 0
                             ? ": the limit is reached, or nine tenths of the disk"
                             : ": nine tenths of the disk are full"));
  }
  const Status status = file_.writeAt(offset, chunks);
  if (!status.ok()) return stop(status.message());
  bytes_kept_ += chunks.size();
}

void PageStage::tellDamage(std::uint64_t offset) {
  const std::lock_guard lock(notes_mutex_);
  if (std::exchange(has_told_damage_, true)) return;
  notes_.push_back(fmt::format("{}: damaged at {}: pages are read from the scene, and kept anew",
                               path_, offset));
}

bool PageStage::hasRoom(std::uint64_t size) const {
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
  const std::lock_guard lock(notes_mutex_);
  keeps_ = false;
  if (std::exchange(has_told_end_, true)) return;
  notes_.push_back(
      fmt::format("{}; no more pages are kept there, what lacks is read from the scene", why));
}

std::vector<std::string> PageStage::takeNotes() {
  const std::lock_guard lock(notes_mutex_);
  return std::exchange(notes_, {});
}

}  // namespace surfeit
