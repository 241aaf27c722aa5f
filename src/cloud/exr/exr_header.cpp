#include "cloud/exr/exr_header.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfCompression.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfVersion.h>
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace surfeit {
namespace {

constexpr std::size_t kMaxNameBytes = 255;

std::int32_t readInt(ExrInputStream& stream) {
  char bytes[4];
  stream.read(bytes, sizeof(bytes));
  std::uint32_t value = 0;
  for (int i = 0; i < 4; ++i) {
    value |= std::uint32_t(static_cast<unsigned char>(bytes[i])) << (8 * i);
  }
  return std::int32_t(value);
}

// Reads a text that ends with a zero byte. False when it is longer than any name.
bool readName(ExrInputStream& stream, std::string& name) {
  name.clear();
  while (true) {
    char c = 0;
    stream.read(&c, 1);
    if (c == 0) return true;
    if (name.size() == kMaxNameBytes) return false;
    name.push_back(c);
  }
}

// Types whose values have one size. OpenEXR reads so many bytes, whatever the header says, and
// takes what follows for the next attribute.
struct FixedType {
  std::string_view name;
  std::int32_t bytes;
};
constexpr FixedType kFixedTypes[] = {{"box2i", 16},      {"box2f", 16},    {"chromaticities", 32},
                                     {"compression", 1}, {"double", 8},    {"deepImageState", 1},
                                     {"envmap", 1},      {"float", 4},     {"int", 4},
                                     {"keycode", 28},    {"lineOrder", 1}, {"m33f", 36},
                                     {"m33d", 72},       {"m44f", 64},     {"m44d", 128},
                                     {"rational", 8},    {"tiledesc", 9},  {"timecode", 8},
                                     {"v2i", 8},         {"v2f", 8},       {"v2d", 16},
                                     {"v3i", 12},        {"v3f", 12},      {"v3d", 24}};

// Whether OpenEXR will read `size` bytes for a value of this type; the stream is at the value.
bool hasItsSize(ExrInputStream& stream, std::string_view type, std::int32_t size) {
  for (const FixedType& fixed : kFixedTypes) {
    if (fixed.name == type) return fixed.bytes == size;
  }
  const std::uint64_t end = stream.tellg() + std::uint64_t(size);
  if (type == "chlist") {
    // Names, each with 16 bytes behind it, up to an empty one
    constexpr std::uint64_t kChannelBytes = 16;
    std::string name;
    while (stream.tellg() < end && readName(stream, name)) {
      if (name.empty()) return stream.tellg() == end;
      stream.seekg(stream.tellg() + kChannelBytes);
    }
    return false;
  }
  if (type == "preview") {
    if (size < 8) return false;
    const auto width = std::uint32_t(readInt(stream)), height = std::uint32_t(readInt(stream));
    return width < (1u << 16) && height < (1u << 16) &&
           8 + 4 * std::uint64_t(width) * std::uint64_t(height) == std::uint64_t(size);
  }
  return true;
}

// Passes over the attributes of one header and counts them.
Status scanHeader(ExrInputStream& stream, std::uint64_t& attributes) {
  const InputFile& file = stream.file();
  std::string name, type;
  for (attributes = 0;; ++attributes) {
    const std::uint64_t offset = stream.tellg();
    const bool has_name = readName(stream, name);
    if (has_name && name.empty()) return {};
    if (!has_name || !readName(stream, type)) {
      return Status::corruption(
          fmt::format("{}: attribute at {}: a name of more than {} bytes, expected fewer",
                      file.path(), offset, kMaxNameBytes));
    }
    const std::int32_t size = readInt(stream);
    const std::uint64_t begin = stream.tellg();
    const std::uint64_t end = begin + std::uint64_t(std::max(size, 0));
    if (size < 0 || end > file.size() || end > kMaxExrHeaderBytes) {
      const std::uint64_t limit = std::min(file.size(), kMaxExrHeaderBytes);
      return Status::corruption(fmt::format("{}: attribute at {}: {} bytes, expected at most {}",
                                            file.path(), offset, size,
                                            limit - std::min(limit, begin)));
    }
    if (!hasItsSize(stream, type, size)) {
      return Status::corruption(
          fmt::format("{}: attribute at {}: {} bytes, expected the size of a value of type {}",
                      file.path(), offset, size, exrMessage(type)));
    }
    stream.seekg(end);
  }
}

struct WindowSize {
  std::uint64_t width = 0, height = 0;
};

WindowSize windowSize(const Imf::Header& header) {
  const Imath::Box2i& window = header.dataWindow();
  return {std::uint64_t(std::max<std::int64_t>(
              std::int64_t(window.max.x) - std::int64_t(window.min.x) + 1, 0)),
          std::uint64_t(std::max<std::int64_t>(
              std::int64_t(window.max.y) - std::int64_t(window.min.y) + 1, 0))};
}

// Bytes of a pixel, decoded; subsampled channels count by their part.
double pixelBytes(const Imf::Header& header) {
  double bytes = 0;
  for (auto i = header.channels().begin(); i != header.channels().end(); ++i) {
    const Imf::Channel& channel = i.channel();
    bytes += (channel.type == Imf::HALF ? 2.0 : 4.0) /
             (double(std::max(channel.xSampling, 1)) * double(std::max(channel.ySampling, 1)));
  }
  return bytes;
}

// No file decodes to more than so many times its size: the longest run of RLE is 128 bytes in 2,
// deflate makes 258 bytes of 2 bits, of which PXR24 keeps 3 in 4; B44A puts 32 bytes in 3. Runs of
// PIZ and DWA have no such bound; this is beyond what they are used for.
double maxRatio(Imf::Compression compression) {
  switch (compression) {
    case Imf::NO_COMPRESSION:
      return 1;
    case Imf::RLE_COMPRESSION:
      return 64;
    case Imf::ZIP_COMPRESSION:
    case Imf::ZIPS_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 1400;
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
      return 16;
    default:
      return 20000;
  }
}

// Tiled, flat or deep.
bool hasTiles(const Imf::Header& header) {
  return header.hasTileDescription() && header.hasType() && Imf::isTiled(header.type());
}

// Rows that are decoded together.
std::uint64_t blockRows(const Imf::Header& header) {
  if (hasTiles(header)) return std::max(header.tileDescription().ySize, 1u);
  switch (header.compression()) {
    case Imf::NO_COMPRESSION:
    case Imf::RLE_COMPRESSION:
    case Imf::ZIPS_COMPRESSION:
      return 1;
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 32;  // PIZ, B44, B44A, DWAA
  }
}

Status checkPart(const Imf::Header& header, const InputFile& file) {
  const auto [width, height] = windowSize(header);
  if (width == 0 || height == 0) {
    return Status::corruption(
        fmt::format("{}: {} x {} pixels, expected at least one", file.path(), width, height));
  }
  // Every block of rows and every tile has an offset of 8 bytes in the file
  double chunks = double(height) / double(blockRows(header));
  if (hasTiles(header)) {
    const Imf::TileDescription& tiles = header.tileDescription();
    if (tiles.xSize == 0 || tiles.ySize == 0) {
      return Status::corruption(fmt::format("{}: tiles of {} x {} pixels, expected at least one",
                                            file.path(), tiles.xSize, tiles.ySize));
    }
    chunks = double((width - 1) / tiles.xSize + 1) * double((height - 1) / tiles.ySize + 1);
  }
  if (header.hasChunkCount()) chunks = std::max(chunks, double(header.chunkCount()));
  if (8 * chunks > double(file.size())) {
    return Status::corruption(
        fmt::format("{}: {} x {} pixels need an offset table of {:.0f} bytes, found a file of {}",
                    file.path(), width, height, 8 * chunks, file.size()));
  }
  if (isDeepExr(header)) return {};

  const double decoded = double(width) * double(height) * pixelBytes(header);
  if (decoded > maxRatio(header.compression()) * double(file.size())) {
    return Status::corruption(
        fmt::format("{}: {} x {} pixels are {:.0f} bytes, which cannot come from a file of {}",
                    file.path(), width, height, decoded, file.size()));
  }
  return {};
}

// Sizes of the levels of tiles, from `size` down to 1.
std::vector<std::uint64_t> levelSizes(std::uint64_t size, std::uint64_t longest,
                                      const Imf::TileDescription& tiles) {
  std::vector<std::uint64_t> sizes;
  const bool rounds_up = tiles.roundingMode == Imf::ROUND_UP;
  const auto at = [rounds_up](std::uint64_t whole, unsigned level) {
    return std::max<std::uint64_t>(
        1, (whole + (rounds_up ? (std::uint64_t{1} << level) - 1 : 0)) >> level);
  };
  for (unsigned level = 0; level < 32; ++level) {
    sizes.push_back(at(size, level));
    if (at(longest, level) == 1) break;
  }
  return sizes;
}

}  // namespace

std::uint64_t exrChunkCount(const Imf::Header& header) {
  if (header.hasChunkCount()) return std::uint64_t(std::max(header.chunkCount(), 0));
  const auto [width, height] = windowSize(header);
  if (!hasTiles(header)) return (height + blockRows(header) - 1) / blockRows(header);
  const Imf::TileDescription& tiles = header.tileDescription();
  const auto chunksOf = [&tiles](std::uint64_t columns, std::uint64_t rows) {
    return ((columns - 1) / tiles.xSize + 1) * ((rows - 1) / tiles.ySize + 1);
  };
  if (tiles.mode == Imf::ONE_LEVEL) return chunksOf(width, height);
  const bool is_ripmap = tiles.mode == Imf::RIPMAP_LEVELS;
  const std::uint64_t longest = std::max(width, height);
  const std::vector<std::uint64_t> columns = levelSizes(width, is_ripmap ? width : longest, tiles);
  const std::vector<std::uint64_t> rows = levelSizes(height, is_ripmap ? height : longest, tiles);
  std::uint64_t chunks = 0;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    for (std::size_t k = is_ripmap ? 0 : i; k < (is_ripmap ? rows.size() : i + 1); ++k) {
      chunks += chunksOf(columns[i], rows[k]);
    }
  }
  return chunks;
}

bool isDeepExr(const Imf::Header& header) {
  return header.hasType() && Imf::isDeepData(header.type());
}

std::string exrPartName(const Imf::Header& header) {
  return header.hasName() ? header.name() : std::string();
}

Status checkExrBlocks(const Imf::Header& header, std::uint64_t most_bytes,
                      std::size_t tile_pixel_bytes, const std::string& path) {
  const auto [width, height] = windowSize(header);
  std::uint64_t columns = width, rows = blockRows(header);
  double pixel_bytes = pixelBytes(header);
  if (hasTiles(header)) {
    // OpenEXR holds whole tiles, however small the picture is
    columns = std::max<std::uint64_t>(width, header.tileDescription().xSize);
    pixel_bytes += double(tile_pixel_bytes);
  } else {
    rows = std::min(rows, height);
  }
  const double decoded = double(rows) * double(columns) * std::max(pixel_bytes, 4.0);
  if (decoded <= double(most_bytes)) return {};
  return Status::invalidArgument(
      fmt::format("{}: {} rows decode to {:.0f} bytes together, expected at most {}: save it in "
                  "scan lines or smaller tiles, with fewer channels",
                  path, rows, decoded, most_bytes));
}

Result<std::vector<Imf::Header>> readExrHeaders(ExrInputStream& stream) {
  const std::string& path = stream.file().path();
  std::vector<Imf::Header> headers;
  Status status = guardExr(stream, StatusCode::kCorruption, path, "header", [&] {
    stream.seekg(0);
    const std::int32_t magic = readInt(stream);
    if (magic != Imf::MAGIC) {
      return Status::corruption(fmt::format("{}: begins with {:08x}, expected {:08x} (OpenEXR)",
                                            path, std::uint32_t(magic), Imf::MAGIC));
    }
    const int version = readInt(stream);
    if (Imf::getVersion(version) != Imf::EXR_VERSION ||
        !Imf::supportsFlags(Imf::getFlags(version))) {
      return Status::corruption(
          fmt::format("{}: OpenEXR version {} with flags {:x}, expected version {}", path,
                      Imf::getVersion(version), Imf::getFlags(version), Imf::EXR_VERSION));
    }

    // Lengths first, values afterwards
    const std::uint64_t begin = stream.tellg();
    std::uint64_t attributes = 1;
    while (attributes > 0) {
      SURFEIT_RETURN_IF_ERROR(scanHeader(stream, attributes));
      if (!Imf::isMultiPart(version)) break;
    }
    stream.seekg(begin);
    while (true) {
      Imf::Header header;
      int header_version = version;
      header.readFrom(stream, header_version);
      if (Imf::isMultiPart(version) && header.readsNothing()) break;
      // Of a single part the flags decide; its type may be missing, or that of a file it came from
      if (!Imf::isMultiPart(version) && !Imf::isNonImage(version)) {
        header.setType(Imf::isTiled(version) ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
      } else if (!Imf::isMultiPart(version) && !isDeepExr(header)) {
        header.setType(Imf::DEEPSCANLINE);
      }
      SURFEIT_RETURN_IF_ERROR(checkPart(header, stream.file()));
      headers.push_back(header);
      if (!Imf::isMultiPart(version)) break;
    }
    return Status();
  });
  if (!status.ok()) return status;
  if (headers.empty()) {
    return Status::corruption(fmt::format("{}: no parts, expected at least one", path));
  }
  return headers;
}

}  // namespace surfeit
