#include "cloud/exr/exr_reader.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "cloud/exr/exr_header.h"
#include "cloud/exr/exr_layout.h"
#include "cloud/exr/exr_positions.h"
#include "cloud/exr/exr_stream.h"
#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/counted_row_reader.h"

namespace surfeit {
namespace {

// What must be decoded at once may take this.
constexpr std::uint64_t kMaxBlockBytes = std::uint64_t{192} << 20;

class ExrReader final : public CountedRowReader {
 public:
  explicit ExrReader(InputFile file) : stream_(std::move(file)) {
    path_ = stream_.file().path();
    format_name_ = "OpenEXR";
  }

  Status open(const RowReaderOptions& options) {
    SURFEIT_ASSIGN_OR_RETURN(headers_, readExrHeaders(stream_));
    SURFEIT_RETURN_IF_ERROR(noteBytesBehind());
    SURFEIT_RETURN_IF_ERROR(choosePart(options));
    SURFEIT_RETURN_IF_ERROR(layOut(options));
    return guardExr(stream_, StatusCode::kCorruption, path_, "header", [&] {
      // No threads of OpenEXR's own; an offset table that was never completed is no table
      stream_.seekg(0);
      file_ = std::make_unique<Imf::MultiPartInputFile>(stream_, 0, false);
      for (const std::size_t part : parts_) {
        inputs_.push_back(std::make_unique<Imf::InputPart>(*file_, int(part)));
      }
      return countRows();
    });
  }

  const Imf::Header& header() const { return headers_[part_]; }

 protected:
  Status decodeRows(std::size_t count, std::byte* rows) override {
    while (count > 0) {
      if (next_pixel_ == pixels_.size()) {
        if (next_y_ > std::int64_t(header().dataWindow().max.y)) {
          return Status::corruption(
              fmt::format("{}: {} pixels with a position, expected {} as when it was opened", path_,
                          row(), element_.count));
        }
        SURFEIT_RETURN_IF_ERROR(readScanLine());
        continue;
      }
      const std::size_t run = std::min(count, pixels_.size() - next_pixel_);
      packRows(std::span(pixels_).subspan(next_pixel_, run), rows);
      next_pixel_ += run;
      rows += run * element_.row_bytes;
      count -= run;
    }
    return {};
  }

  Status moveTo(std::uint64_t) override {
    next_y_ = header().dataWindow().min.y;
    pixels_.clear();
    next_pixel_ = 0;
    stream_.clearStatus();
    return {};
  }

 private:
  // Flat channels of a part, under the names that decide what they are.
  std::vector<ExrSource> sourcesOf(std::size_t part, const RowReaderOptions& options) {
    std::vector<ExrSource> sources;
    if (isDeepExr(headers_[part])) return sources;
    const std::string layer = headers_.size() > 1 ? exrPartName(headers_[part]) : std::string();
    const Imf::ChannelList& channels = headers_[part].channels();
    for (auto i = channels.begin(); i != channels.end(); ++i) {
      if (i.channel().xSampling != 1 || i.channel().ySampling != 1) continue;
      sources.push_back({part, i.name(), exrLayerName(i.name(), layer, part == 0, options.channels),
                         i.channel().type == Imf::UINT, i.channel().type == Imf::HALF});
    }
    return sources;
  }

  Status noteBytesBehind() {
    return guardExr(stream_, StatusCode::kCorruption, path_, "offset tables", [&] {
      std::string note = noteOfBytesBehind(exrBytesBehind(stream_, headers_), "pixel");
      if (!note.empty()) notes_.push_back(std::move(note));
      return Status();
    });
  }

  // The part with the positions.
  Status choosePart(const RowReaderOptions& options) {
    std::size_t deep = 0;
    bool is_found = false;
    for (std::size_t i = 0; i < headers_.size() && !is_found; ++i) {
      const std::string name = exrPartName(headers_[i]);
      if (!options.part.empty() && name != options.part) continue;
      if (isDeepExr(headers_[i])) {
        ++deep;
        if (options.part.empty()) continue;
        break;
      }
      part_ = i;
      is_found = !options.part.empty() || hasExrPosition(sourcesOf(i, options), options.channels);
    }
    if (is_found) return {};
    if (deep > 0) {
      return Status::corruption(
          fmt::format("{}: {} deep, expected flat pixels with a position: flatten it first", path_,
                      deep == headers_.size() ? "all parts are" : "the part is"));
    }
    if (options.part.empty()) {
      part_ = 0;  // layOut tells which channels there are
      return {};
    }
    std::string names;
    for (const Imf::Header& header : headers_) {
      names += (names.empty() ? "" : ", ") + exrMessage(exrPartName(header));
    }
    return Status::invalidArgument(
        fmt::format("{}: no part \"{}\", expected one of: {}", path_, exrMessage(options.part),
                    names.empty() ? "(its only part has no name)" : names));
  }

  // Parts that add layers to the one with the positions.
  bool belongsToPicture(const Imf::Header& other) const {
    const auto view = [](const Imf::Header& h) { return h.hasView() ? h.view() : std::string(); };
    return !isDeepExr(other) && other.dataWindow() == header().dataWindow() &&
           view(other) == view(header());
  }

  Status layOut(const RowReaderOptions& options) {
    std::vector<ExrSource> sources = sourcesOf(part_, options);
    for (std::size_t i = 0; i < headers_.size(); ++i) {
      if (i == part_) continue;
      if (!options.part.empty() || !belongsToPicture(headers_[i])) {
        notes_.push_back(fmt::format("part {} is not read{}", exrMessage(exrPartName(headers_[i])),
                                     isDeepExr(headers_[i]) ? ": it is deep" : ""));
        continue;
      }
      const std::vector<ExrSource> more = sourcesOf(i, options);
      sources.insert(sources.end(), more.begin(), more.end());
    }
    const auto* const main_layer =
        header().findTypedAttribute<Imf::StringAttribute>(kExrMainLayerAttribute);
    SURFEIT_ASSIGN_OR_RETURN(
        layout_, layOutExr(sources, options.channels,
                           main_layer != nullptr ? main_layer->value() : std::string(), path_));
    element_ = layout_.element;
    notes_.insert(notes_.end(), layout_.notes.begin(), layout_.notes.end());

    for (const ExrColumn& column : layout_.columns) {
      const ExrSource& source = sources[column.source];
      auto part = std::find(parts_.begin(), parts_.end(), source.part);
      if (part == parts_.end()) {
        SURFEIT_RETURN_IF_ERROR(checkExrBlocks(headers_[source.part], kMaxBlockBytes, 0, path_));
        part = parts_.insert(part, source.part);
      }
      columns_.push_back(
          {std::size_t(part - parts_.begin()), source.channel, column.is_integer, {}});
    }
    return {};
  }

  // Counts the rows and looks at what they hold; decodes only what the mask needs.
  Status countRows() {
    const Imath::Box2i& window = header().dataWindow();
    std::vector<std::size_t> mask(layout_.position.begin(), layout_.position.end());
    if (layout_.normal) mask.insert(mask.end(), layout_.normal->begin(), layout_.normal->end());
    if (layout_.alpha) mask.push_back(*layout_.alpha);
    if (layout_.depth) mask.push_back(*layout_.depth);
    bindColumns(mask);
    SURFEIT_RETURN_IF_ERROR(moveTo(0));
    ExrPositions positions;
    while (next_y_ <= std::int64_t(window.max.y)) {
      SURFEIT_RETURN_IF_ERROR(decodeScanLine());
      positions.look(decodedLine());
    }
    element_.count = positions.count();
    edges_ = positions.edges();
    for (std::string& note : positions.notes(layout_.is_position_half)) {
      notes_.push_back(std::move(note));
    }

    std::vector<std::size_t> all(columns_.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    bindColumns(all);
    return moveTo(0);
  }

  // Has the parts decode these columns, every scan line to the same place: the stride of rows is 0.
  void bindColumns(const std::vector<std::size_t>& columns) {
    const Imath::Box2i& window = header().dataWindow();
    const std::size_t width = std::size_t(std::int64_t(window.max.x) - window.min.x + 1);
    std::vector<Imf::FrameBuffer> buffers(inputs_.size());
    for (const std::size_t i : columns) {
      Column& column = columns_[i];
      column.values.resize(width);
      // As an integer: the origin may lie outside of the memory
      const std::uintptr_t first = reinterpret_cast<std::uintptr_t>(column.values.data());
      char* const origin = reinterpret_cast<char*>(
          first - std::uintptr_t(std::int64_t(window.min.x) * std::int64_t(sizeof(float))));
      buffers[column.input].insert(
          column.channel,
          Imf::Slice(column.is_integer ? Imf::UINT : Imf::FLOAT, origin, sizeof(float), 0));
    }
    is_bound_.assign(inputs_.size(), false);
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      if (buffers[i].begin() == buffers[i].end()) continue;
      is_bound_[i] = true;
      inputs_[i]->setFrameBuffer(buffers[i]);
    }
  }

  // Decodes the scan line next_y_.
  Status decodeScanLine() {
    const int y = int(next_y_);
    return guardExr(stream_, StatusCode::kCorruption, path_, fmt::format("scan line {}", y), [&] {
      for (std::size_t i = 0; i < inputs_.size(); ++i) {
        if (is_bound_[i]) inputs_[i]->readPixels(y);
      }
      y_ = y;
      ++next_y_;
      return Status();
    });
  }

  // And finds its pixels with a position.
  Status readScanLine() {
    SURFEIT_RETURN_IF_ERROR(decodeScanLine());
    applyMask();
    next_pixel_ = 0;
    return {};
  }

  ExrScanLine decodedLine() {
    ExrScanLine line;
    const auto valuesOf = [&](std::size_t column) { return columns_[column].values.data(); };
    for (std::size_t i = 0; i < 3; ++i) {
      line.position[i] = valuesOf(layout_.position[i]);
      if (layout_.normal) line.normal[i] = valuesOf((*layout_.normal)[i]);
    }
    if (layout_.alpha) line.alpha = valuesOf(*layout_.alpha);
    if (layout_.depth) line.depth = valuesOf(*layout_.depth);
    line.width = columns_[layout_.position[0]].values.size();
    return line;
  }

  void applyMask() {
    const ExrScanLine line = decodedLine();
    pixels_.clear();
    for (std::size_t x = 0; x < line.width; ++x) {
      if (!line.isSet(x)) continue;
      if (line.isPartlyCovered(x)) {
        if (edges_ == ExrPositions::Edges::kLeaveOut) continue;
        if (edges_ == ExrPositions::Edges::kDivide) divideByAlpha(x);
      }
      pixels_.push_back(std::uint32_t(x));
    }
  }

  void divideByAlpha(std::size_t x) {
    const float alpha = columns_[*layout_.alpha].values[x];
    for (const std::size_t column : layout_.position) columns_[column].values[x] /= alpha;
    if (!layout_.normal) return;
    for (const std::size_t column : *layout_.normal) columns_[column].values[x] /= alpha;
  }

  // Property by property, so that the loops are tight.
  void packRows(std::span<const std::uint32_t> pixels, std::byte* rows) const {
    const std::size_t row_bytes = element_.row_bytes;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      if (!layout_.columns[c].property) continue;
      const float* const values = columns_[c].values.data();
      std::byte* out = rows + element_.properties[*layout_.columns[c].property].offset;
      for (const std::uint32_t x : pixels) {
        std::memcpy(out, values + x, sizeof(float));
        out += row_bytes;
      }
    }
    std::byte* out = rows + element_.properties[layout_.pixel].offset;
    const std::int32_t first_x = header().dataWindow().min.x;
    for (const std::uint32_t x : pixels) {
      const std::int32_t place[2] = {first_x + std::int32_t(x), y_};
      std::memcpy(out, place, sizeof(place));
      out += row_bytes;
    }
  }

  struct Column {
    std::size_t input = 0;
    std::string channel;
    bool is_integer = false;
    std::vector<float> values;  // of a scan line; the bits of integers
  };

  ExrInputStream stream_;
  std::vector<Imf::Header> headers_;
  std::size_t part_ = 0;  // with the positions
  ExrLayout layout_;
  ExrPositions::Edges edges_ = ExrPositions::Edges::kKeep;
  std::vector<Column> columns_;     // as layout_.columns
  std::vector<std::size_t> parts_;  // that columns come from
  std::unique_ptr<Imf::MultiPartInputFile> file_;
  std::vector<std::unique_ptr<Imf::InputPart>> inputs_;  // of parts_
  std::vector<bool> is_bound_;                           // whether columns of it are decoded now

  std::int64_t next_y_ = 0;
  std::int32_t y_ = 0;                 // the scan line that is decoded
  std::vector<std::uint32_t> pixels_;  // its pixels with a position
  std::size_t next_pixel_ = 0;
};

}  // namespace

bool recognisesExr(std::string_view first_bytes) {
  return first_bytes.starts_with("\x76\x2f\x31\x01");
}

Result<std::unique_ptr<RowReader>> openExr(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile file, InputFile::open(path));
  auto reader = std::make_unique<ExrReader>(std::move(file));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

const Imf::Header* exrHeaderOf(const RowReader* reader) {
  const auto* const exr =
      reader == nullptr ? nullptr : dynamic_cast<const ExrReader*>(&reader->file());
  return exr != nullptr ? &exr->header() : nullptr;
}

}  // namespace surfeit
