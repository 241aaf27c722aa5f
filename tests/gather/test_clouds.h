// Small clouds and scenes for the gather's tests, and results read back.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <iterator>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cloud/ply/ply_reader.h"
#include "cloud/ply/ply_writer.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"

namespace surfeit {

// A directory of its own for one test, removed when the test ends.
class TestDirectory {
 public:
  TestDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "surfeit_gather_XXXXXX").string();
    EXPECT_NE(mkdtemp(name.data()), nullptr);
    path_ = name;
  }
  ~TestDirectory() { std::filesystem::remove_all(path_); }

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  // Whether nothing but these files is there.
  bool holdsOnly(std::vector<std::string> names) const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) {
      found.push_back(entry.path().filename().string());
    }
    std::sort(found.begin(), found.end());
    std::sort(names.begin(), names.end());
    return found == names;
  }

 private:
  std::filesystem::path path_;
};

// A table of doubles with a type per column, as rows of a PLY file.
struct Table {
  std::vector<RowProperty> properties;
  std::vector<std::vector<double>> rows;

  void addProperty(const std::string& name, ValueType type = ValueType::kFloat32) {
    RowProperty property;
    property.name = name;
    property.type = type;
    properties.push_back(property);
  }
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const RowProperty& property : properties) names.push_back(property.name);
    return names;
  }
  // The values of a property; none when it is absent.
  std::vector<double> column(const std::string& name) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < properties.size(); ++i) {
      if (properties[i].name != name) continue;
      for (const std::vector<double>& row : rows) values.push_back(row[i]);
    }
    return values;
  }
};

template <typename T>
void storeAs(double value, std::byte* bytes) {
  const T typed = static_cast<T>(value);
  std::memcpy(bytes, &typed, sizeof typed);
}

inline void storePlyValue(double value, ValueType type, std::byte* bytes) {
  switch (type) {
    case ValueType::kInt8:
      return storeAs<std::int8_t>(value, bytes);
    case ValueType::kUint8:
      return storeAs<std::uint8_t>(value, bytes);
    case ValueType::kInt16:
      return storeAs<std::int16_t>(value, bytes);
    case ValueType::kUint16:
      return storeAs<std::uint16_t>(value, bytes);
    case ValueType::kInt32:
      return storeAs<std::int32_t>(value, bytes);
    case ValueType::kUint32:
      return storeAs<std::uint32_t>(value, bytes);
    case ValueType::kFloat32:
      return storeAs<float>(value, bytes);
    case ValueType::kFloat64:
      return storeAs<double>(value, bytes);
  }
}

inline void writeTable(const Table& table, const std::string& path,
                       PlyEncoding encoding = PlyEncoding::kBinaryLittleEndian) {
  auto writer = PlyWriter::create(path, encoding, table.properties);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  const RowLayout& element = writer->element();
  std::vector<std::byte> row(element.row_bytes);
  for (const std::vector<double>& values : table.rows) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const RowProperty& property = element.properties[i];
      storePlyValue(values[i], property.type, row.data() + property.offset);
    }
    ASSERT_TRUE(writer->writeRows(row).ok());
  }
  const Status finished = writer->finish();
  ASSERT_TRUE(finished.ok()) << finished.message();
}

inline Table readTable(const std::string& path) {
  Table table;
  auto reader = PlyReader::open(path);
  EXPECT_TRUE(reader.ok()) << reader.status().message();
  if (!reader.ok()) return table;
  const RowLayout& element = reader->header().elements.at(0);
  EXPECT_TRUE(reader->seekElement(0).ok());
  table.properties = element.properties;
  std::vector<std::byte> row(element.row_bytes);
  for (;;) {
    const auto count = reader->readRows(row);
    EXPECT_TRUE(count.ok()) << count.status().message();
    if (!count.ok() || *count == 0) return table;
    std::vector<double>& values = table.rows.emplace_back();
    for (const RowProperty& property : element.properties) {
      values.push_back(rowValue(row.data() + property.offset, property.type));
    }
  }
}

inline std::string readBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.is_open()) << path;
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void writeBytes(const std::string& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  ASSERT_TRUE(file.good()) << path;
}

// A floor of `side` by `side` surfels and a sphere of as many above it.
inline Table floorAndSphere(int side) {
  Table table;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius", "area", "radiosity_r",
                           "radiosity_g", "radiosity_b"}) {
    table.addProperty(name);
  }
  const auto add = [&table](const glm::vec3& p, const glm::vec3& n, double area) {
    table.rows.push_back({p.x, p.y, p.z, n.x, n.y, n.z, std::sqrt(area / 2), area,
                          0.5 + 0.4 * std::sin(9 * p.x), 0.5 + 0.4 * std::cos(7 * p.y), 0.3});
  };
  const double floor_area = 16.0 / side / side;
  const double sphere_area = 4 * 3.14159265 * 0.64 / side / side;
  const double golden_angle = 2.39996323;
  for (int i = 0; i < side * side; ++i) {
    const glm::vec3 cell(float(i % side) + 0.5f, float(i / side) + 0.5f, 0);
    add(4.0f / float(side) * cell - glm::vec3(2, 2, 0), glm::vec3(0, 0, 1), floor_area);
    const double z = 1 - (2 * i + 1.0) / side / side;
    const double r = std::sqrt(1 - z * z);
    const glm::vec3 normal(r * std::cos(golden_angle * i), r * std::sin(golden_angle * i), z);
    add(glm::vec3(0, 0, 1) + 0.8f * normal, normal, sphere_area);
  }
  return table;
}

// Receivers on the same floor and sphere, in no order, each with its number.
inline Table receiversOf(int count, unsigned seed = 1) {
  Table table;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) table.addProperty(name);
  table.addProperty("id", ValueType::kInt32);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < count; ++i) {
    glm::vec3 position(2 * uniform(random), 2 * uniform(random), 0), normal(0, 0, 1);
    if (i % 2 == 1) {
      normal = glm::normalize(glm::vec3(uniform(random), uniform(random), uniform(random)));
      position = glm::vec3(0, 0, 1) + 0.8f * normal;
    }
    table.rows.push_back(
        {position.x, position.y, position.z, normal.x, normal.y, normal.z, static_cast<double>(i)});
  }
  return table;
}

// Indexes a cloud to `path`.
inline void makeScene(const Table& cloud, const std::string& path) {
  const std::string cloud_path = path + ".ply";
  writeTable(cloud, cloud_path);
  Progress progress;
  const auto stats = indexClouds({cloud_path}, path, {}, progress);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  std::filesystem::remove(cloud_path);
}

}  // namespace surfeit
