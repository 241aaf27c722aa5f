// Geometry of Houdini 12 and later as binary JSON, byte by byte, as the tests of its readers need
// it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/test_bytes.h"

namespace surfeit {

template <typename T>
std::string bigEndian(T value) {
  std::string bytes = littleEndian(value);
  std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

struct BgeoJsonBytes {
  bool is_big_endian = false;

  template <typename T>
  std::string raw(T value) const {
    return is_big_endian ? bigEndian(value) : littleEndian(value);
  }
  std::string length(std::size_t value) const {
    if (value < 0xF1) return {char(value)};
    if (value < 65536) return "\xF2" + raw(std::uint16_t(value));
    return "\xF4" + raw(std::uint32_t(value));
  }
  std::string text(const std::string& value) const { return "\x27" + length(value.size()) + value; }
  std::string integer(std::int32_t value) const { return "\x13" + raw(value); }
  template <typename... Items>
  std::string list(const Items&... items) const {
    return "[" + (std::string() + ... + items) + "]";
  }
  std::string floats(const std::vector<float>& values) const {
    std::string bytes = "@\x19" + length(values.size());
    for (const float value : values) bytes += raw(value);
    return bytes;
  }
  std::string integers(const std::vector<std::int32_t>& values) const {
    std::string bytes = "@\x13" + length(values.size());
    for (const std::int32_t value : values) bytes += raw(value);
    return bytes;
  }
  std::string bools(const std::vector<bool>& values) const {
    std::string bytes = "@\x10" + length(values.size());
    for (std::size_t begin = 0; begin < values.size(); begin += 32) {
      std::uint32_t word = 0;
      for (std::size_t i = begin; i < std::min(begin + 32, values.size()); ++i) {
        word |= std::uint32_t{values[i]} << (i - begin);
      }
      bytes += raw(word);
    }
    return bytes;
  }

  std::string attribute(const std::string& name, const std::string& type,
                        const std::string& values) const {
    return list(list(text("scope"), text("public"), text("type"), text(type), text("name"),
                     text(name), text("options"), std::string("{}")),
                list(text("size"), integer(3), text("storage"), text("fpreal32"), text("defaults"),
                     list(text("size"), integer(1)), text(type == "string" ? "indices" : "values"),
                     values));
  }
  std::string values(int size, const std::string& storage, const std::string& layout) const {
    return list(text("size"), integer(size), text("storage"), text(storage), layout);
  }
  std::string paged(int page_rows, const std::string& rest) const {
    return text("pagesize") + integer(page_rows) + rest;
  }
  // `topology` and `primitives`: items of these lists.
  std::string geometry(std::int32_t points, const std::string& attributes,
                       const std::string& topology = {}, const std::string& primitives = {}) const {
    return std::string(is_big_endian ? "\x7F"
                                       "bJSN"
                                     : "\x7FNSJb") +
           list(text("fileversion"), text("18.5"), text("pointcount"), integer(points),
                text("info"), "{" + text("a") + integer(1) + "}", text("topology"), list(topology),
                text("attributes"),
                list(text("vertexattributes"), list(std::string()), text("pointattributes"),
                     list(attributes)),
                text("primitives"), list(primitives));
  }
};

}  // namespace surfeit
