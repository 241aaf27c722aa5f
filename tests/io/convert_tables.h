// What tests of conversions share: clouds as tables of numbers, written and read by name.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "surfeit/convert.h"

namespace surfeit {

// Notes, and an end after so many units of work.
class TestProgress : public Progress {
 public:
  explicit TestProgress(std::uint64_t most = ~std::uint64_t{0}) : most_(most) {}
  void advance(std::uint64_t count) override { done_ += count; }
  void note(const std::string& message) override { notes.push_back(message); }
  bool isCancelled() const override { return done_ >= most_; }

  std::vector<std::string> notes;

 private:
  std::uint64_t most_, done_ = 0;
};

// A cloud in memory, all values as doubles.
struct Table {
  std::vector<RowProperty> properties;
  std::vector<std::vector<double>> rows;
};

inline void setValue(const RowProperty& property, double value, std::byte* row) {
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    const T typed = static_cast<T>(value);
    std::memcpy(row + property.offset, &typed, sizeof typed);
  });
}

class ConvertTest : public DirectoryTest {
 protected:
  // Takes every record, also those of LAS that are left out by default.
  static ConvertOptions all() {
    ConvertOptions options;
    options.filter = "true";
    return options;
  }

  void writeTable(const std::string& name, const Table& table) const {
    RowWriterOptions options;
    options.properties = table.properties;
    options.comments = {"made by a test"};
    const Result<std::unique_ptr<RowWriter>> writer = createRowWriter(path(name), options);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    const RowLayout& element = (*writer)->element();
    std::vector<std::byte> row(element.row_bytes);
    for (const std::vector<double>& values : table.rows) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        setValue(element.properties[i], values[i], row.data());
      }
      ASSERT_TRUE((*writer)->writeRows(row).ok());
    }
    ASSERT_TRUE((*writer)->finish().ok());
  }

  Table readTable(const std::string& name) const {
    Result<std::unique_ptr<RowReader>> reader = openRowReader(path(name));
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    if (!reader.ok()) return {};
    const RowLayout& element = (*reader)->element();
    const std::vector<std::byte> bytes = readAllRows(**reader);
    Table table{element.properties, {}};
    for (std::size_t at = 0; at < bytes.size(); at += element.row_bytes) {
      std::vector<double> row;
      for (const RowProperty& property : element.properties) {
        row.push_back(rowValue(&bytes[at + property.offset], property.type));
      }
      table.rows.push_back(row);
    }
    return table;
  }

  ConvertStats convertOk(const std::vector<std::string>& inputs, const std::string& output,
                         const ConvertOptions& options = {}) {
    std::vector<std::string> paths;
    for (const std::string& input : inputs) paths.push_back(path(input));
    TestProgress progress;
    Result<ConvertStats> stats = convertClouds(paths, path(output), options, progress);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    notes_ = progress.notes;
    return stats.ok() ? *stats : ConvertStats{};
  }

  Status refusal(const std::string& input, const ConvertOptions& options,
                 const std::string& output = "refused.ply") {
    TestProgress progress;
    const Status status = convertClouds({path(input)}, path(output), options, progress).status();
    EXPECT_FALSE(status.ok());
    EXPECT_FALSE(std::filesystem::exists(path(output)));
    return status;
  }

  std::vector<std::string> notes_;
};

inline Table tableOf(const std::vector<std::pair<std::string, ValueType>>& properties) {
  Table table;
  for (const auto& [name, type] : properties) table.properties.push_back(rowProperty(name, type));
  return table;
}

inline constexpr ValueType kFloat = ValueType::kFloat32;
inline constexpr ValueType kDouble = ValueType::kFloat64;
inline constexpr ValueType kByte = ValueType::kUint8;

// Points x y z with some more properties.
inline Table pointsOf(const std::vector<std::vector<double>>& rows, ValueType type = kFloat) {
  Table table = tableOf({{"x", type}, {"y", type}, {"z", type}});
  table.rows = rows;
  return table;
}

inline std::vector<double> column(const Table& table, const std::string& name) {
  std::vector<double> values;
  for (std::size_t i = 0; i < table.properties.size(); ++i) {
    if (table.properties[i].name != name) continue;
    for (const std::vector<double>& row : table.rows) values.push_back(row[i]);
  }
  return values;
}

inline std::string typesOf(const Table& table) {
  RowLayout element;
  element.properties = table.properties;
  return describeRow(element);
}

inline constexpr int kWidth = 40, kHeight = 30;  // of the picture that rows come from

// A cloud with every kind of channel, in scan line order of a picture.
inline Table fullTable() {
  Table table = tableOf({{"x", kFloat},
                         {"y", kFloat},
                         {"z", kFloat},
                         {"nx", kFloat},
                         {"ny", kFloat},
                         {"nz", kFloat},
                         {"radius", kFloat},
                         {"area", kFloat},
                         {"radiosity_r", kFloat},
                         {"radiosity_g", kFloat},
                         {"radiosity_b", kFloat},
                         {"albedo_r", kFloat},
                         {"albedo_g", kFloat},
                         {"albedo_b", kFloat},
                         {"red", kByte},
                         {"green", kByte},
                         {"blue", kByte},
                         {"velocity_x", kFloat},
                         {"velocity_y", kFloat},
                         {"velocity_z", kFloat},
                         {"occlusion", kFloat},
                         {"two_sided", kByte},
                         {"group", kByte},
                         {"weight", kDouble},
                         {"id", ValueType::kInt32},
                         {"pixel_x", ValueType::kInt32},
                         {"pixel_y", ValueType::kInt32}});
  std::mt19937 random(3);
  const auto uniform = [&random](double least, double most) {
    return double(float(std::uniform_real_distribution<double>(least, most)(random)));
  };
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const double z = uniform(-1, 1), phi = uniform(0, 6.283), r = std::sqrt(1 - z * z);
    std::vector<double> row = {uniform(-50, 50),  uniform(0, 20),    uniform(3, 4),
                               r * std::cos(phi), r * std::sin(phi), z};
    for (int k = 0; k < 8; ++k) row.push_back(uniform(0.001, k < 2 ? 0.5 : 10));
    for (int k = 0; k < 3; ++k) row.push_back(double(random() % 256));
    for (int k = 0; k < 3; ++k) row.push_back(uniform(-9, 9));
    row.push_back(uniform(0, 1));
    row.push_back(double(random() % 2));
    row.push_back(double(random() % 64));
    row.push_back(1 + std::ldexp(double(random()), -40));
    row.push_back(i);
    row.push_back(i % kWidth);
    row.push_back(i / kWidth);
    table.rows.push_back(row);
  }
  return table;
}

}  // namespace surfeit
