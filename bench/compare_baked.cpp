// Compares two PLY clouds record by record: for every scalar property that both have, the mean, the
// root mean square difference over the mean, and that of the 99 % of records that differ least:
// where receivers lie within a surface, the side that covers them may change with the last bit.
//
//   compare_baked A.ply B.ply
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/ply_reader.h"
#include "io/surfel_mapping.h"

namespace {

using namespace surfeit;

struct Property {
  std::string name;
  const PlyProperty* a = nullptr;
  const PlyProperty* b = nullptr;
  double sum = 0;
  std::vector<float> differences{};
};

double rmsOf(std::span<const float> differences) {
  double sum = 0;
  for (const float difference : differences) sum += double(difference) * double(difference);
  return differences.empty() ? 0 : std::sqrt(sum / double(differences.size()));
}

struct Cloud {
  PlyReader reader;
  const PlyElement* element = nullptr;
  AlignedBuffer buffer;
};

Result<Cloud> openCloud(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t index, findSurfelElement(reader.header(), path));
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(index));
  Cloud cloud{std::move(reader), nullptr, {}};
  cloud.element = &cloud.reader.header().elements[index];
  return cloud;
}

Status compare(const std::string& path_a, const std::string& path_b) {
  SURFEIT_ASSIGN_OR_RETURN(Cloud a, openCloud(path_a));
  SURFEIT_ASSIGN_OR_RETURN(Cloud b, openCloud(path_b));
  if (a.element->count != b.element->count) {
    return Status::failed(fmt::format("{} has {} records, {} has {}", path_a, a.element->count,
                                      path_b, b.element->count));
  }
  std::vector<Property> properties;
  for (const PlyProperty& property : a.element->properties) {
    const PlyProperty* other = b.element->find(property.name);
    if (other == nullptr || property.is_list || other->is_list) continue;
    properties.push_back({property.name, &property, other});
  }

  constexpr std::size_t kRows = 4096;
  std::vector<std::byte> rows_a(kRows * a.element->row_bytes), rows_b(kRows * b.element->row_bytes);
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, a.reader.readRows(rows_a));
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count_b, b.reader.readRows(rows_b));
    if (count != count_b) return Status::failed("the clouds end at different records");
    if (count == 0) break;
    for (Property& property : properties) {
      for (std::size_t i = 0; i < count; ++i) {
        const double value_a =
            plyValue(&rows_a[i * a.element->row_bytes + property.a->offset], property.a->type);
        const double value_b =
            plyValue(&rows_b[i * b.element->row_bytes + property.b->offset], property.b->type);
        if (!std::isfinite(value_a) && !std::isfinite(value_b)) continue;
        property.sum += value_a;
        property.differences.push_back(float(std::abs(value_a - value_b)));
      }
    }
  }
  const double records = double(a.element->count);
  for (Property& property : properties) {
    const double mean = property.sum / records;
    std::vector<float>& differences = property.differences;
    std::sort(differences.begin(), differences.end());
    const double rms = rmsOf(differences);
    const double most = rmsOf(std::span(differences).first(differences.size() * 99 / 100));
    fmt::print(
        "{:<16} mean {:10.4g}  RMS difference {:9.4f} % of it, of 99 % of records {:.4f} %\n",
        property.name, mean, 100 * rms / std::abs(mean), 100 * most / std::abs(mean));
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: compare_baked A.ply B.ply\n");
    return 2;
  }
  const Status status = compare(argv[1], argv[2]);
  if (!status.ok()) fmt::print(stderr, "compare_baked: {}\n", status.message());
  return status.ok() ? 0 : 1;
}
