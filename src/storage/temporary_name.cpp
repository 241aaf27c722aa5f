#include "storage/temporary_name.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <memory>
#include <string_view>
#include <utility>

#include "storage/file.h"
#include "storage/system_calls.h"

namespace surfeit {
namespace {

constexpr std::string_view kInfix = ".surfeit-";
constexpr std::string_view kSuffix = ".tmp";
constexpr std::size_t kRandomChars = 6;
constexpr std::string_view kAlphabet = "0123456789abcdefghijklmnopqrstuvwxyz";
constexpr std::size_t kMaxNameBytes = 255;  // NAME_MAX of every file system of note
constexpr int kAttempts = 100;

struct CloseDirectory {
  void operator()(DIR* entries) const { ::closedir(entries); }
};

std::uint64_t randomNumber() {
  std::uint64_t number = 0;
  if (getrandom(&number, sizeof number, GRND_NONBLOCK) == sizeof number) return number;
  // A clash is noticed in any case: this need only be unlikely to repeat
  static std::atomic<std::uint64_t> calls{0};
  const auto now = std::chrono::steady_clock::now().time_since_epoch().count();
  return (static_cast<std::uint64_t>(now) ^ (calls++ << 32)) * 0x9e3779b97f4a7c15ull +
         static_cast<std::uint64_t>(getpid());
}

// What the temporary names of a path begin with, without the directory.
std::string namePrefix(const std::string& path) {
  constexpr std::size_t kAdded = kInfix.size() + kRandomChars + kSuffix.size();
  std::string name = path.substr(path.rfind('/') + 1);
  name.resize(std::min(name.size(), kMaxNameBytes - kAdded));
  return name.append(kInfix);
}

std::string temporaryPath(const std::string& path) {
  std::string temporary = directoryOf(path) + '/' + namePrefix(path);
  std::uint64_t number = randomNumber();
  for (std::size_t i = 0; i < kRandomChars; ++i) {
    temporary += kAlphabet[number % kAlphabet.size()];
    number /= kAlphabet.size();
  }
  return temporary.append(kSuffix);
}

bool isTemporaryName(std::string_view name, std::string_view prefix) {
  return name.size() == prefix.size() + kRandomChars + kSuffix.size() && name.starts_with(prefix) &&
         name.ends_with(kSuffix) &&
         name.substr(prefix.size(), kRandomChars).find_first_not_of(kAlphabet) == name.npos;
}

// Whether another process, taking the file for a leftover in the moment between its creation and
// its lock, has removed it or is about to.
bool isLost(int descriptor) {
  if (system_calls::flock(descriptor, LOCK_EX | LOCK_NB) != 0) return errno == EWOULDBLOCK;
  struct ::stat info {};
  return system_calls::fstat(descriptor, &info) == 0 && info.st_nlink == 0;
}

}  // namespace

Result<NamedFile> createTemporary(const std::string& path, const std::string& name) {
  constexpr int kFlags = O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    NamedFile file;
    file.path = temporaryPath(path);
    file.descriptor = FileDescriptor(system_calls::open(file.path.c_str(), kFlags, 0666));
    if (file.descriptor.isOpen()) {
      if (!isLost(file.descriptor.get())) return file;
      // Whoever took it for a leftover removes it; so do we, in case that was not it
      system_calls::unlink(file.path.c_str());
    } else if (errno != EEXIST) {
      break;
    }
  }
  return systemError(name, "create a temporary file");
}

Result<std::string> nameTemporary(int descriptor, const std::string& path) {
  // Locked before others can see it. Where that is refused, others cannot lock it either
  system_calls::flock(descriptor, LOCK_EX | LOCK_NB);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    std::string temporary = temporaryPath(path);
    if (system_calls::linkDescriptor(descriptor, temporary.c_str()) == 0) return temporary;
    if (errno != EEXIST) break;
  }
  return systemError(path, "give the finished file a name");
}

// The system's own reading: that of the standard library ends the program when memory runs out.
void removeStaleTemporaries(const std::string& path) {
  const std::string directory = directoryOf(path), prefix = namePrefix(path);
  const std::unique_ptr<DIR, CloseDirectory> entries(::opendir(directory.c_str()));
  if (entries == nullptr) return;
  while (const dirent* const entry = ::readdir(entries.get())) {
    if (!isTemporaryName(entry->d_name, prefix)) continue;
    const std::string temporary = directory + '/' + entry->d_name;
    // Locks on network file systems want the file open for writing
    const FileDescriptor file(
        system_calls::open(temporary.c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    struct ::stat found {};
    if (!file.isOpen() || system_calls::fstat(file.get(), &found) != 0) continue;
    if (!S_ISREG(found.st_mode)) continue;
    if (system_calls::flock(file.get(), LOCK_EX | LOCK_NB) != 0) continue;
    system_calls::unlink(temporary.c_str());
  }
}

}  // namespace surfeit
