// The rows of a baked cloud as they lie in the file.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cloud/ply/ply_reader.h"

namespace surfeit {

struct BakedRows {
  RowLayout element;
  std::vector<std::byte> bytes;

  float value(std::size_t row, const std::string& property) const {
    const RowProperty* found = element.find(property);
    return float(rowValue(&bytes[row * element.row_bytes + found->offset], found->type));
  }
};

inline BakedRows readBakedRows(const std::string& path) {
  Result<PlyReader> reader = PlyReader::open(path);
  EXPECT_TRUE(reader.ok());
  BakedRows rows{reader->header().elements[0], {}};
  rows.bytes.resize(rows.element.count * rows.element.row_bytes);
  EXPECT_TRUE(reader->seekElement(0).ok());
  for (std::size_t at = 0; at < rows.bytes.size();) {
    const Result<std::size_t> got = reader->readRows(std::span(rows.bytes).subspan(at));
    if (!got.ok() || *got == 0) break;
    at += *got * rows.element.row_bytes;
  }
  return rows;
}

}  // namespace surfeit
