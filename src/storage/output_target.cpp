#include "storage/output_target.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/job_limits.h"
#include "storage/file.h"
#include "storage/system_calls.h"

namespace surfeit {
namespace {

constexpr int kMostLinks = 40;
constexpr std::size_t kCopyBytes = 1 << 20;
constexpr mode_t kPermissions = 0777;

// The descriptor that a path names, as /dev/fd/3 does; -1 when it names none.
int descriptorNamed(std::string_view path) {
  if (path == "-" || path.starts_with("-.") || path == "/dev/stdout") return STDOUT_FILENO;
  if (path == "/dev/stderr") return STDERR_FILENO;
  for (const std::string_view prefix : {"/dev/fd/", "/proc/self/fd/"}) {
    const std::string_view digits = path.substr(std::min(prefix.size(), path.size()));
    const bool is_number = !digits.empty() && digits.size() < 6 &&
                           digits.find_first_not_of("0123456789") == digits.npos;
    if (path.starts_with(prefix) && is_number) return std::stoi(std::string(digits));
  }
  return -1;
}

// Where a symbolic link leads, whether there is something or not.
Result<std::string> behindLinks(const std::string& path) {
  std::filesystem::path at = path;
  for (int links = 0; links < kMostLinks; ++links) {
    std::error_code error;
    if (!std::filesystem::is_symlink(at, error) || error) return at.string();
    const std::filesystem::path target = std::filesystem::read_symlink(at, error);
    if (error) break;
    at = target.is_absolute() ? target : at.parent_path() / target;
  }
  return Status::ioError(fmt::format("{}: symbolic links lead nowhere", path));
}

Status checkDirectory(const std::string& path, const std::string& real_path) {
  const std::string directory = directoryOf(real_path);
  struct ::stat info {};
  if (::stat(directory.c_str(), &info) != 0) {
    return Status::ioError(fmt::format("{}: cannot write: the directory {}: {}{}", path, directory,
                                       std::strerror(errno),
                                       errno == ENOENT ? ": make it first" : ""));
  }
  if (!S_ISDIR(info.st_mode)) {
    return Status::ioError(fmt::format("{}: cannot write: {} is not a directory", path, directory));
  }
  if (::access(directory.c_str(), W_OK | X_OK) != 0) {
    return Status::ioError(fmt::format(
        "{}: cannot write in the directory {}: {}: write elsewhere, or change its permissions",
        path, directory, std::strerror(errno)));
  }
  const std::size_t name_bytes = real_path.size() - (real_path.rfind('/') + 1);
  const long most_bytes = ::pathconf(directory.c_str(), _PC_NAME_MAX);
  if (most_bytes > 0 && name_bytes > static_cast<std::size_t>(most_bytes)) {
    return Status::ioError(fmt::format("{}: a name of {} bytes, expected at most {}: shorten it",
                                       path, name_bytes, most_bytes));
  }
  return {};
}

Result<FileDescriptor> openStream(const OutputTarget& target) {
  const int descriptor = descriptorNamed(target.path);
  FileDescriptor stream;
  if (descriptor >= 0) {
    stream = FileDescriptor(::fcntl(descriptor, F_DUPFD_CLOEXEC, 0));
  } else {
    struct ::stat info {};
    if (::stat(target.path.c_str(), &info) == 0 && S_ISSOCK(info.st_mode)) {
      ::sockaddr_un address{};
      address.sun_family = AF_UNIX;
      if (target.path.size() >= sizeof address.sun_path) errno = ENAMETOOLONG;
      std::strncpy(address.sun_path, target.path.c_str(), sizeof address.sun_path - 1);
      stream = FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
      const auto* const any = reinterpret_cast<const ::sockaddr*>(&address);
      if (stream.isOpen() && ::connect(stream.get(), any, sizeof address) != 0) stream.close();
    } else {
      stream = FileDescriptor(system_calls::open(target.path.c_str(), O_WRONLY | O_CLOEXEC));
    }
  }
  if (!stream.isOpen()) return systemError(target.path, "open for writing");
  return stream;
}

}  // namespace

Result<OutputTarget> resolveOutput(const std::string& path) {
  OutputTarget target;
  if (const int descriptor = descriptorNamed(path); descriptor >= 0) {
    const int flags = ::fcntl(descriptor, F_GETFL);
    if (flags >= 0 && (flags & O_ACCMODE) == O_RDONLY) errno = EBADF;
    if (flags < 0 || (flags & O_ACCMODE) == O_RDONLY) return systemError(path, "write");
    target.path = path;
    target.is_stream = true;
    return target;
  }
  SURFEIT_ASSIGN_OR_RETURN(target.path, behindLinks(path));
  struct ::stat info {};
  if (::stat(target.path.c_str(), &info) == 0) {
    if (S_ISDIR(info.st_mode)) {
      return Status::invalidArgument(
          fmt::format("{}: is a directory, expected the name of a file in it", path));
    }
    if (!S_ISREG(info.st_mode)) {
      if (::access(target.path.c_str(), W_OK) != 0) return systemError(path, "write");
      target.is_stream = true;
      return target;
    }
    target.mode = info.st_mode & kPermissions;
  } else if (path.ends_with('/')) {
    return Status::invalidArgument(
        fmt::format("{}: is the name of a directory, expected the name of a file", path));
  }
  SURFEIT_RETURN_IF_ERROR(checkDirectory(path, target.path));
  return target;
}

Status checkReplacesNot(const std::string& output, const std::string& input, const char* what) {
  struct ::stat of_output {
  }, of_input{};
  const bool is_one = ::stat(output.c_str(), &of_output) == 0 &&
                      ::stat(input.c_str(), &of_input) == 0 && S_ISREG(of_output.st_mode) &&
                      of_output.st_dev == of_input.st_dev && of_output.st_ino == of_input.st_ino;
  if (output != input && !is_one) return {};
  return Status::invalidArgument(
      fmt::format("{}: the result would replace the {}: give another name", output, what));
}

Status checkOutputRoom(const std::string& path, std::uint64_t least_bytes) {
  SURFEIT_ASSIGN_OR_RETURN(const OutputTarget target, resolveOutput(path));
  if (target.is_stream) return {};
  const std::string directory = directoryOf(target.path);
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t available, availableBytes(directory));
  if (available >= least_bytes) return {};
  return Status::ioError(fmt::format(
      "{}: {:.1f} MiB are free in {}, expected at least {:.1f} MiB: make room, or write "
      "elsewhere",
      path, double(available) / (1 << 20), directory, double(least_bytes) / (1 << 20)));
}

Status writeToStream(const OutputTarget& target, int from, std::uint64_t size) {
  SURFEIT_ASSIGN_OR_RETURN(const FileDescriptor stream, openStream(target));
  std::vector<char> buffer(static_cast<std::size_t>(std::min<std::uint64_t>(size, kCopyBytes)));
  for (std::uint64_t offset = 0; offset < size;) {
    const std::size_t wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(buffer.size(), size - offset));
    const ssize_t got = system_calls::pread(from, buffer.data(), wanted, offset);
    if (got <= 0) return systemError(target.path, "read what is to be written");
    for (ssize_t done = 0; done < got;) {
      const ssize_t written =
          ::write(stream.get(), buffer.data() + done, static_cast<std::size_t>(got - done));
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return systemError(target.path, "write");
      done += written;
    }
    offset += static_cast<std::uint64_t>(got);
  }
  return {};
}

std::string spoolDirectory() {
  const std::string of_job = jobTemporaryDirectory();
  return of_job.empty() ? "/tmp" : of_job;
}

std::string temporaryDirectory(const std::string& given, const std::string& output) {
  if (!given.empty()) return given;
  const std::string of_job = jobTemporaryDirectory();
  return of_job.empty() ? outputDirectory(output) : of_job;
}

std::string outputDirectory(const std::string& output) {
  const Result<OutputTarget> target = resolveOutput(output);
  if (!target.ok()) return directoryOf(output);
  return target->is_stream ? spoolDirectory() : directoryOf(target->path);
}

}  // namespace surfeit
