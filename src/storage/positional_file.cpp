#include "storage/positional_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <limits>
#include <new>
#include <system_error>
#include <utility>

#include "core/assert.h"
#include "storage/system_calls.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMaxOffset = std::numeric_limits<off_t>::max();

bool isAligned(std::uint64_t value) { return value % kDirectAlignment == 0; }

// std::strerror is not safe from any thread.
std::string reason(int error) { return std::generic_category().message(error); }

}  // namespace

AlignedBuffer::~AlignedBuffer() { std::free(data_); }

void AlignedBuffer::reserve(std::size_t bytes) {
  if (bytes <= capacity_) return;
  std::free(std::exchange(data_, nullptr));
  capacity_ = 0;
  const std::size_t rounded = alignedUp(bytes);
  data_ = static_cast<std::byte*>(std::aligned_alloc(kDirectAlignment, rounded));
  if (data_ == nullptr) throw std::bad_alloc();
  capacity_ = rounded;
}

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
  if (this != &other) {
    close();
    descriptor_ = std::exchange(other.descriptor_, -1);
  }
  return *this;
}

void FileDescriptor::close() {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

PositionalFile::PositionalFile(FileDescriptor descriptor, std::string name,
                               std::string full_disk_advice)
    : name_(std::move(name)),
      full_disk_advice_(std::move(full_disk_advice)),
      cached_(std::move(descriptor)) {}

void PositionalFile::close() {
  cached_.close();
  direct_.close();
}

void PositionalFile::openDirect(int mode) {
  if (std::exchange(direct_wanted_, true)) return;
  // By way of /proc it is the same file whatever its path has become, even one without a name
  const std::string self = fmt::format("/proc/self/fd/{}", cached_.get());
  direct_ = FileDescriptor(system_calls::open(self.c_str(), mode | O_DIRECT | O_CLOEXEC));
}

Result<std::size_t> PositionalFile::readSome(std::uint64_t offset,
                                             std::span<std::byte> bytes) const {
  // No file reaches so far, and the system refuses what is no offset to it
  if (offset > kMaxOffset || bytes.size() > kMaxOffset - offset) return std::size_t{0};
  std::size_t done = 0;
  while (done < bytes.size()) {
    const std::span<std::byte> rest = bytes.subspan(done);
    const ssize_t got = system_calls::pread(cached_.get(), rest.data(), rest.size(), offset + done);
    if (got < 0) return readError(offset + done, rest.size());
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

Status PositionalFile::readAt(std::uint64_t offset, std::span<std::byte> bytes) const {
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, readSome(offset, bytes));
  return got == bytes.size() ? Status() : endsEarly(offset, bytes.size(), got);
}

Result<Bytes> PositionalFile::readView(std::uint64_t offset, std::size_t size,
                                       AlignedBuffer& buffer) const {
  if (direct_.isOpen()) {
    const std::size_t before = offset % kDirectAlignment;
    const std::size_t wanted = before + size;
    buffer.reserve(wanted);
    SURFEIT_ASSIGN_OR_RETURN(
        const std::size_t got,
        readAligned(offset - before, wanted, {buffer.data(), alignedUp(wanted)}));
    if (got <= before) return Bytes();
    return Bytes(buffer.data() + before, std::min(got, wanted) - before);
  }
  buffer.reserve(size);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, readSome(offset, {buffer.data(), size}));
  if (direct_wanted_) {
    posix_fadvise(cached_.get(), static_cast<off_t>(offset), static_cast<off_t>(got),
                  POSIX_FADV_DONTNEED);
  }
  return Bytes(buffer.data(), got);
}

// Reads `least` bytes at `begin`, and on to the end of `bytes` if it comes by itself; fewer only at
// the end of the file.
Result<std::size_t> PositionalFile::readAligned(std::uint64_t begin, std::size_t least,
                                                std::span<std::byte> bytes) const {
  std::size_t done = 0;
  while (done < least && isAligned(done)) {
    const std::span<std::byte> rest = bytes.subspan(done);
    const ssize_t got = system_calls::pread(direct_.get(), rest.data(), rest.size(), begin + done);
    if (got < 0 && errno != EINVAL) return readError(begin + done, rest.size());
    if (got < 0) break;  // not in this file, or not at this place
    if (got == 0) return done;
    done += static_cast<std::size_t>(got);
  }
  if (done >= least) return done;
  // After the end of the file, a short read, or a refusal, the rest has no alignment to keep
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t rest,
                           readSome(begin + done, bytes.subspan(done, least - done)));
  return done + rest;
}

void PositionalFile::release(std::uint64_t offset, std::uint64_t size) const {
  const std::uint64_t begin = alignedUp(offset);
  const std::uint64_t end = (offset + size) / kDirectAlignment * kDirectAlignment;
  // What it does not give back goes with the file
  if (begin < end) system_calls::punchHole(cached_.get(), begin, end - begin);
}

Status PositionalFile::writeAt(std::uint64_t offset, Bytes bytes) const {
  while (!bytes.empty()) {
    const ssize_t written = system_calls::pwrite(cached_.get(), bytes.data(), bytes.size(), offset);
    if (written == 0) errno = EIO;  // no progress and no reason
    if (written <= 0) return writeError(offset, bytes.size());
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
  return {};
}

Status PositionalFile::writeAligned(std::uint64_t offset, Bytes bytes) const {
  SURFEIT_ASSERT(isAligned(offset) && isAligned(bytes.size()));
  // A short write may end anywhere: what then remains goes through the page cache
  while (direct_.isOpen() && !bytes.empty() && isAligned(offset)) {
    const ssize_t written = system_calls::pwrite(direct_.get(), bytes.data(), bytes.size(), offset);
    if (written < 0 && errno != EINVAL) return writeError(offset, bytes.size());
    if (written <= 0) break;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
  return writeAt(offset, bytes);
}

Status PositionalFile::endsEarly(std::uint64_t offset, std::size_t expected,
                                 std::size_t found) const {
  return Status::corruption(fmt::format("{}: file ends early: {} bytes at {}, expected {}", name_,
                                        found, offset, expected));
}

Status PositionalFile::readError(std::uint64_t offset, std::size_t size) const {
  return Status::ioError(
      fmt::format("{}: cannot read {} bytes at {}: {}", name_, size, offset, reason(errno)));
}

// A full disk is the one failure that the user can mend: say how much there was and is.
Status PositionalFile::writeError(std::uint64_t offset, std::size_t size) const {
  const int error = errno;
  std::string message =
      fmt::format("{}: cannot write {} bytes at {}: {}", name_, size, offset, reason(error));
  if (error == ENOSPC || error == EDQUOT) {
    struct ::stat file {};
    if (system_calls::fstat(cached_.get(), &file) == 0) {
      message += fmt::format("; {} bytes are written so far", file.st_size);
    }
    struct ::statvfs disk {};
    if (system_calls::fstatvfs(cached_.get(), &disk) == 0) {
      message += fmt::format("; {} bytes are available", disk.f_bavail * disk.f_frsize);
    }
    if (!full_disk_advice_.empty()) message += "; " + full_disk_advice_;
  }
  if (error == EFBIG) {
    message +=
        "; files of this process may be no larger: raise the limit (ulimit -f), or that of "
        "the file system";
  }
  return Status::ioError(std::move(message));
}

Status PositionalFile::systemError(const char* action) const {
  return surfeit::systemError(name_, action);
}

Status systemError(const std::string& name, const char* action) {
  return Status::ioError(fmt::format("{}: cannot {}: {}", name, action, reason(errno)));
}

}  // namespace surfeit
