// Writes the OpenEXR pictures that tests read, of any kind OpenEXR has, and reads channels back.
#pragma once

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfTiledOutputPart.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace surfeit {

struct ExrTestChannel {
  std::vector<float> values;  // row by row; rounded to `type`
  Imf::PixelType type = Imf::FLOAT;
};

struct ExrTestPart {
  Imath::Box2i window{{0, 0}, {5, 3}};
  std::map<std::string, ExrTestChannel> channels;
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  int tile = 0;  // 0: scan lines
  Imf::LineOrder order = Imf::INCREASING_Y;
  std::string name, view;

  int width() const { return window.max.x - window.min.x + 1; }
  int height() const { return window.max.y - window.min.y + 1; }
  std::size_t pixelCount() const { return std::size_t(width()) * std::size_t(height()); }

  // A channel whose value is a function of the pixel, counted from the window's corner.
  template <typename Value>
  void add(const std::string& channel, Value value, Imf::PixelType type = Imf::FLOAT) {
    ExrTestChannel& added = channels[channel];
    added.type = type;
    for (int y = 0; y < height(); ++y) {
      for (int x = 0; x < width(); ++x) added.values.push_back(float(value(x, y)));
    }
  }
};

inline Imf::Header exrTestHeader(const ExrTestPart& part) {
  Imf::Header header(Imath::Box2i({-2, -3}, {40, 30}), part.window);
  header.compression() = part.compression;
  header.lineOrder() = part.order;
  header.setType(part.tile > 0 ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
  if (part.tile > 0) {
    header.setTileDescription(
        Imf::TileDescription(unsigned(part.tile), unsigned(part.tile), Imf::ONE_LEVEL));
  }
  if (!part.name.empty()) header.setName(part.name);
  if (!part.view.empty()) header.setView(part.view);
  for (const auto& [name, channel] : part.channels) {
    header.channels().insert(name, Imf::Channel(channel.type));
  }
  return header;
}

// `edit` may add attributes to the header of each part.
template <typename Edit>
void writeExrTest(const std::string& path, const std::vector<ExrTestPart>& parts, Edit edit) {
  std::vector<Imf::Header> headers;
  for (const ExrTestPart& part : parts) {
    headers.push_back(exrTestHeader(part));
    edit(headers.back());
  }
  Imf::MultiPartOutputFile file(path.c_str(), headers.data(), int(headers.size()), false, 0);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const ExrTestPart& part = parts[p];
    // The values in the file's types, each in memory of its own
    std::map<std::string, std::vector<char>> memory;
    Imf::FrameBuffer buffer;
    for (const auto& [name, channel] : part.channels) {
      const std::size_t size = channel.type == Imf::HALF ? 2 : 4;
      std::vector<char>& bytes = memory[name];
      bytes.resize(size * part.pixelCount());
      for (std::size_t i = 0; i < part.pixelCount(); ++i) {
        const float value = channel.values[i];
        char* const out = bytes.data() + size * i;
        if (channel.type == Imf::HALF) {
          *reinterpret_cast<Imath::half*>(out) = Imath::half(value);
        } else if (channel.type == Imf::UINT) {
          *reinterpret_cast<std::uint32_t*>(out) = std::uint32_t(value);
        } else {
          *reinterpret_cast<float*>(out) = value;
        }
      }
      buffer.insert(name, Imf::Slice::Make(channel.type, bytes.data(), part.window));
    }
    if (part.tile > 0) {
      Imf::TiledOutputPart out(file, int(p));
      out.setFrameBuffer(buffer);
      out.writeTiles(0, out.numXTiles() - 1, 0, out.numYTiles() - 1);
    } else {
      Imf::OutputPart out(file, int(p));
      out.setFrameBuffer(buffer);
      out.writePixels(part.height());
    }
  }
}

inline void writeExrTest(const std::string& path, const std::vector<ExrTestPart>& parts) {
  writeExrTest(path, parts, [](Imf::Header&) {});
}

// A channel of the only part as floats, row by row of its data window.
inline std::vector<float> readExrTest(const std::string& path, const std::string& channel) {
  Imf::InputFile file(path.c_str(), 0);
  const Imath::Box2i window = file.header().dataWindow();
  std::vector<float> values(std::size_t(window.max.x - window.min.x + 1) *
                            std::size_t(window.max.y - window.min.y + 1));
  Imf::FrameBuffer buffer;
  buffer.insert(channel, Imf::Slice::Make(Imf::FLOAT, values.data(), window));
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return values;
}

// The passes most tests use: positions and normals of a floor, without a mask.
inline ExrTestPart floorPasses(Imath::Box2i window = Imath::Box2i({0, 0}, {5, 3})) {
  ExrTestPart part;
  part.window = window;
  part.add("P.X", [](int x, int) { return 1 + x; });
  part.add("P.Y", [](int, int y) { return 10 + y; });
  part.add("P.Z", [](int x, int y) { return 100 + 16 * x + y; });
  part.add("N.X", [](int, int) { return 0; });
  part.add("N.Y", [](int, int) { return 1; });
  part.add("N.Z", [](int, int) { return 0; });
  return part;
}

}  // namespace surfeit
