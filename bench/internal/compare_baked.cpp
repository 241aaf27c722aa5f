// Compares two clouds record by record, or a cloud with what a brick map holds at its points
// (filter width 0): for every scalar property that both have, the mean, the root mean square
// difference over the mean, and that of the 99 % of records that differ least: where receivers lie
// within a surface, the side that covers them may change with the last bit. Then the differences as
// they are.
//
//   compare_baked A B
//   compare_baked CLOUD --brick MAP.vdb
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "view/brick_rows.h"
#include "view/cloud_rows.h"
#include "view/row_field.h"

namespace {

using namespace surfeit;

struct Property {
  std::string name;
  RowField a, b;
  double sum = 0;
  std::uint64_t lacking = 0;  // records of which one cloud alone has a finite value
  std::vector<float> differences{};
};

// Rows one by one.
class Rows {
 public:
  explicit Rows(CloudRows& rows) : rows_(rows) {}

  // nullptr at the end.
  Result<const std::byte*> next() {
    if (batch_.empty()) {
      SURFEIT_ASSIGN_OR_RETURN(batch_, rows_.next());
    }
    if (batch_.empty()) return nullptr;
    const std::byte* const row = batch_.data();
    batch_ = batch_.subspan(rows_.element().row_bytes);
    return row;
  }

 private:
  CloudRows& rows_;
  std::span<const std::byte> batch_;
};

double rmsOf(std::span<const float> differences) {
  double sum = 0;
  for (const float difference : differences) sum += double(difference) * double(difference);
  return differences.empty() ? 0 : std::sqrt(sum / double(differences.size()));
}

void print(Property& property) {
  std::vector<float>& differences = property.differences;
  if (differences.empty()) return;
  std::sort(differences.begin(), differences.end());
  const std::size_t most = differences.size() * 99 / 100;
  const double count = double(differences.size()), mean = property.sum / count;
  const double rms = rmsOf(differences), rms_of_most = rmsOf(std::span(differences).first(most));
  double sum = 0;
  for (const float difference : differences) sum += double(difference);
  fmt::print(
      "{:<16} mean {:10.4g}  RMS difference {:9.4f} % of it, of 99 % of records {:.4f} %; "
      "differences: mean {:.4f}, RMS {:.4f}, 99 % below {:.3f}, largest {:.3f}; {} lacking\n",
      property.name, mean, 100 * rms / std::abs(mean), 100 * rms_of_most / std::abs(mean),
      sum / count, rms, differences[std::min(most, differences.size() - 1)], differences.back(),
      property.lacking);
}

// Properties of `b` that lie behind the first so many bytes of its rows.
Status compare(CloudRows& a, CloudRows& b, std::ptrdiff_t first_byte) {
  std::vector<Property> properties;
  for (const RowProperty& property : a.element().properties) {
    const RowField field_a = RowField::find(a.element(), property.name);
    const RowField field_b = RowField::find(b.element(), property.name);
    if (field_a.exists() && field_b.offset >= first_byte) {
      properties.push_back({property.name, field_a, field_b});
    }
  }
  for (Rows rows_a(a), rows_b(b);;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::byte* const row_a, rows_a.next());
    SURFEIT_ASSIGN_OR_RETURN(const std::byte* const row_b, rows_b.next());
    if ((row_a == nullptr) != (row_b == nullptr)) {
      return Status::failed(
          fmt::format("{} and {} have different numbers of records", a.path(), b.path()));
    }
    if (row_a == nullptr) break;
    for (Property& property : properties) {
      const double value_a = property.a.read(row_a), value_b = property.b.read(row_b);
      if (std::isfinite(value_a) && std::isfinite(value_b)) {
        property.sum += value_a;
        property.differences.push_back(float(std::abs(value_a - value_b)));
      } else if (std::isfinite(value_a) || std::isfinite(value_b)) {
        ++property.lacking;
      }
    }
  }
  for (Property& property : properties) print(property);
  return {};
}

Status compareFiles(const std::string& path_a, const std::string& path_b, bool is_brick) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<CloudRows> a, openCloudRows(path_a));
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<CloudRows> b, openCloudRows(is_brick ? path_a : path_b));
  if (is_brick) {
    SURFEIT_ASSIGN_OR_RETURN(b, addBrickValues(std::move(b), path_b, 0.0));
  }
  // What is looked up stands behind what the cloud has
  return compare(*a, *b, is_brick ? std::ptrdiff_t(a->element().row_bytes) : 0);
}

}  // namespace

int main(int argc, char** argv) {
  const bool is_brick = argc == 4 && argv[2] == std::string_view("--brick");
  if (argc != 3 && !is_brick) {
    fmt::print(stderr, "usage: compare_baked A B, or compare_baked CLOUD --brick MAP.vdb\n");
    return 2;
  }
  const Status status = compareFiles(argv[1], argv[argc - 1], is_brick);
  if (!status.ok()) fmt::print(stderr, "compare_baked: {}\n", status.message());
  return status.ok() ? 0 : 1;
}
