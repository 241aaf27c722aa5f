#include "io/file_stamp.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>

namespace surfeit {

Result<FileStamp> FileStamp::of(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0) {
    return Status::ioError(fmt::format("{}: cannot stat: {}", path, std::strerror(errno)));
  }
  FileStamp stamp;
  stamp.device = static_cast<std::uint64_t>(info.st_dev);
  stamp.inode = static_cast<std::uint64_t>(info.st_ino);
  stamp.size_bytes = static_cast<std::uint64_t>(info.st_size);
  stamp.written_ns = std::int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec;
  return stamp;
}

Status checkUnchanged(const std::string& path, const FileStamp& before) {
  const Result<FileStamp> found = FileStamp::of(path);
  if (!found.ok() || found->device != before.device || found->inode != before.inode) return {};
  if (found->size_bytes == before.size_bytes && found->written_ns == before.written_ns) return {};
  return Status::corruption(fmt::format(
      "{}: changed while it was read: found {} bytes written at {} ns, expected {} bytes written "
      "at {} ns",
      path, found->size_bytes, found->written_ns, before.size_bytes, before.written_ns));
}

}  // namespace surfeit
