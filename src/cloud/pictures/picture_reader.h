// Pictures of light as files: OpenEXR and Radiance (.hdr), recognised by their first bytes. Row by
// row, so that a large picture needs little memory.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// Reads the rows of a picture, top row first. One thread at a time. Values are linear, as the file
// has them: they may be negative, infinite or NaN.
//
// OpenEXR: scan lines or tiles (the largest level), the first part, any type of pixel; channels R,
// G and B, or Y alone, which is grey; other channels are ignored, but not chroma (RY, BY). The
// picture is the data window. Radiance: RGBE, flat or run-length encoded, rows from the top left;
// values are divided by the EXPOSURE of the header, as its format asks.
class PictureReader {
 public:
  // Larger pictures are refused: 16,384 x 8,192 pixels, or as many in another shape.
  static constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 27;
  static constexpr int kMaxEdge = 1 << 15;
  // Decoding may take up to this; rows of OpenEXR that only decode together must fit.
  static constexpr std::uint64_t kMaxDecodedBytes = std::uint64_t{64} << 20;

  // kCorruption when the file is no picture, not as its format says or of a kind not listed above;
  // kInvalidArgument when it is too large.
  static Result<std::unique_ptr<PictureReader>> open(const std::string& path);
  virtual ~PictureReader() = default;

  const std::string& path() const { return path_; }
  int width() const { return width_; }
  int height() const { return height_; }
  // OpenEXR's cube map: six square faces below each other (its header ImfEnvmap.h).
  bool isCubeMap() const { return is_cube_map_; }

  // The next row; row.size() must be width(). Not after the last. After a failure, every call
  // fails.
  virtual Status readRow(std::span<glm::vec3> row) = 0;

 protected:
  explicit PictureReader(std::string path) : path_(std::move(path)) {}
  // Refuses sizes that are not positive or too large.
  Status setSize(std::int64_t width, std::int64_t height);

  bool is_cube_map_ = false;

 private:
  std::string path_;
  int width_ = 0, height_ = 0;
};

// The readers of the two formats; the file must begin as the format does.
Result<std::unique_ptr<PictureReader>> openExrPicture(InputFile file);
Result<std::unique_ptr<PictureReader>> openRgbePicture(InputFile file);

}  // namespace surfeit
