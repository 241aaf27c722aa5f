// LAS files that tests make byte by byte, and what stands in those that are written: by offsets of
// the specification, without any code of ours.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace surfeit {

inline constexpr std::size_t kLasRecordSizes[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
inline constexpr std::size_t kLasColorAt[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

template <typename T>
inline void putLas(std::string& text, std::size_t at, T value) {
  std::memcpy(&text[at], &value, sizeof value);
}

// A file of `count` points: point i is at (i, -2 i, 3) of its grid, intensity i, class i mod 32.
inline std::string makeLas(unsigned minor, unsigned format, std::uint32_t count,
                           std::size_t extra = 0) {
  const std::size_t header = minor < 4 ? 227 : minor < 5 ? 375 : 393;
  const std::size_t record = kLasRecordSizes[format] + extra;
  std::string text(header + count * record, '\0');
  text.replace(0, 4, "LASF");
  putLas(text, 24, char(1));
  putLas(text, 25, char(minor));
  putLas(text, 94, std::uint16_t(header));
  putLas(text, 96, std::uint32_t(header));
  putLas(text, 104, char(format));
  putLas(text, 105, std::uint16_t(record));
  if (format <= 5) putLas(text, 107, count);
  if (minor >= 4) putLas(text, 247, std::uint64_t(count));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    putLas(text, 131 + 8 * axis, 0.01);
    putLas(text, 155 + 8 * axis, 1e6 * double(axis + 1));
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::size_t at = header + i * record;
    putLas(text, at, std::int32_t(i));
    putLas(text, at + 4, -2 * std::int32_t(i));
    putLas(text, at + 8, std::int32_t(3));
    putLas(text, at + 12, std::uint16_t(i));
    putLas(text, at + (format <= 5 ? 15 : 16), char(i % 32 | (format <= 5 ? 0x60 : 0)));
    for (std::size_t c = 0; kLasColorAt[format] != 0 && c < 3; ++c) {
      putLas(text, at + kLasColorAt[format] + 2 * c, std::uint16_t(60000 + c));
    }
  }
  return text;
}

template <typename T>
T getLas(const std::string& text, std::size_t at) {
  T value{};
  if (at + sizeof value <= text.size()) std::memcpy(&value, &text[at], sizeof value);
  return value;
}

// A record of variable length, before the points or (is_extended) behind them.
inline std::string lasRecord(const std::string& user, std::uint16_t number, const std::string& data,
                             bool is_extended = false) {
  std::string text(is_extended ? 60 : 54, '\0');
  text.replace(2, user.size(), user);
  putLas(text, 18, number);
  if (is_extended) {
    putLas(text, 20, std::uint64_t(data.size()));
  } else {
    putLas(text, 20, std::uint16_t(data.size()));
  }
  return text + data;
}

// A description of extra bytes; options: 8 has a scale, 16 an offset, 1 a number for no data.
inline std::string lasDescriptor(const std::string& name, int type, int options = 0,
                                 double scale = 0, double origin = 0) {
  std::string text(192, '\0');
  putLas(text, 2, char(type));
  putLas(text, 3, char(options));
  text.replace(4, name.size(), name);
  putLas(text, 112, scale);
  putLas(text, 136, origin);
  return text;
}

// Puts records before the points of a file that has none.
inline std::string withRecords(std::string las, const std::vector<std::string>& records) {
  const std::size_t at = getLas<std::uint16_t>(las, 94);
  std::string all;
  for (const std::string& record : records) all += record;
  putLas(las, 96, std::uint32_t(getLas<std::uint32_t>(las, 96) + all.size()));
  putLas(las, 100, std::uint32_t(records.size()));
  las.insert(at, all);
  return las;
}

// The record of point `index`.
inline std::string lasPoint(const std::string& las, std::size_t index) {
  const std::size_t size = getLas<std::uint16_t>(las, 105);
  return las.substr(getLas<std::uint32_t>(las, 96) + index * size, size);
}
inline std::string lasPoints(const std::string& las, std::size_t count) {
  return las.substr(getLas<std::uint32_t>(las, 96), count * getLas<std::uint16_t>(las, 105));
}

// Sets all that a point of formats 6 to 10 has, its flags but for withheld, and fills what lies
// behind it with numbers from 1 on.
inline void fillPoint(std::string& las, std::size_t index) {
  const std::size_t size = getLas<std::uint16_t>(las, 105);
  const std::size_t at = getLas<std::uint32_t>(las, 96) + index * size;
  const bool is_old = std::uint8_t(las[104]) <= 5;
  for (std::size_t i = 12; i < size; ++i) las[at + i] = char((7 * index + 3 * i) % 251);
  if (is_old) {
    putLas(las, at + 14, char((1 + index % 5) | 5 << 3 | (index % 2) << 6 | (index % 3 == 0) << 7));
    putLas(las, at + 15, char(index % 7 | (index % 3) << 5));
  } else {
    putLas(las, at + 14, char((1 + index % 15) | 15 << 4));
    putLas(las, at + 15,
           char((index % 4) | (index % 2) << 3 | (index % 4) << 4 | (index % 4) << 6));
    putLas(las, at + 16, char(200 + index % 50));
    putLas(las, at + 18, std::int16_t(int(index) * 731 % 30000 - 15000));
  }
  const std::size_t time = is_old ? 20 : 22, format = std::uint8_t(las[104]);
  if (format != 0 && format != 2) putLas(las, at + time, 1e8 + 0.125 * double(index));
  // Places of waveforms: a number below 2^53, and floats that are numbers
  const std::size_t wave = format == 4 ? 28 : format == 5 ? 34 : format == 9 ? 30 : 38;
  if (format != 4 && format != 5 && format != 9 && format != 10) return;
  putLas(las, at + wave + 1, std::uint64_t(123456789012 + index));
  for (std::size_t i = 0; i < 4; ++i) putLas(las, at + wave + 13 + 4 * i, float(index) / 3);
}

// What the header says, in the way that other programs read it.
struct LasSummary {
  unsigned minor, format;
  std::uint64_t count;
  double scale, origin;  // of x
  double least[3], most[3];
};
inline LasSummary lasSummaryOf(const std::string& las) {
  LasSummary summary{};
  EXPECT_EQ(las.substr(0, 4), "LASF");
  summary.minor = std::uint8_t(las[25]);
  summary.format = std::uint8_t(las[104]);
  summary.count =
      summary.minor >= 4 ? getLas<std::uint64_t>(las, 247) : getLas<std::uint32_t>(las, 107);
  summary.scale = getLas<double>(las, 131);
  summary.origin = getLas<double>(las, 155);
  for (std::size_t i = 0; i < 3; ++i) {
    summary.most[i] = getLas<double>(las, 179 + 16 * i);
    summary.least[i] = getLas<double>(las, 187 + 16 * i);
  }
  const std::size_t size = getLas<std::uint16_t>(las, 105);
  EXPECT_EQ(getLas<std::uint32_t>(las, 96) + summary.count * size, las.size());
  return summary;
}

// The data of a record before the points; empty when there is none.
inline std::string lasRecordOf(const std::string& las, const std::string& user, int number) {
  std::size_t at = getLas<std::uint16_t>(las, 94);
  for (std::uint32_t i = 0; i < getLas<std::uint32_t>(las, 100); ++i) {
    const std::uint16_t length = getLas<std::uint16_t>(las, at + 20);
    if (las.substr(at + 2, user.size()) == user && getLas<std::uint16_t>(las, at + 18) == number) {
      return las.substr(at + 54, length);
    }
    at += 54u + length;
  }
  EXPECT_LE(at, getLas<std::uint32_t>(las, 96));
  return "";
}

}  // namespace surfeit
