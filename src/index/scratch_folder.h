// Where forecasts do a job with a sample.
#pragma once

#include <stdlib.h>

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
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  explicit ScratchFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

// Says nothing but that the user wants no more.
class QuietProgress final : public Progress {
 public:
  explicit QuietProgress(Progress& progress) : progress_(progress) {}
  bool isCancelled() const override { return progress_.isCancelled(); }

 private:
  Progress& progress_;
};

}  // namespace surfeit
