// What tests of cloud formats share: rows as numbers by name, and readers held to their contract.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_writer.h"

namespace surfeit {

// All rows that are left, `batch` at a time; the status of the first failure in `status`.
inline std::vector<std::byte> readAllRows(RowReader& reader, std::size_t batch, Status& status) {
  std::vector<std::byte> rows;
  AlignedBuffer buffer;
  for (;;) {
    const Result<Bytes> view = reader.readRows(batch, buffer);
    if (!view.ok()) {
      status = view.status();
      return rows;
    }
    if (view->empty()) return rows;
    rows.insert(rows.end(), view->begin(), view->end());
  }
}

// The rows; a failure fails the test.
inline std::vector<std::byte> readAllRows(RowReader& reader, std::size_t batch = 1000) {
  Status status;
  std::vector<std::byte> rows = readAllRows(reader, batch, status);
  EXPECT_TRUE(status.ok()) << status.message();
  return rows;
}

inline double valueOf(const RowReader& reader, const std::vector<std::byte>& rows, std::size_t row,
                      const std::string& property) {
  const RowLayout& element = reader.element();
  const RowProperty* const found = element.find(property);
  EXPECT_NE(found, nullptr) << property;
  if (!found || (row + 1) * element.row_bytes > rows.size()) return -12345;
  return rowValue(&rows[row * element.row_bytes + found->offset], found->type);
}

// "float x, float y, uchar red"
inline std::string describeRow(const RowLayout& element) {
  std::string text;
  for (const RowProperty& property : element.properties) {
    text += (text.empty() ? "" : ", ") + std::string(valueTypeName(property.type)) + " " +
            property.name;
  }
  return text;
}

inline RowProperty rowProperty(const std::string& name, ValueType type = ValueType::kFloat32) {
  RowProperty property;
  property.name = name;
  property.type = type;
  return property;
}

// What cloud/rows/row_reader.h says of every reader: rows do not depend on the batch, rewind goes
// back, seekRow goes anywhere or is refused.
inline void expectReaderKeepsContract(RowReader& reader) {
  const std::size_t row_bytes = reader.element().row_bytes;
  const std::vector<std::byte> all = readAllRows(reader, 1 << 20);
  ASSERT_EQ(all.size(), reader.element().count * row_bytes);
  for (const std::size_t batch : {std::size_t{1}, std::size_t{7}, std::size_t{4097}}) {
    if (batch == 1 && reader.element().count > 5000) continue;
    ASSERT_TRUE(reader.rewind().ok());
    EXPECT_TRUE(readAllRows(reader, batch) == all) << "batch " << batch;
  }
  if (!reader.isSeekable()) {
    EXPECT_EQ(reader.seekRow(0).code(), StatusCode::kInvalidArgument);
    return;
  }
  for (const std::uint64_t row : {reader.element().count / 3, std::uint64_t{0}}) {
    ASSERT_TRUE(reader.seekRow(row).ok());
    const std::vector<std::byte> rest = readAllRows(reader, 1000);
    EXPECT_TRUE(std::equal(rest.begin(), rest.end(), all.begin() + std::ptrdiff_t(row * row_bytes),
                           all.end()));
  }
  EXPECT_EQ(reader.seekRow(reader.element().count + 1).code(), StatusCode::kInvalidArgument);
}

}  // namespace surfeit
