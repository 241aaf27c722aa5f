#include "storage/input_spool.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>
#include <utility>
#include <vector>

#include "storage/output_target.h"
#include "storage/system_calls.h"
#include "storage/temporary_name.h"

namespace surfeit {
namespace {

constexpr std::size_t kSpooledBytes = 1 << 20;

struct Spool {
  dev_t device;
  ino_t inode;
  FileDescriptor file;
};

// Of this process.
struct Spools {
  std::mutex mutex;
  std::vector<Spool> all;

  const Spool* find(const struct ::stat& info) const {
    for (const Spool& one : all) {
      if (one.device == info.st_dev && one.inode == info.st_ino) return &one;
    }
    return nullptr;
  }
};

Spools& spools() {
  static Spools spools;
  return spools;
}

FileDescriptor openAgain(const Spool& spool) {
  const std::string self = "/proc/self/fd/" + std::to_string(spool.file.get());
  return FileDescriptor(system_calls::open(self.c_str(), O_RDONLY | O_CLOEXEC));
}

Result<FileDescriptor> createSpool() {
  const std::string directory = spoolDirectory();
  FileDescriptor file(system_calls::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (file.isOpen()) return file;
  SURFEIT_ASSIGN_OR_RETURN(NamedFile named, createTemporary(directory + "/scratch", directory));
  if (system_calls::unlink(named.path.c_str()) != 0) {
    return systemError(directory, "remove the name of a temporary file");
  }
  return std::move(named.descriptor);
}

Status copyAll(int from, int to, const std::string& path) {
  std::vector<char> buffer(kSpooledBytes);
  for (std::uint64_t offset = 0;;) {
    const ssize_t got = ::read(from, buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return systemError(path, "read");
    if (got == 0) return {};
    for (ssize_t done = 0; done < got;) {
      const ssize_t written = system_calls::pwrite(to, buffer.data() + done,
                                                   static_cast<std::size_t>(got - done), offset);
      if (written <= 0) return systemError(spoolDirectory(), "keep what is read from a pipe");
      done += written;
      offset += static_cast<std::uint64_t>(written);
    }
  }
}

}  // namespace

std::string inputPath(const std::string& path) { return path == "-" ? "/dev/stdin" : path; }

Result<FileDescriptor> openSpooled(int descriptor, const std::string& path) {
  struct ::stat info {};
  if (system_calls::fstat(descriptor, &info) != 0) return systemError(path, "stat");
  const std::lock_guard lock(spools().mutex);
  const Spool* spool = spools().find(info);
  if (spool == nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(FileDescriptor file, createSpool());
    SURFEIT_RETURN_IF_ERROR(copyAll(descriptor, file.get(), path));
    spool = &spools().all.emplace_back(Spool{info.st_dev, info.st_ino, std::move(file)});
  }
  FileDescriptor again = openAgain(*spool);
  if (!again.isOpen()) return systemError(path, "open what was read");
  return again;
}

FileDescriptor openKnownSpool(const std::string& path) {
  struct ::stat info {};
  if (::stat(path.c_str(), &info) != 0 || !S_ISFIFO(info.st_mode)) return {};
  const std::lock_guard lock(spools().mutex);
  const Spool* const spool = spools().find(info);
  return spool != nullptr ? openAgain(*spool) : FileDescriptor();
}

}  // namespace surfeit
