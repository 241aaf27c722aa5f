#include "io/surfel_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>

#include "io/file.h"
#include "io/ply_reader.h"
#include "io/ply_writer.h"

namespace surfeit {
namespace {

constexpr std::size_t kRowBufferBytes = 256 << 10;
constexpr double kMinNormalLength = 1e-6;

constexpr const char* kPositionNames[3] = {"x", "y", "z"};
constexpr const char* kNormalNames[3] = {"nx", "ny", "nz"};
constexpr const char* kRadiosityNames[3] = {"radiosity_r", "radiosity_g", "radiosity_b"};
constexpr const char* kAlbedoNames[3] = {"albedo_r", "albedo_g", "albedo_b"};
constexpr const char* kColorNames[3] = {"red", "green", "blue"};
constexpr const char* kElementNames[] = {"vertex", "point", "points", "surfel"};

// The transfer function of IEC 61966-2-1, from 0..1 to 0..1.
double linearFromSrgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

const std::array<double, 256>& linearFromSrgb8() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = linearFromSrgb(static_cast<double>(i) / 255);
    }
    return values;
  }();
  return table;
}

// Whether a float can hold the value; false for NaN too.
bool fitsFloat(double value) { return std::abs(value) <= std::numeric_limits<float>::max(); }

struct KindName {
  SurfelDefects::Kind SurfelDefects::*kind;
  const char* name;
};

constexpr KindName kKindNames[] = {
    {&SurfelDefects::non_finite, "a non-finite value"},
    {&SurfelDefects::bad_radius, "a radius that is not positive"},
    {&SurfelDefects::bad_area, "an area that is not positive"},
    {&SurfelDefects::short_normal, "a normal too short to point"},
    {&SurfelDefects::negative_color, "a negative radiosity or albedo"},
    {&SurfelDefects::out_of_range, "a value too large to calculate with"},
};

}  // namespace

Result<std::size_t> findSurfelElement(const PlyHeader& header, const std::string& path) {
  for (const char* name : kElementNames) {
    if (const std::optional<std::size_t> index = header.findElement(name)) return *index;
  }
  const std::vector<PlyElement>& elements = header.elements;
  return Status::corruption(fmt::format(
      "{}: found {} elements, first {}, expected one named vertex, point, points or surfel", path,
      elements.size(), elements.empty() ? "none" : elements.front().name));
}

std::uint64_t SurfelDefects::total() const {
  std::uint64_t sum = 0;
  for (const KindName& row : kKindNames) sum += (this->*row.kind).count;
  return sum;
}

std::string SurfelDefects::describe() const {
  std::string text;
  for (const KindName& row : kKindNames) {
    const Kind& kind = this->*row.kind;
    if (kind.count == 0) continue;
    text += fmt::format("{}{} record{} with {} (first: record {})", text.empty() ? "" : ", ",
                        kind.count, kind.count == 1 ? "" : "s", row.name, kind.first_record);
  }
  return text;
}

// The property of that name, absent when the element has none. `name` must outlive the mapping.
Result<SurfelMapping::Field> SurfelMapping::findField(const PlyElement& element, const char* name,
                                                      const std::string& path) {
  Field field;
  field.name = name;
  const PlyProperty* property = element.find(name);
  if (property == nullptr) return field;
  if (property->is_list) {
    return Status::corruption(fmt::format(
        "{}: element {}: property {} is a list, expected a scalar", path, element.name, name));
  }
  field.offset = static_cast<std::ptrdiff_t>(property->offset);
  field.type = property->type;
  return field;
}

// Finds all three properties or none, and says whether they are there. One or two of three are
// more likely a mistake than a cloud without that channel.
Result<bool> SurfelMapping::findTriple(const PlyElement& element, const char* const (&names)[3],
                                       const std::string& path, Field (&fields)[3]) {
  const char* missing = nullptr;
  const char* found = nullptr;
  for (int i = 0; i < 3; ++i) {
    SURFEIT_ASSIGN_OR_RETURN(fields[i], findField(element, names[i], path));
    (fields[i].isPresent() ? found : missing) = names[i];
  }
  if (found != nullptr && missing != nullptr) {
    return Status::corruption(fmt::format("{}: element {}: found property {} without {}", path,
                                          element.name, found, missing));
  }
  return found != nullptr;
}

Result<SurfelMapping> SurfelMapping::create(const PlyElement& element, const std::string& path) {
  SurfelMapping mapping;
  CloudChannels& channels = mapping.channels_;

  // Position and normal
  SURFEIT_ASSIGN_OR_RETURN(const bool has_position,
                           findTriple(element, kPositionNames, path, mapping.position_));
  if (!has_position) {
    return Status::corruption(
        fmt::format("{}: element {}: found no properties x, y, z", path, element.name));
  }
  SURFEIT_ASSIGN_OR_RETURN(channels.normal,
                           findTriple(element, kNormalNames, path, mapping.normal_));

  // Radius by the first of its names, area
  for (const char* name : {"radius", "pscale", "width"}) {
    SURFEIT_ASSIGN_OR_RETURN(mapping.radius_, findField(element, name, path));
    mapping.radius_scale_ = std::string_view(name) == "width" ? 0.5 : 1.0;
    channels.radius = mapping.radius_.isPresent();
    if (channels.radius) break;
  }
  SURFEIT_ASSIGN_OR_RETURN(mapping.area_, findField(element, "area", path));
  channels.area = mapping.area_.isPresent();

  // Radiosity and albedo; colors stand in for what is absent
  SURFEIT_ASSIGN_OR_RETURN(channels.radiosity,
                           findTriple(element, kRadiosityNames, path, mapping.radiosity_));
  SURFEIT_ASSIGN_OR_RETURN(channels.albedo,
                           findTriple(element, kAlbedoNames, path, mapping.albedo_));
  if (!channels.radiosity || !channels.albedo) {
    Field color[3];
    SURFEIT_ASSIGN_OR_RETURN(const bool has_color, findTriple(element, kColorNames, path, color));
    for (Field& field : color) {
      field.is_srgb = field.type == PlyType::kUint8 || field.type == PlyType::kUint16;
      if (!field.is_srgb && field.type != PlyType::kFloat32 && field.type != PlyType::kFloat64) {
        return Status::corruption(fmt::format(
            "{}: element {}: property {} is {}, expected uchar, ushort, float or double", path,
            element.name, field.name, plyTypeName(field.type)));
      }
    }
    if (has_color && !channels.radiosity) std::copy(color, color + 3, mapping.radiosity_);
    if (has_color && !channels.albedo) std::copy(color, color + 3, mapping.albedo_);
    channels.radiosity = channels.radiosity || has_color;
    channels.albedo = channels.albedo || has_color;
  }

  SURFEIT_ASSIGN_OR_RETURN(mapping.two_sided_, findField(element, "two_sided", path));
  channels.two_sided = mapping.two_sided_.isPresent();
  return mapping;
}

// The value as the surfel has it, not yet checked. The two types of nearly all clouds go first.
double SurfelMapping::Field::read(const std::byte* row) const {
  if (type == PlyType::kFloat32) {
    float value;
    std::memcpy(&value, row + offset, sizeof value);
    return value;
  }
  if (!is_srgb) return plyValue(row + offset, type);
  if (type == PlyType::kUint8) return linearFromSrgb8()[std::to_integer<std::size_t>(row[offset])];
  return linearFromSrgb(plyValue(row + offset, type) / 65535);
}

SurfelMapping::Defect SurfelMapping::decodeRow(const std::byte* row, Surfel& surfel) const {
  // Read all values, so that a value that is not finite goes before any other defect
  Defect defect;
  const auto read = [&](const Field& field) {
    if (!field.isPresent()) return 0.0;
    const double value = field.read(row);
    if (!fitsFloat(value) && defect.kind == nullptr) {
      defect = {&SurfelDefects::non_finite, field.name, value, "a number that a float can hold"};
    }
    return value;
  };
  double position[3], normal[3], radiosity[3], albedo[3];
  for (int i = 0; i < 3; ++i) {
    position[i] = read(position_[i]);
    normal[i] = read(normal_[i]);
    radiosity[i] = read(radiosity_[i]);
    albedo[i] = read(albedo_[i]);
  }
  const double radius = radius_scale_ * read(radius_);
  const double area = read(area_);
  const bool is_two_sided = read(two_sided_) != 0;
  if (defect.kind != nullptr) return defect;

  // Radius and area as floats: what is too small for a float is zero
  surfel = Surfel{};
  surfel.radius = static_cast<float>(radius);
  if (radius_.isPresent() && surfel.radius <= 0) {
    return {&SurfelDefects::bad_radius, radius_.name, radius_.read(row), "more than 0"};
  }
  surfel.area = static_cast<float>(area);
  if (area_.isPresent() && surfel.area <= 0) {
    return {&SurfelDefects::bad_area, area_.name, area, "more than 0"};
  }

  if (surfel.radius > kLargestLength) {
    return {&SurfelDefects::out_of_range, radius_.name, radius_.read(row), "at most 1e12"};
  }
  if (surfel.area > kLargestArea) {
    return {&SurfelDefects::out_of_range, area_.name, area, "at most 1e24"};
  }

  // The squares of floats fit doubles, so that the length is neither lost nor infinite
  const double length =
      std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  if (length >= kMinNormalLength) {
    for (int i = 0; i < 3; ++i) surfel.normal[i] = static_cast<float>(normal[i] / length);
  } else if (normal[0] == 0 && normal[1] == 0 && normal[2] == 0) {
    surfel.flags |= kSurfelSphere;
  } else {
    return {&SurfelDefects::short_normal, "length of nx, ny, nz", length, "0 or at least 1e-6"};
  }
  if (is_two_sided) surfel.flags |= kSurfelTwoSided;

  for (int i = 0; i < 3; ++i) {
    if (radiosity[i] < 0) {
      return {&SurfelDefects::negative_color, radiosity_[i].name, radiosity[i], "0 or more"};
    }
    if (albedo[i] < 0) {
      return {&SurfelDefects::negative_color, albedo_[i].name, albedo[i], "0 or more"};
    }
    if (std::abs(position[i]) > kLargestLength) {
      return {&SurfelDefects::out_of_range, position_[i].name, position[i], "at most 1e12"};
    }
    if (std::max(radiosity[i], albedo[i]) > kLargestColor) {
      return {&SurfelDefects::out_of_range, "color", std::max(radiosity[i], albedo[i]),
              "at most 1e12"};
    }
    surfel.position[i] = static_cast<float>(position[i]);
    surfel.radiosity[i] = static_cast<float>(radiosity[i]);
    surfel.albedo[i] = static_cast<float>(albedo[i]);
  }
  return {};
}

bool SurfelMapping::decode(const std::byte* row, std::uint64_t record, Surfel& surfel,
                           SurfelDefects& defects) const {
  const Defect defect = decodeRow(row, surfel);
  if (defect.kind == nullptr) return true;
  SurfelDefects::Kind& kind = defects.*defect.kind;
  if (kind.count == 0 || record < kind.first_record) kind.first_record = record;
  ++kind.count;
  return false;
}

std::string SurfelMapping::describeDefect(const std::byte* row) const {
  Surfel surfel;
  const Defect defect = decodeRow(row, surfel);
  if (defect.kind == nullptr) return {};
  return fmt::format("{} is {}, expected {}", defect.property, defect.value, defect.expected);
}

namespace {

class PlySurfelSource : public SurfelSource {
 public:
  PlySurfelSource(PlyReader reader, SurfelMapping mapping, std::size_t element_index, bool strict)
      : reader_(std::move(reader)),
        mapping_(std::move(mapping)),
        element_index_(element_index),
        is_strict_(strict) {
    // Whole rows, at least one and no more than there are
    const std::size_t row_bytes = element().row_bytes;
    const std::uint64_t row_count = std::clamp<std::uint64_t>(
        element().count, 1, std::max<std::size_t>(1, kRowBufferBytes / row_bytes));
    rows_.resize(static_cast<std::size_t>(row_count) * row_bytes);
  }

  const std::string& path() const override { return reader_.path(); }
  std::uint64_t recordCount() const override { return element().count; }
  CloudChannels channels() const override { return mapping_.channels(); }
  const SurfelDefects& defects() const override { return defects_; }

  Result<std::size_t> read(std::span<Surfel> surfels) override {
    const std::size_t row_bytes = element().row_bytes;
    std::size_t size = 0;
    while (size < surfels.size()) {
      // Fetch rows
      if (next_row_ == row_count_) {
        next_row_ = row_count_ = 0;
        SURFEIT_ASSIGN_OR_RETURN(row_count_, reader_.readRows(rows_));
        if (row_count_ == 0) break;
      }

      // Keep the valid records
      const std::byte* row = &rows_[next_row_ * row_bytes];
      const std::uint64_t record = record_++;
      ++next_row_;
      if (mapping_.decode(row, record, surfels[size], defects_)) {
        ++size;
      } else if (is_strict_) {
        return Status::corruption(
            fmt::format("{}: record {}: {}", path(), record, mapping_.describeDefect(row)));
      }
    }
    return size;
  }

  Status rewind() override {
    next_row_ = row_count_ = 0;
    record_ = 0;
    defects_ = {};
    return reader_.seekElement(element_index_);
  }

 private:
  const PlyElement& element() const { return reader_.header().elements[element_index_]; }

  PlyReader reader_;
  SurfelMapping mapping_;
  std::size_t element_index_;
  bool is_strict_;
  SurfelDefects defects_;
  std::uint64_t record_ = 0;  // number of the next record

  // Rows [next_row_, row_count_) of the buffer are still to be decoded
  std::vector<std::byte> rows_;
  std::size_t next_row_ = 0, row_count_ = 0;
};

Result<std::unique_ptr<SurfelSource>> openPly(const std::string& path, bool strict) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t index, findSurfelElement(reader.header(), path));
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping mapping,
                           SurfelMapping::create(reader.header().elements[index], path));
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(index));
  return std::unique_ptr<SurfelSource>(
      std::make_unique<PlySurfelSource>(std::move(reader), std::move(mapping), index, strict));
}

}  // namespace

Result<std::unique_ptr<SurfelSource>> openSurfelSource(const std::string& path, bool strict) {
  // Formats announce themselves by their first bytes
  std::array<std::byte, 4> magic{};
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(0, magic));
  const std::string_view text(reinterpret_cast<const char*>(magic.data()), size);
  if (text == "ply\n" || text == "ply\r") return openPly(path, strict);
  return Status::corruption(
      fmt::format("{}: found {} at 0, expected 'ply' (PLY is the format that is read)", path,
                  quotePlyText(text)));
}

struct SurfelWriter::State {
  PlyWriter file;
  CloudChannels channels;
  std::vector<std::byte> rows;
};

Result<SurfelWriter> SurfelWriter::create(const std::string& path, const CloudChannels& channels,
                                          PlyEncoding encoding, std::vector<std::string> comments) {
  // The order here is the order in which write packs the values
  std::vector<PlyProperty> properties;
  const auto add = [&](const char* name, PlyType type) {
    PlyProperty property;
    property.name = name;
    property.type = type;
    properties.push_back(std::move(property));
  };
  const auto addTriple = [&](const char* const(&names)[3]) {
    for (const char* name : names) add(name, PlyType::kFloat32);
  };
  addTriple(kPositionNames);
  if (channels.normal) addTriple(kNormalNames);
  if (channels.radius) add("radius", PlyType::kFloat32);
  if (channels.area) add("area", PlyType::kFloat32);
  if (channels.radiosity) addTriple(kRadiosityNames);
  if (channels.albedo) addTriple(kAlbedoNames);
  if (channels.two_sided) add("two_sided", PlyType::kUint8);

  SURFEIT_ASSIGN_OR_RETURN(PlyWriter file, PlyWriter::create(path, encoding, std::move(properties),
                                                             std::move(comments)));
  return SurfelWriter(std::make_unique<State>(State{std::move(file), channels, {}}));
}

SurfelWriter::SurfelWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SurfelWriter::SurfelWriter(SurfelWriter&&) noexcept = default;
SurfelWriter& SurfelWriter::operator=(SurfelWriter&&) noexcept = default;
SurfelWriter::~SurfelWriter() = default;

Status SurfelWriter::write(std::span<const Surfel> surfels) {
  const CloudChannels& channels = state_->channels;
  const std::size_t row_bytes = state_->file.element().row_bytes;
  state_->rows.resize(kRowBufferBytes / row_bytes * row_bytes);
  std::byte* const begin = state_->rows.data();
  std::byte* const end = begin + state_->rows.size();
  std::byte* next = begin;
  const auto put = [&](const auto& value) {
    std::memcpy(next, &value, sizeof value);
    next += sizeof value;
  };
  for (const Surfel& surfel : surfels) {
    put(surfel.position);
    if (channels.normal) put(surfel.normal);
    if (channels.radius) put(surfel.radius);
    if (channels.area) put(surfel.area);
    if (channels.radiosity) put(surfel.radiosity);
    if (channels.albedo) put(surfel.albedo);
    if (channels.two_sided) put(static_cast<std::uint8_t>(surfel.isTwoSided()));

    // Hand over a full buffer, and the last
    if (next == end || &surfel == &surfels.back()) {
      const std::size_t size = static_cast<std::size_t>(next - begin);
      SURFEIT_RETURN_IF_ERROR(state_->file.writeRows(std::span(state_->rows).first(size)));
      next = begin;
    }
  }
  return {};
}

Status SurfelWriter::finish() { return state_->file.finish(); }

}  // namespace surfeit
