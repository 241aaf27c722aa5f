#include "cloud/scans/las_crs.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <string_view>
#include <vector>

#include "cloud/rows/crs_units.h"
#include "cloud/scans/las_format.h"
#include "core/crs_comment.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

// Keys of GeoTIFF, and what a code says that has none
constexpr std::uint16_t kModelType = 1024, kCitation = 1026, kGeographic = 2048,
                        kGeographicCitation = 2049, kAngularUnit = 2054, kProjected = 3072,
                        kProjectedCitation = 3073, kProjectedUnit = 3076, kVertical = 4096,
                        kVerticalUnit = 4099, kUserDefined = 32767;
constexpr std::uint16_t kProjectedModel = 1, kGeographicModel = 2, kGeocentricModel = 3;
constexpr std::string_view kEpsg = "EPSG:";
constexpr std::uint16_t kDegrees = 9102, kDegreesToo = 9122;  // angles
constexpr std::size_t kMostData = 65535;                      // of a record before the points

// One line of printable text.
std::string lineOf(std::string_view text) {
  std::string line;
  for (const char c : text.substr(0, text.find('\0'))) {
    const bool is_blank = static_cast<unsigned char>(c) <= ' ' || c == '\x7f';
    if (is_blank && (line.empty() || line.back() == ' ')) continue;
    line += is_blank ? ' ' : c;
  }
  while (line.ends_with(' ')) line.pop_back();
  return line;
}

template <typename T>
std::optional<T> numberIn(std::string_view text) {
  T number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || (end != text.data() + text.size() && *end != ' ' && *end != '+')) {
    return {};
  }
  return number;
}

std::string_view wordOf(std::uint16_t model) {
  if (model == kGeographicModel) return kGeographicWord;
  return model == kGeocentricModel ? kGeocentricWord : std::string_view();
}

// What the keys of a system say that have one number each; 0: not said.
struct Keys {
  std::uint16_t model = 0, projected = 0, geographic = 0, angular_unit = 0, vertical = 0,
                vertical_unit = 0, unit = 0;

  std::uint16_t* find(std::uint16_t key) {
    switch (key) {
      case kModelType:
        return &model;
      case kProjected:
        return &projected;
      case kGeographic:
        return &geographic;
      case kAngularUnit:
        return &angular_unit;
      case kVertical:
        return &vertical;
      case kVerticalUnit:
        return &vertical_unit;
      case kProjectedUnit:
        return &unit;
      default:
        return nullptr;
    }
  }

  // Degrees have no projection. A system about the Earth's centre has its code where those have it.
  std::uint16_t kind() const {
    const bool says_kind = model >= kProjectedModel && model <= kGeocentricModel;
    if (says_kind && model != kGeographicModel) return model;
    if (geographic == kGeocentricCode) return kGeocentricModel;
    if (says_kind) return model;
    const bool says_angles = geographic != 0 || angular_unit != 0;
    return projected == 0 && unit == 0 && says_angles ? kGeographicModel : kProjectedModel;
  }
  std::uint16_t code() const {
    const std::uint16_t stated =
        kind() == kProjectedModel || geographic == 0 ? projected : geographic;
    return stated == kUserDefined ? std::uint16_t{0} : stated;
  }
};

// Whether x and y are angles other than degrees.
bool isOtherAngle(const Keys& keys) {
  return keys.kind() == kGeographicModel && keys.angular_unit != 0 &&
         keys.angular_unit != kDegrees && keys.angular_unit != kDegreesToo;
}

// As words behind the system, where they do not follow from its codes.
std::string unitsOf(const Keys& keys) {
  std::string text;
  if (keys.vertical_unit != 0) {
    text += fmt::format("{}{}", kVerticalUnitWords, keys.vertical_unit);
  }
  const double metres = crsUnitOfCode(keys.unit).metres;
  const CrsUnit usual = crsUnitOfProjected(keys.projected);
  const bool is_usual = usual.name.empty() ? metres == 1 : metres == usual.metres;
  if (keys.unit != 0 && keys.unit != kUserDefined && !is_usual) {
    text += fmt::format("{}{}", kUnitWords, keys.unit);
  }
  if (isOtherAngle(keys)) text += fmt::format("{}{}", kAngularUnitWords, keys.angular_unit);
  return text;
}

// The number behind `words`, where these end what stands before the first blank of `text`; else 0.
std::uint16_t numberBehind(std::string_view text, std::string_view words) {
  const std::size_t at = text.find(words);
  if (at == text.npos || at > text.find(' ')) return 0;
  return numberIn<std::uint16_t>(text.substr(at + words.size())).value_or(0);
}

// The words of the keys of "EPSG:2992+5703", "geographic EPSG:4326" and the like; none: of others.
std::vector<std::uint16_t> keysOf(std::string_view text) {
  const bool is_geographic = isGeographicCrs(text);
  bool is_geocentric = text.starts_with(kGeocentricWord);
  if (is_geocentric) text.remove_prefix(kGeocentricWord.size());
  if (text.starts_with(kGeographicWord)) text.remove_prefix(kGeographicWord.size());
  const std::uint16_t code = text.starts_with(kEpsg) ? numberBehind(text, kEpsg) : 0;
  if (code == 0) return {};
  is_geocentric = is_geocentric || code == kGeocentricCode;
  std::vector<std::uint16_t> words = {1, 1, 0, 0};
  const auto put = [&words](std::uint16_t key, std::uint16_t value) {
    if (value == 0) return;
    words.insert(words.end(), {key, 0, 1, value});
    ++words[3];
  };
  put(kModelType, is_geocentric   ? kGeocentricModel
                  : is_geographic ? kGeographicModel
                                  : kProjectedModel);
  put(is_geocentric || is_geographic ? kGeographic : kProjected, code);
  put(kAngularUnit, is_geographic ? angularUnitOf(text) : std::uint16_t{0});
  put(kVertical, numberBehind(text, "+"));
  put(kVerticalUnit, unitCodeIn(text, kVerticalUnitWords));
  put(kProjectedUnit, unitCodeIn(text, kUnitWords));
  return words;
}

}  // namespace

void LasCrs::add(std::uint16_t record_number, Bytes data) {
  const std::string_view text(reinterpret_cast<const char*>(data.data()), data.size());
  if (record_number == kLasWktRecord && text_.empty()) text_ = lineOf(text);
  if (record_number == kLasGeoTextRecord) key_text_ = text;
  if (record_number == kLasGeoKeysRecord && keys_.empty()) {
    keys_.resize(data.size() / sizeof(std::uint16_t));
    if (!keys_.empty()) std::memcpy(keys_.data(), data.data(), keys_.size() * sizeof(keys_[0]));
  }
}

std::vector<std::string> LasCrs::comments() const {
  std::vector<std::string> comments;
  if (!text_.empty()) comments.push_back(std::string(kCrsComment) + text_);
  if (std::string keys = keysComment(); !keys.empty()) {
    comments.push_back(std::string(kCrsComment) + keys);
  }
  return comments;
}

std::string LasCrs::keysComment() const {
  Keys said;
  std::string citation;
  // Four words each, behind four that tell of the version: key, where its value is, how many, value
  for (std::size_t at = 4; at + 4 <= keys_.size(); at += 4) {
    const std::uint16_t key = keys_[at], place = keys_[at + 1], count = keys_[at + 2],
                        value = keys_[at + 3];
    if (std::uint16_t* const number = said.find(key); number != nullptr && place == 0) {
      *number = value;
    }
    const bool is_citation = key == kProjectedCitation || (key == kCitation && citation.empty()) ||
                             (key == kGeographicCitation && citation.empty());
    if (is_citation && place == kLasGeoTextRecord && value < key_text_.size()) {
      citation = lineOf(std::string_view(key_text_).substr(value, count));
      while (citation.ends_with('|')) citation.pop_back();
    }
  }
  if (keys_.size() <= 4) return {};
  std::string text(wordOf(said.kind()));
  if (said.code() != 0) {
    text += fmt::format("{}{}", kEpsg, said.code());
    if (said.vertical != 0 && said.vertical != kUserDefined) {
      text += fmt::format("+{}", said.vertical);
    }
    text += unitsOf(said);
    if (!citation.empty()) text += " " + citation;
  } else {
    text += (citation.empty() ? "by GeoTIFF keys without a code" : citation) + unitsOf(said);
  }
  return text;
}

std::optional<LasCrsRecord> lasCrsRecord(std::span<const std::string> comments) {
  for (const std::string& comment : comments) {
    if (!comment.starts_with(kCrsComment)) continue;
    std::string_view text = std::string_view(comment).substr(kCrsComment.size());
    LasCrsRecord record;
    ByteWriter writer(record.data);
    if (text.find('[') != std::string_view::npos && text.size() < kMostData) {
      record.number = kLasWktRecord;
      writer.putBytes(std::as_bytes(std::span(text)));
      writer.put(std::uint8_t{0});
      return record;
    }
    const std::vector<std::uint16_t> keys = keysOf(text);
    if (keys.empty()) continue;
    record.number = kLasGeoKeysRecord;
    for (const std::uint16_t word : keys) writer.put(word);
    return record;
  }
  return {};
}

}  // namespace surfeit
