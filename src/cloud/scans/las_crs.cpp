#include "cloud/scans/las_crs.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <string_view>

#include "cloud/scans/las_format.h"
#include "core/crs_comment.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

// Keys of GeoTIFF, and what a code says that has none
constexpr std::uint16_t kModelType = 1024, kCitation = 1026, kGeographic = 2048,
                        kGeographicCitation = 2049, kProjected = 3072, kProjectedCitation = 3073,
                        kVertical = 4096, kUserDefined = 32767;
constexpr std::uint16_t kProjectedModel = 1, kGeographicModel = 2;
constexpr std::string_view kEpsg = "EPSG:", kGeographicEpsg = "geographic EPSG:";
constexpr std::size_t kMostData = 65535;  // of a record before the points

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
  std::uint16_t projected = 0, geographic = 0, vertical = 0;
  std::string citation;
  // Four words each, behind four that tell of the version: key, where its value is, how many, value
  for (std::size_t at = 4; at + 4 <= keys_.size(); at += 4) {
    const std::uint16_t key = keys_[at], place = keys_[at + 1], count = keys_[at + 2],
                        value = keys_[at + 3];
    if (key == kProjected && place == 0) projected = value;
    if (key == kGeographic && place == 0) geographic = value;
    if (key == kVertical && place == 0) vertical = value;
    const bool is_citation = key == kProjectedCitation || (key == kCitation && citation.empty()) ||
                             (key == kGeographicCitation && citation.empty());
    if (is_citation && place == kLasGeoTextRecord && value < key_text_.size()) {
      citation = lineOf(std::string_view(key_text_).substr(value, count));
      while (citation.ends_with('|')) citation.pop_back();
    }
  }
  std::string text;
  if (projected != 0 && projected != kUserDefined) {
    text = fmt::format("{}{}", kEpsg, projected);
  } else if (projected == 0 && geographic != 0 && geographic != kUserDefined) {
    text = fmt::format("{}{}", kGeographicEpsg, geographic);
  }
  if (!text.empty() && vertical != 0 && vertical != kUserDefined) {
    text += fmt::format("+{}", vertical);
  }
  if (!citation.empty()) text += (text.empty() ? "" : " ") + citation;
  if (text.empty() && keys_.size() > 4) text = "by GeoTIFF keys without a code";
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
    const bool is_geographic = text.starts_with(kGeographicEpsg);
    if (!is_geographic && !text.starts_with(kEpsg)) continue;
    text.remove_prefix(is_geographic ? kGeographicEpsg.size() : kEpsg.size());
    const std::optional<std::uint16_t> code = numberIn<std::uint16_t>(text);
    if (!code) continue;
    const std::size_t plus = text.find('+');
    const std::optional<std::uint16_t> vertical =
        plus < text.find(' ') ? numberIn<std::uint16_t>(text.substr(plus + 1)) : std::nullopt;
    record.number = kLasGeoKeysRecord;
    const auto putKey = [&writer](std::uint16_t key, std::uint16_t value) {
      for (const std::uint16_t word : {key, std::uint16_t{0}, std::uint16_t{1}, value}) {
        writer.put(word);
      }
    };
    for (const int word : {1, 1, 0, vertical ? 3 : 2}) {
      writer.put(static_cast<std::uint16_t>(word));
    }
    putKey(kModelType, is_geographic ? kGeographicModel : kProjectedModel);
    putKey(is_geographic ? kGeographic : kProjected, *code);
    if (vertical) putKey(kVertical, *vertical);
    return record;
  }
  return {};
}

}  // namespace surfeit
