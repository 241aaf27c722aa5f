#include "cloud/edits/color_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/edits/color_sample.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/number_change.h"

namespace surfeit {
namespace {

// Linear light rarely has a mean so far above white, and codes of 8 bits mostly do.
constexpr double kSuspectMean = 16;
// As codes of 16 bits and of 8, smaller numbers are black to the eye.
constexpr double kDark = 4096, kDarkByte = 16;
// One number for a color: [ alpha : 8 | red : 8 | green : 8 | blue : 8 ].
constexpr std::string_view kPackedNames[] = {"rgb", "rgba"};

bool isPackedName(std::string_view name) {
  return std::find(std::begin(kPackedNames), std::end(kPackedNames), name) !=
         std::end(kPackedNames);
}

// Of the three codes.
std::vector<std::string> unpackedNames(const std::string& packed) {
  return propertyNames(isPackedName(packed) ? "color" : packed, 3, ChannelKind::kColor, {});
}

// The largest code of so many bits.
double whiteOf(int bits) { return double((1 << bits) - 1); }

class ColorReader final : public RowReader {
 public:
  ColorReader(std::unique_ptr<RowReader> reader, RowLayout element,
              std::vector<NumberChange> changes, std::vector<std::string> notes)
      : reader_(std::move(reader)),
        element_(std::move(element)),
        changes_(std::move(changes)),
        notes_(std::move(notes)) {}

  const std::string& path() const override { return reader_->path(); }
  std::string formatName() const override { return reader_->formatName(); }
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override { return reader_->comments(); }
  const RowReader& file() const override { return reader_->file(); }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = reader_->notes();
    notes.insert(notes.end(), notes_.begin(), notes_.end());
    return notes;
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    SURFEIT_ASSIGN_OR_RETURN(const Bytes view, reader_->readRows(max_rows, buffer));
    if (view.empty()) return view;
    const std::size_t row_bytes = element_.row_bytes, count = view.size() / row_bytes;
    std::byte* const rows = buffer.data() + (view.data() - buffer.data());
    for (const NumberChange& change : changes_) {
      const std::size_t done = changeNumbers(change, rows, count, row_bytes);
      if (done == count) continue;
      failure_ = misfit(change, rows + done * row_bytes, row_ + done);
      return failure_;
    }
    row_ += count;
    return view;
  }

  Status rewind() override {
    row_ = 0;
    failure_ = {};
    return reader_->rewind();
  }
  bool isSeekable() const override { return reader_->isSeekable(); }
  Status seekRow(std::uint64_t row) override {
    SURFEIT_RETURN_IF_ERROR(reader_->seekRow(row));
    row_ = row;
    failure_ = {};
    return {};
  }

 private:
  Status misfit(const NumberChange& change, const std::byte* row, std::uint64_t record) const {
    const RowProperty& property = change.property;
    return Status::corruption(fmt::format(
        "{}: record {}: found {} as {}, expected a whole number up to {}, as a sample of the cloud "
        "has: --color-range 8, 10, 12, 16 or unit says what colors are",
        path(), record, rowValue(row + property.offset, property.type), property.name,
        change.kind == NumberChange::Kind::kPackedNumber ? 4294967295.0 : change.white));
  }

  std::unique_ptr<RowReader> reader_;
  RowLayout element_;
  std::vector<NumberChange> changes_;
  std::vector<std::string> notes_;
  std::uint64_t row_ = 0;  // that comes next
  Status failure_;
};

// "floats", "ushort"
std::string_view typeText(ValueType type) {
  if (type == ValueType::kFloat32) return "floats";
  if (type == ValueType::kFloat64) return "doubles";
  return valueTypeName(type);
}

// Decides what the numbers of the colors of one reader become.
class ColorPlan {
 public:
  ColorPlan(const RowReader& reader, ColorRange range)
      : reader_(reader), range_(range), element_(reader.element()) {}

  // What needs a sample; none: all colors are plain.
  std::vector<ColorSample> findColors() const {
    std::vector<ColorSample> samples;
    const RowLayout& element = reader_.element();
    bool has_color = false;
    for (const RowChannel& channel : channelsOf(element)) {
      has_color = has_color || channel.name == "color";
      const bool is_triple = channel.properties.size() == 3;
      if ((is_triple && isUnsignedNormal(channel)) || isOpacity(channel)) {
        samples.push_back({channel.name, channel.properties, channel.type});
      }
      const bool is_color =
          is_triple && (channel.name == "color" || channel.name == "albedo" ||
                        (channel.name == "radiosity" && !isFloatType(channel.type)));
      if (!is_color || channel.type == ValueType::kUint8) continue;
      ColorSample sample{channel.name, channel.properties, channel.type};
      const bool is_real = isFloatType(channel.type);
      sample.is_decided = is_real ? range_ == ColorRange::kUnit : isCodeGiven();
      const RowProperty* const alpha = element.find("alpha");
      if (channel.name == "color" && alpha != nullptr && !alpha->is_list) sample.alpha = alpha;
      if (is_real && sample.is_decided) continue;
      samples.push_back(std::move(sample));
    }
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      if (!isPacked(element.properties[i], has_color)) continue;
      ColorSample sample{element.properties[i].name, {i}, element.properties[i].type};
      sample.is_decided = !isFloatType(sample.type);
      samples.push_back(std::move(sample));
      has_color = true;
    }
    return samples;
  }

  Status decide(const ColorSample& sample, bool is_whole) {
    sampled_ = is_whole ? "the largest is" : "the largest of a sample is";
    if (sample.isPacked()) {
      addPacked(sample);
      return {};
    }
    if (sample.isOpacity()) {
      decideOpacity(sample);
      return {};
    }
    if (sample.channel == "normal") {
      decideDirections(sample);
      return {};
    }
    if (isFloatType(sample.type)) {
      decideReals(sample);
      return {};
    }
    return decideIntegers(sample);
  }

  bool changes() const { return !changes_.empty() || !notes_.empty(); }

  std::unique_ptr<RowReader> apply(std::unique_ptr<RowReader> reader) {
    return std::make_unique<ColorReader>(std::move(reader), std::move(element_),
                                         std::move(changes_), std::move(notes_));
  }

 private:
  using Kind = NumberChange::Kind;

  // Bits of codes, where the user says them; else 0.
  int bitsGiven() const {
    switch (range_) {
      case ColorRange::k8:
        return 8;
      case ColorRange::k10:
        return 10;
      case ColorRange::k12:
        return 12;
      case ColorRange::k16:
        return 16;
      default:
        return 0;
    }
  }
  bool isCodeGiven() const { return bitsGiven() > 0; }

  static bool isOpacity(const RowChannel& channel) {
    return channel.name == kOpacity && channel.properties.size() != 2 &&
           channel.type != ValueType::kInt8;
  }
  static bool isUnsignedNormal(const RowChannel& channel) {
    return channel.name == "normal" &&
           (channel.type == ValueType::kUint8 || channel.type == ValueType::kUint16);
  }

  // Three values in one: rgb and rgba, where there is no other color; integers also as what the
  // user calls albedo or radiosity.
  bool isPacked(const RowProperty& property, bool has_color) const {
    if (property.is_list || valueTypeBytes(property.type) < 4) return false;
    const bool is_packed = isPackedName(property.name)
                               ? !has_color
                               : !isFloatType(property.type) &&
                                     (property.name == "albedo" || property.name == "radiosity");
    if (!is_packed) return false;
    const std::vector<std::string> names = unpackedNames(property.name);
    return std::none_of(names.begin(), names.end(), [&](const std::string& name) {
      return reader_.element().find(name) != nullptr;
    });
  }

  void add(const ColorSample& sample, Kind kind, double white = 255, bool takes_larger = false) {
    for (const std::size_t i : sample.properties) {
      RowProperty& property = element_.properties[i];
      if (property.type == ValueType::kUint8) continue;  // of a triple of several types
      changes_.push_back({kind, property, takes_larger, white});
      if (kind == Kind::kCode8 || valueTypeBytes(property.type) == 1)
        property.type = ValueType::kUint8;
      else if (kind == Kind::kCode16)
        property.type = ValueType::kUint16;
    }
  }

  // "colors are 0-255 in floats (the largest of a sample is 255): " and what follows.
  void note(const ColorSample& sample, std::string_view range, std::string_view what) {
    if (!sample.hasLight()) return;  // black either way
    const std::string name = sample.channel == "color" ? "colors" : sample.channel + " colors";
    notes_.push_back(fmt::format("{} are {} in {} ({} {}): {}", name, range, typeText(sample.type),
                                 sampled_, sample.largest, what));
  }

  void decideReals(const ColorSample& sample) {
    if (isCodeGiven()) {
      add(sample, Kind::kLight, whiteOf(bitsGiven()));
      notes_.push_back(
          fmt::format("{} in {} become scene-linear from sRGB of {} bits, as "
                      "--color-range says",
                      sample.channel, typeText(sample.type), bitsGiven()));
    } else if (sample.largest > 1 && sample.largest < kDarkByte && sample.areBytes()) {
      note(sample, "small whole numbers",
           "read as linear light; --color-range 8 reads them as sRGB of 8 bits");
    } else if (sample.largest > 1 && sample.areBytes()) {
      add(sample, sample.has_non_finite ? Kind::kLight : Kind::kCode8);
      note(sample, "0-255", "read as sRGB of 8 bits; --color-range unit reads them as linear");
    } else if (sample.largest > 255 && sample.are_wholes && sample.least >= 0) {
      note(sample, "whole numbers",
           "read as linear light; --color-range 16 reads them as sRGB of 16 bits");
    } else if (sample.largest <= 255.5 && sample.meanOfPositive() > kSuspectMean) {
      note(sample, fmt::format("{:.0f} on average", sample.meanOfPositive()),
           "read as linear light; --color-range 8 reads them as sRGB of 8 bits");
    }
  }

  // Directions cannot lie on one side of 0 alone.
  void decideDirections(const ColorSample& sample) {
    if (sample.largest <= 1) return;  // axes
    for (const std::size_t i : sample.properties) {
      RowProperty& property = element_.properties[i];
      const bool is_byte = property.type == ValueType::kUint8;
      if (!is_byte && property.type != ValueType::kUint16) continue;
      changes_.push_back({Kind::kDirection, property});
      property.type = is_byte ? ValueType::kInt8 : ValueType::kInt16;
    }
    notes_.push_back(fmt::format(
        "normals are {} ({} {}): read as directions whose 0 is at {}; --channels {} drops them",
        valueTypeName(sample.type), sampled_, sample.largest,
        sample.type == ValueType::kUint8 ? 128 : 32768, dropsOf(element_, "normal")));
  }

  // Integers are parts of the largest that their type holds, unless that leaves all but nothing.
  void decideOpacity(const ColorSample& sample) {
    const bool is_real = isFloatType(sample.type);
    if (!sample.areBytes() || sample.has_non_finite || sample.largest < 1) return;
    if (is_real ? sample.largest <= 1 : sample.type == ValueType::kUint8 && sample.largest > 1) {
      return;
    }
    const bool is_flag = sample.largest <= 1;
    for (const std::size_t i : sample.properties) {
      RowProperty& property = element_.properties[i];
      changes_.push_back({is_flag ? Kind::kFlag : Kind::kCode8, property});
      property.type = ValueType::kUint8;
    }
    notes_.push_back(fmt::format("opacity is 0-{} in {} ({} {}): {} is opaque", is_flag ? 1 : 255,
                                 typeText(sample.type), sampled_, sample.largest,
                                 is_flag ? 1 : 255));
  }

  Status decideIntegers(const ColorSample& sample) {
    const bool is_signed = sample.type == ValueType::kInt8 || sample.type == ValueType::kInt16;
    const bool are_16_bits =
        valueTypeBytes(sample.type) == 2 || (sample.least >= 0 && sample.largest <= 65535);
    if (isCodeGiven()) {
      decideGiven(sample);
    } else if (sample.type == ValueType::kInt8) {
      add(sample, Kind::kCode8);
      note(sample, "char", "read as sRGB of 8 bits, without a sign");
    } else if (sample.type == ValueType::kUint16 && sample.largest <= 0) {
      return {};  // black either way
    } else if (sample.least >= 0 && sample.largest <= 255) {
      add(sample, Kind::kCode8);
      note(sample, "0-255", "read as sRGB of 8 bits; --color-range 16 reads them as 16 bits");
    } else if (const int bits = bitsOfCamera(sample)) {
      add(sample, Kind::kCode16, whiteOf(bits));
      note(sample, fmt::format("0-{}", whiteOf(bits)),
           fmt::format("read as sRGB of {} bits; --color-range 16 reads them as 16 bits", bits));
    } else if (are_16_bits) {
      if (sample.type != ValueType::kUint16) add(sample, Kind::kCode16, 65535);
      if (sample.least >= 0 && sample.largest < kDark) {
        note(sample, "dark",
             "read as sRGB of 16 bits; --color-range 10 or 12 reads them as so many bits");
      } else if (sample.type != ValueType::kUint16) {
        note(sample, "above 255",
             is_signed ? "read as sRGB of 16 bits, without a sign" : "read as sRGB of 16 bits");
      }
    } else if (sample.positive > 0 || sample.least < 0) {
      const RowProperty& property = element_.properties[sample.properties[0]];
      return Status::corruption(fmt::format(
          "{}: found {} to {} in property {} of type {}, expected colors of 0 to 255 or 65535 "
          "(--channels {} reads no colors)",
          reader_.path(), sample.least, sample.largest, property.name, valueTypeName(property.type),
          dropsOf(element_, sample.channel)));
    }
    return {};
  }

  void decideGiven(const ColorSample& sample) {
    const int bits = bitsGiven();
    const double white = whiteOf(bits);
    if (bits == 16 && sample.type == ValueType::kUint16) return;
    add(sample, bits == 8 ? Kind::kCode8 : Kind::kCode16, white, true);
    notes_.push_back(fmt::format(
        "{} in {}: sRGB of {} bits, as --color-range says; what is above {} counts as that",
        sample.channel, valueTypeName(sample.type), bits, white));
  }

  // 10 or 12 where the largest code needs all of these bits, as of cameras that have no more; else
  // 0. As 16 bits such colors would be all but black.
  static int bitsOfCamera(const ColorSample& sample) {
    if (sample.least < 0 || sample.largest_alpha > whiteOf(12)) return 0;
    for (const int bits : {10, 12}) {
      if (sample.largest <= whiteOf(bits) && sample.largest > whiteOf(bits - 1)) return bits;
    }
    return 0;
  }

  // The properties of the color, in place of the one.
  void addPacked(const ColorSample& sample) {
    const std::size_t index = sample.properties[0];
    const RowProperty packed = element_.properties[index];
    const bool is_number = isFloatType(packed.type) && !sample.has_non_finite && sample.are_wholes;
    changes_.push_back({is_number ? Kind::kPackedNumber : Kind::kPackedBits, packed});
    std::vector<std::string> names = unpackedNames(packed.name);
    if (packed.name == kPackedNames[1] && element_.find("alpha") == nullptr) {
      names.emplace_back("alpha");
    }
    std::vector<RowProperty> codes;
    for (std::size_t i = 0; i < names.size(); ++i) {
      codes.push_back({names[i], ValueType::kUint8, false, ValueType::kUint8, packed.offset + i,
                       WideInteger::kNone, packed.typed});
    }
    const auto at = element_.properties.begin() + static_cast<std::ptrdiff_t>(index);
    element_.properties.insert(element_.properties.erase(at), codes.begin(), codes.end());
    notes_.push_back(fmt::format(
        "{} is a color packed into {} of type {}: read as{}", packed.name,
        is_number || !isFloatType(packed.type) ? "whole numbers" : "the bits of numbers",
        valueTypeName(packed.type), fmt::format(" {}", fmt::join(names, " "))));
    if (is_number && sample.digits.areLost()) {
      notes_.push_back(sample.digits.describe(packed.name, "write the color as whole numbers"));
    }
    if (is_number || sample.no_colors == 0) return;
    notes_.push_back(fmt::format(
        "{} is nan in {} of {} records looked at, which is no color and becomes black: texts lose "
        "the bits of colors with alpha 255 and red above 127; write the color as whole numbers",
        packed.name, sample.no_colors, sample.seen));
  }

  const RowReader& reader_;
  const ColorRange range_;
  RowLayout element_;
  std::vector<NumberChange> changes_;
  std::vector<std::string> notes_;
  std::string_view sampled_;
};

}  // namespace

Result<std::unique_ptr<RowReader>> readColors(std::unique_ptr<RowReader> reader, ColorRange range) {
  ColorPlan plan(*reader, range);
  std::vector<ColorSample> samples = plan.findColors();
  if (samples.empty()) return reader;
  bool is_whole = false;
  if (std::any_of(samples.begin(), samples.end(),
                  [](const ColorSample& sample) { return !sample.is_decided; })) {
    SURFEIT_ASSIGN_OR_RETURN(is_whole, sampleColors(*reader, samples));
  }
  // Packed ones last, and from the back: each puts more properties in its place
  std::stable_sort(samples.begin(), samples.end(), [](const ColorSample& a, const ColorSample& b) {
    if (a.isPacked() != b.isPacked()) return b.isPacked();
    return a.isPacked() && a.properties[0] > b.properties[0];
  });
  for (const ColorSample& sample : samples) SURFEIT_RETURN_IF_ERROR(plan.decide(sample, is_whole));
  if (!plan.changes()) return reader;
  return plan.apply(std::move(reader));
}

}  // namespace surfeit
