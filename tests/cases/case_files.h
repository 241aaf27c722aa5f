// What the tests of cases share: where shared cases lie, what is told, and columns of results.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "io/row_stream_test.h"
#include "surfeit/progress.h"

namespace surfeit {

class Notes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  void inform(const std::string& message) override { informed.push_back(message); }
  std::vector<std::string> notes, informed;
};

// Where the case lies, if it is there.
inline std::string sharedCase(const std::string& name) {
  return std::string(SURFEIT_SHARED_DATA_DIR) + "/../cases/" + name;
}

// The values of a property, row by row.
inline std::vector<double> columnOf(const std::string& file, const char* name) {
  const auto reader = openRowReader(file);
  EXPECT_TRUE(reader.ok()) << reader.status().message();
  if (!reader.ok()) return {};
  const std::vector<std::byte> rows = readAllRows(**reader);
  std::vector<double> values;
  for (std::size_t i = 0; i < (*reader)->element().count; ++i) {
    values.push_back(valueOf(**reader, rows, i, name));
  }
  return values;
}

}  // namespace surfeit
