// Where forecasts do a job with a sample.
#pragma once

#include <stdlib.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// A folder of its own, removed with what is in it.
class ScratchFolder {
 public:
  static Result<ScratchFolder> create(const std::string& directory) {
    std::string name = directory + "/surfeit-forecast-XXXXXX";
    if (mkdtemp(name.data()) == nullptr) {
      return Status::ioError(directory + ": cannot make a temporary folder");
    }
    return ScratchFolder(std::move(name));
  }
  ScratchFolder(ScratchFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  ScratchFolder& operator=(ScratchFolder&&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  const std::string& path() const { return path_; }
  std::string file(const std::string& name) const { return path_ + "/" + name; }

  // A file here of the format that an output has by its name; "-" is standard output, as PLY.
  std::string fileLike(const std::string& output) const {
    if (output == "-") return file("output.ply");
    if (output.starts_with("-.")) return file("output" + output.substr(1));
    return file(std::filesystem::path(output).filename().string());
  }

 private:
  explicit ScratchFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

// Says nothing but that the user wants no more.
class SilentProgress final : public Progress {
 public:
  explicit SilentProgress(Progress& progress) : progress_(progress) {}
  bool isCancelled() const override { return progress_.isCancelled(); }

 private:
  Progress& progress_;
};

// The status with the user's own file in the place of a temporary one.
inline Status withName(const Status& status, const std::string& temporary, const std::string& own) {
  std::string message = status.message();
  const std::size_t at = message.find(temporary);
  if (at != std::string::npos) message.replace(at, temporary.size(), own);
  return {status.code(), message};
}

inline std::uint64_t fileBytesOf(const std::string& path) {
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(path, error);
  return error ? 0 : bytes;
}

}  // namespace surfeit
