#include "cloud/exr/exr_image_writer.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

#include "cloud/exr/exr_reader.h"
#include "cloud/exr/exr_stream.h"
#include "core/assert.h"

namespace surfeit {
namespace {

constexpr float kMaxHalf = 65504;

// Attributes of how a part was stored, which do not hold for another file.
constexpr std::string_view kStorageAttributes[] = {"channels",
                                                   "chunkCount",
                                                   "compression",
                                                   "dataWindow",
                                                   "deepImageState",
                                                   "displayWindow",
                                                   "dwaCompressionLevel",
                                                   "idManifest",
                                                   "lineOrder",
                                                   kExrMainLayerAttribute,
                                                   "maxSamplesPerPixel",
                                                   "name",
                                                   "pixelAspectRatio",
                                                   "preview",
                                                   "screenWindowCenter",
                                                   "screenWindowWidth",
                                                   "tiles",
                                                   "type",
                                                   "version"};

Imf::PixelType imfType(ExrPixelType type) {
  switch (type) {
    case ExrPixelType::kHalf:
      return Imf::HALF;
    case ExrPixelType::kUint:
      return Imf::UINT;
    case ExrPixelType::kFloat:
      break;
  }
  return Imf::FLOAT;
}

Imath::half halfFromFloat(float value) {
  return Imath::half(std::isfinite(value) ? std::clamp(value, -kMaxHalf, kMaxHalf) : value);
}

class ImageWriter final : public ExrImageWriter {
 public:
  explicit ImageWriter(AtomicFile file) : path_(file.path()), stream_(std::move(file)) {}

  ~ImageWriter() override {
    // Completes the offset table of a file that nobody will see
    file_.reset();
  }

  Status open(Imf::Header header, std::vector<ExrImageChannel> channels) {
    const Imath::Box2i& window = header.dataWindow();
    width_ = std::size_t(std::int64_t(window.max.x) - window.min.x + 1);
    height_ = std::size_t(std::int64_t(window.max.y) - window.min.y + 1);
    header.channels() = Imf::ChannelList();
    header.compression() = Imf::ZIP_COMPRESSION;
    header.lineOrder() = Imf::INCREASING_Y;
    for (ExrImageChannel& channel : channels) {
      if (channel.name.empty() || header.channels().findChannel(channel.name) != nullptr) {
        return Status::invalidArgument(
            fmt::format("{}: channel \"{}\": expected names that differ", path_, channel.name));
      }
      header.channels().insert(channel.name, Imf::Channel(imfType(channel.type)));
      channels_.push_back({std::move(channel), std::vector<float>(width_), {}});
      if (channels_.back().channel.type == ExrPixelType::kHalf) {
        channels_.back().halves.resize(width_);
      }
    }
    return guard([&] {
      file_ = std::make_unique<Imf::OutputFile>(stream_, header, 0);
      Imf::FrameBuffer buffer;
      for (Column& column : channels_) {
        const bool is_half = column.channel.type == ExrPixelType::kHalf;
        const std::size_t size = is_half ? sizeof(Imath::half) : sizeof(float);
        // As an integer: the origin may lie outside of the memory
        const auto first = is_half ? reinterpret_cast<std::uintptr_t>(column.halves.data())
                                   : reinterpret_cast<std::uintptr_t>(column.values.data());
        char* const origin = reinterpret_cast<char*>(
            first - std::uintptr_t(std::int64_t(window.min.x) * std::int64_t(size)));
        // Every scan line comes from the same place: the stride of rows is 0
        buffer.insert(column.channel.name,
                      Imf::Slice(imfType(column.channel.type), origin, size, 0));
      }
      file_->setFrameBuffer(buffer);
      return Status();
    });
  }

  std::size_t width() const override { return width_; }
  std::size_t height() const override { return height_; }

  std::span<float> floats(std::size_t channel) override { return channels_[channel].values; }
  std::span<std::uint32_t> integers(std::size_t channel) override {
    SURFEIT_CHECK(channels_[channel].channel.type == ExrPixelType::kUint);
    static_assert(sizeof(std::uint32_t) == sizeof(float));
    return {reinterpret_cast<std::uint32_t*>(channels_[channel].values.data()), width_};
  }

  Status writeLine() override {
    SURFEIT_CHECK(line_ < height_);
    for (Column& column : channels_) {
      std::transform(column.values.begin(),
                     column.values.begin() + std::ptrdiff_t(column.halves.size()),
                     column.halves.begin(), halfFromFloat);
    }
    ++line_;
    return guard([&] {
      file_->writePixels(1);
      return Status();
    });
  }

  Status finish() override {
    SURFEIT_CHECK(line_ == height_);
    SURFEIT_RETURN_IF_ERROR(failure_);
    // The offset table is completed when the output file goes, which tells its failures to nobody
    // but the stream
    file_.reset();
    return stream_.commit();
  }

 private:
  struct Column {
    ExrImageChannel channel;
    std::vector<float> values;  // the bits of kUint
    std::vector<Imath::half> halves;
  };

  template <typename Work>
  Status guard(const Work& work) {
    if (failure_.ok()) failure_ = guardExr(stream_, StatusCode::kFailed, path_, "writing", work);
    return failure_;
  }

  std::string path_;
  ExrOutputStream stream_;
  std::unique_ptr<Imf::OutputFile> file_;
  std::vector<Column> channels_;
  std::size_t width_ = 0, height_ = 0, line_ = 0;
  Status failure_;
};

}  // namespace

Imf::Header exrHeaderLike(const Imf::Header& part) {
  Imf::Header header(part.displayWindow(), part.dataWindow(), part.pixelAspectRatio(),
                     part.screenWindowCenter(), part.screenWindowWidth());
  for (auto i = part.begin(); i != part.end(); ++i) {
    const bool is_storage = std::find(std::begin(kStorageAttributes), std::end(kStorageAttributes),
                                      std::string_view(i.name())) != std::end(kStorageAttributes);
    // What is not wanted must not come in: Imf::Header::erase leaks it
    if (!is_storage) header.insert(i.name(), i.attribute());
  }
  return header;
}

Result<std::unique_ptr<ExrImageWriter>> ExrImageWriter::create(
    const std::string& path, const Imf::Header& header, std::vector<ExrImageChannel> channels) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  auto writer = std::make_unique<ImageWriter>(std::move(file));
  SURFEIT_RETURN_IF_ERROR(writer->open(header, std::move(channels)));
  return std::unique_ptr<ExrImageWriter>(std::move(writer));
}

}  // namespace surfeit
