#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfEnvmapAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/exr/exr_header.h"
#include "cloud/exr/exr_stream.h"
#include "cloud/pictures/picture_reader.h"
#include "core/assert.h"

namespace surfeit {
namespace {

class ExrPicture final : public PictureReader {
 public:
  explicit ExrPicture(InputFile file) : PictureReader(file.path()), stream_(std::move(file)) {}

  Status open() {
    return guarded("header", [&] {
      SURFEIT_RETURN_IF_ERROR(checkHeader());
      stream_.seekg(0);
      // No threads of OpenEXR's own
      file_ = std::make_unique<Imf::InputFile>(stream_, 0);
      const Imath::Box2i window = file_->header().dataWindow();
      next_row_ = window.min.y;

      // All rows are read to the same place: their stride is 0
      row_.resize(std::size_t(width()));
      char* const first = reinterpret_cast<char*>(row_.data());
      char* const origin = first - std::ptrdiff_t(window.min.x) * std::ptrdiff_t(sizeof(glm::vec3));
      Imf::FrameBuffer buffer;
      const auto addChannel = [&](const char* name, std::size_t offset) {
        buffer.insert(name, Imf::Slice(Imf::FLOAT, origin + offset, sizeof(glm::vec3), 0));
      };
      addChannel(is_grey_ ? "Y" : "R", 0);
      if (!is_grey_) {
        addChannel("G", sizeof(float));
        addChannel("B", 2 * sizeof(float));
      }
      file_->setFrameBuffer(buffer);
      return Status();
    });
  }

  Status readRow(std::span<glm::vec3> row) override {
    SURFEIT_CHECK(row.size() == row_.size());
    const std::string place = fmt::format("row {}", next_row_ - file_->header().dataWindow().min.y);
    return guarded(place, [&] {
      file_->readPixels(next_row_);
      ++next_row_;
      std::copy(row_.begin(), row_.end(), row.begin());
      if (is_grey_) {
        for (glm::vec3& pixel : row) pixel = glm::vec3(pixel.x);
      }
      return Status();
    });
  }

 private:
  // OpenEXR allocates by what the header says, so the header is looked at first
  // (cloud/exr/exr_header.h).
  Status checkHeader() {
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<Imf::Header> headers, readExrHeaders(stream_));
    const Imf::Header& header = headers.front();
    if (isDeepExr(header)) {
      return Status::corruption(fmt::format("{}: deep pixels, expected flat ones", path()));
    }
    const Imath::Box2i window = header.dataWindow();
    SURFEIT_RETURN_IF_ERROR(setSize(std::int64_t(window.max.x) - window.min.x + 1,
                                    std::int64_t(window.max.y) - window.min.y + 1));
    SURFEIT_RETURN_IF_ERROR(checkChannels(header.channels()));
    is_cube_map_ = Imf::hasEnvmap(header) && Imf::envmap(header) == Imf::ENVMAP_CUBE;
    return checkExrBlocks(header, kMaxDecodedBytes, sizeof(glm::vec3), path());
  }

  Status checkChannels(const Imf::ChannelList& channels) {
    const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
    const bool is_color = has("R") && has("G") && has("B");
    is_grey_ = !is_color && has("Y") && !has("RY") && !has("BY");
    if (is_color || is_grey_) return {};

    std::string found;
    for (auto i = channels.begin(); i != channels.end() && found.size() < 100; ++i) {
      found += fmt::format("{}{}", found.empty() ? "" : " ", i.name());
    }
    return Status::corruption(fmt::format("{}: channels {}, expected R G B, or Y without RY BY",
                                          path(), found.empty() ? "none" : found));
  }

  // Runs what may throw. After a failure it is not run.
  template <typename Work>
  Status guarded(std::string_view place, const Work& work) {
    if (failure_.ok()) failure_ = guardExr(stream_, StatusCode::kCorruption, path(), place, work);
    return failure_;
  }

  ExrInputStream stream_;
  std::unique_ptr<Imf::InputFile> file_;
  std::vector<glm::vec3> row_;
  bool is_grey_ = false;
  int next_row_ = 0;
  Status failure_;
};

}  // namespace

Result<std::unique_ptr<PictureReader>> openExrPicture(InputFile file) {
  auto picture = std::make_unique<ExrPicture>(std::move(file));
  SURFEIT_RETURN_IF_ERROR(picture->open());
  return std::unique_ptr<PictureReader>(std::move(picture));
}

}  // namespace surfeit
