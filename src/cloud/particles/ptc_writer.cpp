#include "cloud/particles/ptc_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "cloud/particles/ptc_format.h"
#include "cloud/particles/ptc_reader.h"
#include "cloud/rows/channels.h"
#include "core/assert.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

constexpr std::size_t kBlockBytes = 256 << 10;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A channel of rows, read as floats.
struct Field {
  RowChannel channel;

  bool isPresent() const { return !channel.properties.empty(); }

  float value(const RowLayout& element, std::size_t component, const std::byte* row) const {
    const RowProperty& property = element.properties[channel.properties[component]];
    if (property.type != ValueType::kFloat32) {
      return static_cast<float>(channelValue(element, channel, component, row));
    }
    float value;
    std::memcpy(&value, row + property.offset, sizeof value);
    return value;
  }
};

// The name under which a variable is read back as these properties: RenderMan's begin with an
// underscore. Empty when there is none.
std::string variableName(const RowLayout& element, const RowChannel& channel) {
  const std::string names[] = {channel.name == "bent_normal" ? "_environmentdir" : "",
                               "_" + channel.name, channel.name};
  for (const std::string& name : names) {
    const std::vector<std::string> read =
        name.empty() ? std::vector<std::string>()
                     : propertyNames(name, channel.properties.size(), channel.kind, {});
    if (std::equal(read.begin(), read.end(), channel.properties.begin(), channel.properties.end(),
                   [&](const std::string& property, std::size_t i) {
                     return element.properties[i].name == property;
                   })) {
      return name;
    }
  }
  return {};
}

class PtcWriter : public RowWriter {
 public:
  static Result<std::unique_ptr<RowWriter>> create(const std::string& path,
                                                   const RowWriterOptions& options, int version) {
    SURFEIT_CHECK(version >= 0 && version <= kNewestPtcVersion);
    PtcHeader header;
    header.version = version;
    if (options.like) {
      if (const PtcCamera* camera = ptcCameraOf(*options.like)) header.camera = *camera;
    }
    RowLayout element;
    element.name = "vertex";
    element.properties = options.properties;
    packRow(element);

    auto writer = std::unique_ptr<PtcWriter>(new PtcWriter(std::move(element), std::move(header)));
    SURFEIT_RETURN_IF_ERROR(writer->assignChannels(path));
    SURFEIT_ASSIGN_OR_RETURN(ByteOutput output, ByteOutput::create(path, options.progress));
    SURFEIT_RETURN_IF_ERROR(output.append(formatPtcHeader(writer->header_)));
    writer->output_.emplace(std::move(output));
    return std::unique_ptr<RowWriter>(std::move(writer));
  }

  const RowLayout& element() const override { return element_; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = notes_;
    if (bad_normals_ > 0) {
      notes.push_back(
          fmt::format("{} normals that are not finite are written as zero", bad_normals_));
    }
    return notes;
  }

  Status writeRows(std::span<const std::byte> rows) override {
    if (is_finished_ || rows.size() % element_.row_bytes != 0) {
      return Status::invalidArgument(
          fmt::format("{}: {} bytes to write, expected whole rows of {} bytes before finish",
                      output_->path(), rows.size(), element_.row_bytes));
    }
    const std::size_t record_bytes = header_.recordBytes();
    const std::size_t block_rows = std::max<std::size_t>(1, kBlockBytes / record_bytes);
    records_.resize(block_rows * record_bytes);
    std::size_t used = 0;
    for (; !rows.empty(); rows = rows.subspan(element_.row_bytes)) {
      encode(rows.data(), &records_[used]);
      used += record_bytes;
      if (used < records_.size()) continue;
      SURFEIT_RETURN_IF_ERROR(output_->append(records_));
      used = 0;
    }
    return output_->append(Bytes(records_).first(used));
  }

  Status finish() override {
    if (is_finished_) {
      return Status::invalidArgument(fmt::format("{}: finished twice", output_->path()));
    }
    if (header_.bounds[0] > header_.bounds[3]) header_.bounds = {};  // no point is finite
    SURFEIT_RETURN_IF_ERROR(output_->writeAt(0, formatPtcHeader(header_)));
    SURFEIT_RETURN_IF_ERROR(output_->commit());
    is_finished_ = true;
    return {};
  }

 private:
  PtcWriter(RowLayout element, PtcHeader header)
      : element_(std::move(element)), header_(std::move(header)) {
    header_.bounds = {kInfinity, kInfinity, kInfinity, -kInfinity, -kInfinity, -kInfinity};
  }

  Status assignChannels(const std::string& path) {
    for (RowChannel& channel : channelsOf(element_)) {
      noteLoss(channel);
      const std::size_t components = channel.properties.size();
      if (channel.name == "position" && components == 3) {
        position_.channel = std::move(channel);
      } else if (channel.name == "normal" && components == 3) {
        normal_.channel = std::move(channel);
      } else if (components == 1 && !radius_.isPresent() &&
                 (channel.name == "radius" || channel.name == "pscale")) {
        radius_.channel = std::move(channel);
      } else {
        addVariable(std::move(channel));
      }
    }
    if (!position_.isPresent()) {
      return Status::invalidArgument(
          fmt::format("{}: no positions to write, expected properties x, y and z", path));
    }
    if (header_.variables.size() > kMaxPtcVariables) {
      return Status::invalidArgument(
          fmt::format("{}: {} channels besides the point, expected at "
                      "most {}",
                      path, header_.variables.size(), kMaxPtcVariables));
    }
    if (!radius_.isPresent() && !area_.isPresent() && !width_.isPresent()) {
      notes_.push_back("every point has a radius: 0, since there is none");
    }
    return {};
  }

  void addVariable(RowChannel channel) {
    if (channel.properties.size() == 1 && channel.name == "area") area_.channel = channel;
    if (channel.properties.size() == 1 && channel.name == "width") width_.channel = channel;
    const bool has_type = channel.properties.size() == 1 || channel.properties.size() == 3 ||
                          channel.properties.size() == 16;
    std::string name = has_type ? variableName(element_, channel) : std::string();
    if (!name.empty()) {
      header_.variables.push_back({std::move(name), channel.kind});
      variables_.push_back({std::move(channel)});
      return;
    }
    // What fits no type is written value by value
    for (const std::size_t property : channel.properties) {
      RowChannel single;
      single.name = element_.properties[property].name;
      single.properties = {property};
      single.type = element_.properties[property].type;
      header_.variables.push_back({single.name, ChannelKind::kFloat});
      variables_.push_back({std::move(single)});
    }
  }

  void noteLoss(const RowChannel& channel) {
    std::string names;
    for (const std::size_t i : channel.properties) names += " " + element_.properties[i].name;
    if (isCodedColor(channel)) {
      notes_.push_back(fmt::format("sRGB becomes scene-linear float:{}", names));
    } else if (channel.type == ValueType::kFloat64 || channel.type == ValueType::kInt32 ||
               channel.type == ValueType::kUint32) {
      notes_.push_back(fmt::format("{} becomes float:{}", valueTypeName(channel.type), names));
    }
  }

  float radiusOf(const std::byte* row) const {
    if (radius_.isPresent()) return radius_.value(element_, 0, row);
    if (width_.isPresent()) return width_.value(element_, 0, row) / 2;
    if (!area_.isPresent()) return 0;
    return std::sqrt(area_.value(element_, 0, row) / std::numbers::pi_v<float>);
  }

  void encode(const std::byte* row, std::byte* record) {
    // The point
    float position[3];
    for (std::size_t i = 0; i < 3; ++i) position[i] = position_.value(element_, i, row);
    growBounds(position);
    std::memcpy(record, position, sizeof position);
    const PtcNormal normal = normal_.isPresent() ? normalOf(row) : PtcNormal();
    const std::uint16_t code[2] = {normal.phi, normal.z};
    std::memcpy(record + 12, code, sizeof code);
    const float radius = radiusOf(row);
    std::memcpy(record + 16, &radius, sizeof radius);
    if (radius > header_.largest_radius && std::isfinite(radius)) header_.largest_radius = radius;

    // Its variables
    std::byte* next = record + kPtcPointBytes;
    for (const Field& variable : variables_) {
      for (std::size_t i = 0; i < variable.channel.properties.size(); ++i) {
        const float value = variable.value(element_, i, row);
        std::memcpy(next, &value, sizeof value);
        next += sizeof value;
      }
    }
    ++header_.count;
  }

  PtcNormal normalOf(const std::byte* row) {
    float normal[3];
    for (std::size_t i = 0; i < 3; ++i) normal[i] = normal_.value(element_, i, row);
    bad_normals_ += !std::isfinite(normal[0] + normal[1] + normal[2]);
    return encodePtcNormal(normal);
  }

  void growBounds(const float position[3]) {
    if (!std::isfinite(position[0] + position[1] + position[2])) return;
    for (std::size_t i = 0; i < 3; ++i) {
      header_.bounds[i] = std::min(header_.bounds[i], position[i]);
      header_.bounds[i + 3] = std::max(header_.bounds[i + 3], position[i]);
    }
  }

  RowLayout element_;
  PtcHeader header_;
  Field position_, normal_, radius_, area_, width_;
  std::vector<Field> variables_;  // those of the header
  std::vector<std::string> notes_;
  std::uint64_t bad_normals_ = 0;
  std::optional<ByteOutput> output_;
  std::vector<std::byte> records_;
  bool is_finished_ = false;
};

}  // namespace

Result<std::unique_ptr<RowWriter>> createPtcVersion(const std::string& path,
                                                    const RowWriterOptions& options, int version) {
  return PtcWriter::create(path, options, version);
}

Result<std::unique_ptr<RowWriter>> createPtc(const std::string& path,
                                             const RowWriterOptions& options) {
  return createPtcVersion(path, options, 0);
}

}  // namespace surfeit
