#include "batch/environment_file.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cloud/pictures/picture_reader.h"
#include "gather/light/environment_picture.h"

namespace surfeit {
namespace {

// Rows of light without values that no light has.
class MendedRows {
 public:
  MendedRows(PictureReader& reader, Progress& progress)
      : reader_(reader), progress_(progress), row_(std::size_t(reader.width())) {}

  Result<std::span<const glm::vec3>> next() {
    if (progress_.isCancelled()) return Status::interrupted();
    SURFEIT_RETURN_IF_ERROR(reader_.readRow(row_));
    for (glm::vec3& pixel : row_) {
      bool is_light = true;
      for (int i = 0; i < 3; ++i) {
        if (pixel[i] >= 0 && std::isfinite(pixel[i])) continue;
        pixel[i] = 0;
        is_light = false;
      }
      mended_ += is_light ? 0 : 1;
    }
    return std::span<const glm::vec3>(row_);
  }

  void note() const {
    if (mended_ == 0) return;
    progress_.note(fmt::format(
        "{}: pixels with negative, infinite or NaN values, which count as 0: "
        "{} of {}",
        reader_.path(), mended_, std::uint64_t(reader_.width()) * std::uint64_t(reader_.height())));
  }

 private:
  PictureReader& reader_;
  Progress& progress_;
  std::vector<glm::vec3> row_;
  std::uint64_t mended_ = 0;
};

}  // namespace

Result<EnvironmentMap> loadEnvironmentMap(const GatherEnvironment& environment,
                                          Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PictureReader> reader,
                           PictureReader::open(environment.path));
  MendedRows rows(*reader, progress);
  SURFEIT_ASSIGN_OR_RETURN(EnvironmentPicture picture,
                           environmentPicture(
                               reader->width(), reader->height(), reader->isCubeMap(),
                               [&] { return rows.next(); }, environment.path));
  rows.note();
  return EnvironmentMap::create(std::move(picture), environment, environment.path);
}

}  // namespace surfeit
