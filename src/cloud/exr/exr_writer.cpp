#include "cloud/exr/exr_writer.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "cloud/exr/exr_image_writer.h"
#include "cloud/exr/exr_reader.h"
#include "cloud/rows/channels.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

constexpr std::string_view kMainLayers[] = {"irradiance", "environment", "reflection", "fluence",
                                            "radiosity"};

// What a channel of the picture is filled with.
struct Source {
  RowChannel channel;  // of the rows; without properties: 1 where there is a row
  std::size_t component = 0;
  float background = 0;
  ExrPixelType type = ExrPixelType::kFloat;
};

bool isUnsigned(ValueType type) {
  return type == ValueType::kUint8 || type == ValueType::kUint16 || type == ValueType::kUint32;
}

// What the ends of a channel's names are.
std::string componentName(const RowChannel& channel, std::size_t component) {
  constexpr const char* kColors[3] = {"R", "G", "B"};
  constexpr const char* kAxes[3] = {"X", "Y", "Z"};
  if (channel.properties.size() != 3) return fmt::format("{}", component);
  return channel.kind == ChannelKind::kColor ? kColors[component] : kAxes[component];
}

std::string exrName(const RowChannel& channel, std::size_t component) {
  if (channel.name == "alpha") return "A";
  if (channel.name == "depth") return "Z";
  if (channel.properties.size() == 1) return channel.name;
  const std::string end = componentName(channel, component);
  if (channel.name == "color") return end;
  const std::string layer = channel.name == "position" ? "P"
                            : channel.name == "normal" ? "N"
                                                       : channel.name;
  return fmt::format("{}.{}", layer, end);
}

class ExrWriter final : public RowWriter {
 public:
  ExrWriter(std::string path, const RowWriterOptions& options) : path_(std::move(path)) {
    element_.name = "vertex";
    for (RowProperty property : options.properties) {
      property.offset = element_.row_bytes;
      element_.row_bytes += valueTypeBytes(property.type);
      element_.properties.push_back(std::move(property));
    }
  }

  Status open(const Imf::Header& like) {
    pixel_x_ = element_.find("pixel_x");
    pixel_y_ = element_.find("pixel_y");
    if (pixel_x_ == nullptr || pixel_y_ == nullptr) {
      return Status::invalidArgument(fmt::format(
          "{}: rows without pixel_x and pixel_y have no place in a picture; they come from "
          "OpenEXR receivers: write another format",
          path_));
    }
    window_ = like.dataWindow();
    Imf::Header header = exrHeaderLike(like);
    std::vector<ExrImageChannel> channels = chooseChannels(like, header);
    SURFEIT_ASSIGN_OR_RETURN(image_, ExrImageWriter::create(path_, header, std::move(channels)));
    clearLine();
    return {};
  }

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }

  Status writeRows(std::span<const std::byte> rows) override {
    // Rows of one scan line at a time
    const std::size_t count = rows.size() / element_.row_bytes;
    for (std::size_t begin = 0; begin < count;) {
      const std::byte* const first = rows.data() + begin * element_.row_bytes;
      const double y = rowValue(first + pixel_y_->offset, pixel_y_->type);
      columns_.clear();
      SURFEIT_RETURN_IF_ERROR(moveToLine(first, y));
      while (begin + columns_.size() < count) {
        const std::byte* const row = first + columns_.size() * element_.row_bytes;
        if (rowValue(row + pixel_y_->offset, pixel_y_->type) != y) break;
        SURFEIT_RETURN_IF_ERROR(addPixel(row));
      }
      for (std::size_t i = 0; i < sources_.size(); ++i) fill(i, first);
      begin += columns_.size();
    }
    return {};
  }

  Status finish() override {
    SURFEIT_RETURN_IF_ERROR(writeLinesBefore(image_->height()));
    return image_->finish();
  }

 private:
  std::vector<ExrImageChannel> chooseChannels(const Imf::Header& like, Imf::Header& header) {
    std::vector<ExrImageChannel> channels;
    const std::vector<RowChannel> rows = channelsOf(element_);
    bool has_alpha = false;
    const RowChannel* main_layer = nullptr;
    bool has_color = false;
    for (const RowChannel& row : rows) {
      if (row.name == "pixel_x" || row.name == "pixel_y") continue;
      has_alpha = has_alpha || row.name == "alpha";
      has_color = has_color || (row.name == "color" && row.properties.size() == 3);
      for (std::size_t i = 0; i < row.properties.size(); ++i) {
        const std::string name = exrName(row, i);
        const float background =
            row.name == "depth" ? std::numeric_limits<float>::infinity() : 0.0f;
        const ExrPixelType type = typeOf(row, i, like.channels().findChannel(name));
        channels.push_back({name, type});
        sources_.push_back({row, i, background, type});
      }
    }
    if (!has_alpha) {
      channels.push_back({"A", ExrPixelType::kFloat});
      sources_.push_back({});
    }

    // R G B for programs that show nothing else
    for (const std::string_view name : kMainLayers) {
      const auto found = std::find_if(rows.begin(), rows.end(), [&](const RowChannel& row) {
        return row.name == name && row.properties.size() == 3;
      });
      if (found != rows.end() && main_layer == nullptr) main_layer = &*found;
    }
    if (has_color || main_layer == nullptr) return channels;
    header.insert(kExrMainLayerAttribute, Imf::StringAttribute(main_layer->name));
    for (std::size_t i = 0; i < 3; ++i) {
      channels.push_back({componentName(*main_layer, i), ExrPixelType::kHalf});
      sources_.push_back({*main_layer, i, 0, ExrPixelType::kHalf});
    }
    return channels;
  }

  ExrPixelType typeOf(const RowChannel& channel, std::size_t component,
                      const Imf::Channel* before) {
    const RowProperty& property = element_.properties[channel.properties[component]];
    if (before != nullptr && before->type == Imf::HALF) return ExrPixelType::kHalf;
    if (channel.kind != ChannelKind::kColor && isUnsigned(property.type)) {
      return ExrPixelType::kUint;
    }
    if (property.type == ValueType::kFloat64 || property.type == ValueType::kInt32) {
      notes_.push_back(
          fmt::format("{} becomes float32: {}", valueTypeName(property.type), property.name));
    }
    return ExrPixelType::kFloat;
  }

  // Makes `y` the line that is filled.
  Status moveToLine(const std::byte* row, double y) {
    if (!(y >= window_.min.y && y <= window_.max.y)) return refuse(row, "is outside of");
    const std::size_t line = std::size_t(y - window_.min.y);
    if (line < line_) return refuse(row, "comes too late in");
    return writeLinesBefore(line);
  }

  Status writeLinesBefore(std::size_t line) {
    while (line_ < line) {
      SURFEIT_RETURN_IF_ERROR(image_->writeLine());
      ++line_;
      clearLine();
    }
    return {};
  }

  void clearLine() {
    next_x_ = 0;
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      std::ranges::fill(image_->floats(i), sources_[i].background);
    }
  }

  Status addPixel(const std::byte* row) {
    const double x = rowValue(row + pixel_x_->offset, pixel_x_->type);
    if (!(x >= window_.min.x && x <= window_.max.x)) return refuse(row, "is outside of");
    const std::size_t column = std::size_t(x - window_.min.x);
    if (column < next_x_) return refuse(row, "comes too late in");
    next_x_ = column + 1;
    columns_.push_back(column);
    return {};
  }

  // Writes a channel's values of consecutive rows to the pixels `columns_`.
  void fill(std::size_t channel, const std::byte* row) {
    const Source& source = sources_[channel];
    const std::span<float> out = image_->floats(channel);
    if (source.channel.properties.empty()) {
      for (const std::size_t x : columns_) out[x] = 1;
      return;
    }
    const RowProperty& property = element_.properties[source.channel.properties[source.component]];
    const std::byte* value = row + property.offset;
    if (property.type == ValueType::kFloat32) {  // nearly always
      for (const std::size_t x : columns_) {
        std::memcpy(&out[x], value, sizeof(float));
        value += element_.row_bytes;
      }
    } else if (source.type == ExrPixelType::kUint) {
      const std::span<std::uint32_t> integers = image_->integers(channel);
      for (const std::size_t x : columns_) {
        integers[x] = std::uint32_t(rowValue(value, property.type));
        value += element_.row_bytes;
      }
    } else {
      for (const std::size_t x : columns_) {
        out[x] = float(channelValue(element_, source.channel, source.component, row));
        row += element_.row_bytes;
      }
    }
  }

  Status refuse(const std::byte* row, const char* what) const {
    return Status::invalidArgument(fmt::format(
        "{}: pixel {} {} {} the data window {} {} to {} {}, expected the receivers' pixels in scan "
        "line order",
        path_, rowValue(row + pixel_x_->offset, pixel_x_->type),
        rowValue(row + pixel_y_->offset, pixel_y_->type), what, window_.min.x, window_.min.y,
        window_.max.x, window_.max.y));
  }

  std::string path_;
  RowLayout element_;
  std::vector<std::string> notes_;
  const RowProperty* pixel_x_ = nullptr;
  const RowProperty* pixel_y_ = nullptr;
  Imath::Box2i window_;
  std::vector<Source> sources_;  // of the picture's channels
  std::unique_ptr<ExrImageWriter> image_;
  std::size_t line_ = 0;              // that is filled, from the top
  std::size_t next_x_ = 0;            // first column that the line may still get
  std::vector<std::size_t> columns_;  // of the rows that are being written
};

}  // namespace

Result<std::unique_ptr<RowWriter>> createExr(const std::string& path,
                                             const RowWriterOptions& options) {
  if (withoutCompression(path).size() != path.size()) {
    return Status::invalidArgument(
        fmt::format("{}: OpenEXR is compressed inside, expected a name that ends with .exr", path));
  }
  const Imf::Header* const like = exrHeaderOf(options.like);
  if (like == nullptr) {
    return Status::invalidArgument(
        fmt::format("{}: a picture needs the windows of one: write .exr from OpenEXR receivers, by "
                    "`surfeit convert` with --like PICTURE.exr, or write .ply instead",
                    path));
  }
  auto writer = std::make_unique<ExrWriter>(path, options);
  SURFEIT_RETURN_IF_ERROR(writer->open(*like));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
