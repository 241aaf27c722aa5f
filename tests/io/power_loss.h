// What a disk may hold after a power loss, for tests: a FaultInjector that follows the files of one
// directory through all system calls of the library, and tries what a loss before each call leaves.
//
// A file system may keep or lose, in any combination, each name that was made, moved or removed
// since its directory was synced, and each block of a file since that file was synced.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "io/fault_injector.h"

namespace surfeit {

class PowerLoss : public FaultInjector {
 public:
  // Names without directory, and contents.
  using Disk = std::map<std::string, std::string>;
  using Look = std::function<void(const Disk&)>;
  // A disk that does not sync is one for which no writer can do anything right.
  enum class Syncs { kHonest, kNotFiles, kNotDirectories };

  // `look` sees what a loss may leave, before each call from which it may be more than one thing.
  // What is in the directory now is safe.
  PowerLoss(std::string directory, unsigned seed, Look look, Syncs syncs = Syncs::kHonest)
      : directory_(std::move(directory)), random_(seed), look_(std::move(look)), syncs_(syncs) {
    for (const auto& file : std::filesystem::directory_iterator(directory_)) {
      const auto inode = follow(file.path().c_str());
      inodes_.at(*inode).synced = contents(*inode);
      names_[file.path().filename().string()].safe = inode;
    }
  }
  PowerLoss(const PowerLoss&) = delete;
  PowerLoss& operator=(const PowerLoss&) = delete;
  ~PowerLoss() override {
    for (const auto& [number, inode] : inodes_) ::close(inode.descriptor);
  }

  int before(CallInfo&) override {
    const std::lock_guard lock(mutex_);
    if (isUnsafe()) lose(kLossesPerCall, look_);
    return 0;
  }
  void after(const CallInfo& info, int error) override {
    const std::lock_guard lock(mutex_);
    if (error == 0) follow(info);
  }
  // Shows what a loss may leave now.
  void loseNow(const Look& look) { lose(kLossesPerCall, look); }
  std::uint64_t losses() const { return losses_; }

  static void restore(const Disk& disk, const std::string& directory) {
    for (const auto& [name, bytes] : disk) {
      const std::string path = (std::filesystem::path(directory) / name).string();
      const int file = ::open(path.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0644);
      if (::write(file, bytes.data(), bytes.size()) != ssize_t(bytes.size())) std::abort();
      ::close(file);
    }
  }

 private:
  using Number = ino_t;
  static constexpr int kLossesPerCall = 16;
  static constexpr std::size_t kBlock = 512;
  struct Inode {
    int descriptor;
    std::string synced;
  };
  struct Name {
    std::optional<Number> safe;                 // since the directory was synced last
    std::vector<std::optional<Number>> unsafe;  // what it has stood for since then
  };

  std::optional<std::string> nameOf(const char* path) const {
    const std::filesystem::path whole(path);
    std::error_code error;
    if (!std::filesystem::equivalent(whole.parent_path(), directory_, error)) return std::nullopt;
    return whole.filename().string();
  }
  std::optional<Number> follow(const char* path) {
    const int descriptor = ::open(path, O_RDONLY | O_CLOEXEC);
    struct ::stat info = {};
    if (descriptor < 0 || ::fstat(descriptor, &info) != 0) std::abort();
    if (!inodes_.try_emplace(info.st_ino, Inode{descriptor, {}}).second) ::close(descriptor);
    return info.st_ino;
  }
  void rename(const char* path, std::optional<Number> inode) {
    if (const auto name = nameOf(path)) names_[*name].unsafe.push_back(inode);
  }

  void follow(const CallInfo& info) {
    switch (info.call) {
      case Call::kOpen:
        if ((info.flags & O_CREAT) != 0 && nameOf(info.path)) rename(info.path, follow(info.path));
        break;
      case Call::kLinkat:
        if (nameOf(info.new_path)) rename(info.new_path, follow(info.new_path));
        break;
      case Call::kRename:
        rename(info.path, std::nullopt);
        if (nameOf(info.new_path)) rename(info.new_path, follow(info.new_path));
        break;
      case Call::kUnlink:
        rename(info.path, std::nullopt);
        break;
      case Call::kFsync:
        sync(info.descriptor);
        break;
      default:
        break;
    }
  }

  void sync(int descriptor) {
    struct ::stat info = {}, directory = {};
    if (::fstat(descriptor, &info) != 0 || ::stat(directory_.c_str(), &directory) != 0) return;
    if (!S_ISDIR(info.st_mode)) {
      const std::string path = "/proc/self/fd/" + std::to_string(descriptor);
      const Number inode = *follow(path.c_str());
      if (syncs_ != Syncs::kNotFiles) inodes_.at(inode).synced = contents(inode);
    } else if (info.st_ino == directory.st_ino && syncs_ != Syncs::kNotDirectories) {
      for (auto& [name, entry] : names_) {
        if (!entry.unsafe.empty()) entry.safe = entry.unsafe.back();
        entry.unsafe.clear();
      }
    }
  }

  bool isUnsafe() const {
    return std::any_of(names_.begin(), names_.end(),
                       [](const auto& name) { return !name.second.unsafe.empty(); });
  }

  void lose(int count, const Look& look) {
    for (int i = 0; i < count; ++i) {
      Disk disk;
      for (const auto& [name, entry] : names_) {
        const std::size_t version = random_() % (entry.unsafe.size() + 1);
        const std::optional<Number> inode = version == 0 ? entry.safe : entry.unsafe[version - 1];
        if (inode) disk[name] = torn(*inode);
      }
      ++losses_;
      look(disk);
    }
  }

  std::string contents(Number number) const {
    const int file = inodes_.at(number).descriptor;
    std::string bytes(std::size_t(::lseek(file, 0, SEEK_END)), '\0');
    if (::pread(file, bytes.data(), bytes.size(), 0) != ssize_t(bytes.size())) std::abort();
    return bytes;
  }

  // What may be left of a file: any blocks of what was not synced, up to any size.
  std::string torn(Number number) {
    const std::string& synced = inodes_.at(number).synced;
    std::string bytes = contents(number);
    if (bytes == synced) return bytes;
    for (std::size_t begin = 0; begin < bytes.size(); begin += kBlock) {
      const std::size_t size = std::min(kBlock, bytes.size() - begin);
      if (random_() % 2 == 0) continue;
      for (std::size_t i = begin; i < begin + size; ++i) {
        bytes[i] = i < synced.size() ? synced[i] : '\0';
      }
    }
    const std::size_t least = std::min(synced.size(), bytes.size());
    const std::size_t most = std::max(synced.size(), bytes.size());
    bytes.resize(random_() % 2 == 0 ? bytes.size() : least + random_() % (most - least + 1));
    return bytes;
  }

  const std::string directory_;
  std::mt19937 random_;
  const Look look_;
  const Syncs syncs_;
  std::mutex mutex_;
  std::map<Number, Inode> inodes_;
  std::map<std::string, Name> names_;
  std::uint64_t losses_ = 0;
};

}  // namespace surfeit
