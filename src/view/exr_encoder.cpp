#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <exception>

#include "view/picture_file.h"

namespace surfeit {
namespace {

// A file that OpenEXR writes into memory.
class MemoryStream final : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("memory") {}

  void write(const char bytes[], int count) override {
    const std::size_t end = position_ + std::size_t(count);
    if (end > bytes_.size()) bytes_.resize(end);
    std::memcpy(bytes_.data() + position_, bytes, std::size_t(count));
    position_ = end;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
  std::size_t position_ = 0;
};

// The nearest half float that is finite.
Imath::half halfFromFloat(float value) {
  return Imath::half(std::clamp(value, -65504.0f, 65504.0f));
}

struct ExrPixel {
  Imath::half r, g, b, a;
  float z;
};

}  // namespace

Result<std::vector<std::byte>> encodeExr(const Picture& picture) {
  std::vector<ExrPixel> pixels;
  pixels.reserve(picture.pixels.size());
  for (const Picture::Pixel& p : picture.pixels) {
    pixels.push_back({halfFromFloat(p.color.x), halfFromFloat(p.color.y), halfFromFloat(p.color.z),
                      halfFromFloat(p.alpha), p.depth});
  }

  try {
    Imf::Header header(picture.width, picture.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer buffer;
    const auto addChannel = [&](const char* name, Imf::PixelType type, void* first) {
      header.channels().insert(name, Imf::Channel(type));
      buffer.insert(name, Imf::Slice(type, static_cast<char*>(first), sizeof(ExrPixel),
                                     sizeof(ExrPixel) * std::size_t(picture.width)));
    };
    addChannel("R", Imf::HALF, &pixels[0].r);
    addChannel("G", Imf::HALF, &pixels[0].g);
    addChannel("B", Imf::HALF, &pixels[0].b);
    addChannel("A", Imf::HALF, &pixels[0].a);
    addChannel("Z", Imf::FLOAT, &pixels[0].z);

    // The file's offset table is completed when the output file goes
    MemoryStream stream;
    {
      Imf::OutputFile file(stream, header, 0);
      file.setFrameBuffer(buffer);
      file.writePixels(picture.height);
    }
    return stream.take();
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("OpenEXR: {}", error.what()));
  }
}

}  // namespace surfeit
