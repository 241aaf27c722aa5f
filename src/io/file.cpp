#include "io/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr std::size_t kAppendBufferBytes = 1 << 20;

Status systemError(const std::string& path, const char* action) {
  return Status::ioError(fmt::format("{}: cannot {}: {}", path, action, std::strerror(errno)));
}

// Writes all bytes at `offset`, going on after short writes and interruptions.
Status writeFully(int descriptor, const std::string& path, std::uint64_t offset, Bytes bytes) {
  while (!bytes.empty()) {
    const ssize_t written =
        pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0) {
      if (errno == EINTR) continue;
      return Status::ioError(fmt::format("{}: cannot write {} bytes at {}: {}", path, bytes.size(),
                                         offset, std::strerror(errno)));
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
  return {};
}

// Reads until the bytes are full or the file ends; returns how many were read.
Result<std::size_t> readFully(int descriptor, const std::string& path, std::uint64_t offset,
                              std::span<std::byte> bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = pread(descriptor, bytes.data() + done, bytes.size() - done,
                              static_cast<off_t>(offset + done));
    if (got < 0) {
      if (errno == EINTR) continue;
      return Status::ioError(fmt::format("{}: cannot read {} bytes at {}: {}", path, bytes.size(),
                                         offset, std::strerror(errno)));
    }
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

Status endsEarly(const std::string& path, std::uint64_t offset, std::size_t expected,
                 std::size_t found) {
  return Status::corruption(fmt::format("{}: file ends early: {} bytes at {}, expected {}", path,
                                        found, offset, expected));
}

}  // namespace

AlignedBuffer::~AlignedBuffer() { std::free(data_); }

void AlignedBuffer::reserve(std::size_t bytes) {
  if (bytes <= capacity_) return;
  std::free(data_);
  capacity_ = (bytes + kDirectAlignment - 1) / kDirectAlignment * kDirectAlignment;
  data_ = static_cast<std::byte*>(std::aligned_alloc(kDirectAlignment, capacity_));
  SURFEIT_CHECK(data_ != nullptr);
}

FileDescriptor::FileDescriptor(FileDescriptor&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
  if (this != &other) {
    close();
    descriptor_ = std::exchange(other.descriptor_, -1);
  }
  return *this;
}

FileDescriptor::~FileDescriptor() { close(); }

void FileDescriptor::close() {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

Result<InputFile> InputFile::open(const std::string& path) {
  InputFile file;
  file.path_ = path;
  file.descriptor_ = FileDescriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.descriptor_.isOpen()) return systemError(path, "open");
  struct stat info {};
  if (fstat(file.descriptor_.get(), &info) != 0) return systemError(path, "stat");
  if (!S_ISREG(info.st_mode)) {
    return Status::ioError(fmt::format("{}: not a regular file", path));
  }
  file.size_ = static_cast<std::uint64_t>(info.st_size);
  return file;
}

Status InputFile::readAt(std::uint64_t offset, std::span<std::byte> bytes) const {
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, readSome(offset, bytes));
  if (got < bytes.size()) return endsEarly(path_, offset, bytes.size(), got);
  return {};
}

Result<std::size_t> InputFile::readSome(std::uint64_t offset, std::span<std::byte> bytes) const {
  return readFully(descriptor_.get(), path_, offset, bytes);
}

Result<Bytes> InputFile::readView(std::uint64_t offset, std::size_t size,
                                  AlignedBuffer& buffer) const {
  buffer.reserve(size);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, readSome(offset, {buffer.data(), size}));
  return Bytes(buffer.data(), got);
}

Result<AtomicFile> AtomicFile::create(const std::string& path) {
  // The process number keeps two writers of one path apart
  AtomicFile file;
  file.path_ = path;
  const std::string temporary = fmt::format("{}.{}.tmp", path, getpid());
  file.descriptor_ =
      FileDescriptor(::open(temporary.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file.descriptor_.isOpen()) return systemError(temporary, "create");
  file.temporary_path_ = temporary;
  file.buffer_.reserve(kAppendBufferBytes);
  return file;
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_path_(std::exchange(other.temporary_path_, {})),
      descriptor_(std::move(other.descriptor_)),
      buffer_(std::move(other.buffer_)),
      size_(other.size_) {}

AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept {
  if (this != &other) {
    discard();
    path_ = std::move(other.path_);
    temporary_path_ = std::exchange(other.temporary_path_, {});
    descriptor_ = std::move(other.descriptor_);
    buffer_ = std::move(other.buffer_);
    size_ = other.size_;
  }
  return *this;
}

AtomicFile::~AtomicFile() { discard(); }

void AtomicFile::discard() {
  if (!temporary_path_.empty()) unlink(temporary_path_.c_str());
  temporary_path_.clear();
  descriptor_.close();
}

Status AtomicFile::append(Bytes bytes) {
  if (buffer_.size() + bytes.size() > kAppendBufferBytes) SURFEIT_RETURN_IF_ERROR(flush());
  if (bytes.size() >= kAppendBufferBytes) {
    SURFEIT_RETURN_IF_ERROR(writeFully(descriptor_.get(), temporary_path_, size_, bytes));
  } else {
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  }
  size_ += bytes.size();
  return {};
}

Status AtomicFile::flush() {
  SURFEIT_RETURN_IF_ERROR(
      writeFully(descriptor_.get(), temporary_path_, size_ - buffer_.size(), buffer_));
  buffer_.clear();
  return {};
}

Status AtomicFile::writeAt(std::uint64_t offset, Bytes bytes) {
  SURFEIT_RETURN_IF_ERROR(flush());
  return writeFully(descriptor_.get(), temporary_path_, offset, bytes);
}

Status AtomicFile::commit() {
  SURFEIT_RETURN_IF_ERROR(flush());
  // A failed fsync is final: the pages are marked clean and a second one would lie
  if (fsync(descriptor_.get()) != 0) return systemError(temporary_path_, "sync");
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0) {
    return systemError(path_, "rename the finished file to its final name");
  }
  temporary_path_.clear();
  // The new name itself must survive a power loss too
  const std::string directory = directoryOf(path_);
  const FileDescriptor handle(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!handle.isOpen() || fsync(handle.get()) != 0) return systemError(directory, "sync");
  descriptor_.close();
  return {};
}

Result<TemporaryFile> TemporaryFile::create(const std::string& directory) {
  TemporaryFile file;
  file.directory_ = directory;
  file.descriptor_ =
      FileDescriptor(::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (!file.descriptor_.isOpen()) {
    // Not every file system has O_TMPFILE: create a named file and unlink it at once
    std::string name = directory + "/surfeit-XXXXXX";
    file.descriptor_ = FileDescriptor(mkstemp(name.data()));
    if (!file.descriptor_.isOpen()) return systemError(directory, "create a temporary file in");
    unlink(name.c_str());
  }
  return file;
}

Status TemporaryFile::append(Bytes bytes) {
  SURFEIT_RETURN_IF_ERROR(
      writeFully(descriptor_.get(), directory_ + " (temporary file)", size_, bytes));
  size_ += bytes.size();
  return {};
}

Status TemporaryFile::readAt(std::uint64_t offset, std::span<std::byte> bytes) const {
  const std::string name = directory_ + " (temporary file)";
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                           readFully(descriptor_.get(), name, offset, bytes));
  if (got < bytes.size()) return endsEarly(name, offset, bytes.size(), got);
  return {};
}

std::string directoryOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

}  // namespace surfeit
