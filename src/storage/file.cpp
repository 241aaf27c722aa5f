#include "storage/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <utility>

#include "storage/input_spool.h"
#include "storage/system_calls.h"

namespace surfeit {
namespace {

std::int64_t writtenNs(const struct ::stat& info) {
  return std::int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec;
}

}  // namespace

Result<InputFile> InputFile::open(const std::string& path, Access access) {
  FileDescriptor descriptor = openKnownSpool(inputPath(path));
  if (!descriptor.isOpen()) {
    descriptor = FileDescriptor(system_calls::open(inputPath(path).c_str(), O_RDONLY | O_CLOEXEC));
  }
  if (!descriptor.isOpen()) return systemError(path, "open");
  struct ::stat info {};
  if (system_calls::fstat(descriptor.get(), &info) != 0) return systemError(path, "stat");
  if (S_ISFIFO(info.st_mode) || S_ISSOCK(info.st_mode)) {
    SURFEIT_ASSIGN_OR_RETURN(descriptor, openSpooled(descriptor.get(), path));
  }
  return fromOpen(PositionalFile(std::move(descriptor), path), access);
}

Result<InputFile> InputFile::fromBytes(Bytes bytes, const std::string& name) {
  FileDescriptor descriptor(::memfd_create("surfeit", MFD_CLOEXEC));
  PositionalFile file(std::move(descriptor), name);
  if (file.descriptor() < 0) return file.systemError("make a file in memory");
  SURFEIT_RETURN_IF_ERROR(file.writeAt(0, bytes));
  return fromOpen(std::move(file), Access::kCached);
}

Result<InputFile> InputFile::fromOpen(PositionalFile file, Access access) {
  InputFile input;
  input.file_ = std::move(file);
  struct ::stat info {};
  if (system_calls::fstat(input.file_.descriptor(), &info) != 0) {
    return input.file_.systemError("stat");
  }
  if (!S_ISREG(info.st_mode)) {
    const bool is_directory = S_ISDIR(info.st_mode);
    return Status::ioError(fmt::format(
        "{}: found a {}, expected a regular file or a pipe{}", input.path(),
        is_directory                       ? "directory"
        : isatty(input.file_.descriptor()) ? "terminal"
                                           : "device",
        is_directory ? fmt::format(": name the files in it ({}/*)", input.path()) : ""));
  }
  input.size_ = static_cast<std::uint64_t>(info.st_size);
  input.written_ns_ = writtenNs(info);
  if (access == Access::kDirect) input.file_.openDirect(O_RDONLY);
  return input;
}

Status InputFile::checkUnchanged() const {
  struct ::stat info {};
  if (system_calls::fstat(file_.descriptor(), &info) != 0) return file_.systemError("stat");
  const std::uint64_t size = static_cast<std::uint64_t>(info.st_size);
  if (size == size_ && writtenNs(info) == written_ns_) return {};
  return Status::corruption(fmt::format(
      "{}: changed while it was read: found {} bytes written at {} ns, expected {} bytes written "
      "at {} ns",
      path(), size, writtenNs(info), size_, written_ns_));
}

std::string directoryOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

Result<std::uint64_t> availableBytes(const std::string& directory) {
  struct ::statvfs info {};
  if (system_calls::statvfs(directory.c_str(), &info) != 0) {
    return systemError(directory, "tell how much room is left");
  }
  return std::uint64_t{info.f_bavail} * info.f_frsize;
}

}  // namespace surfeit
