// Reading OpenVDB points: by Surfeit's reader, which streams, and by the OpenVDB library, which
// holds the tree, with and without its delayed loading. Each prints processor time and peak
// resident memory, and the sum of all numbers that it has read.
//
//   vdb_bench write FILE [POINTS]     a cloud by chance: position, normal, radius, area, radiosity
//   vdb_bench ours|openvdb|delayed FILE
#include <fmt/format.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/AttributeArray.h>
#include <openvdb/points/PointDataGrid.h>
#include <sys/resource.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "bench/or_exit.h"
#include "cloud/cloud_formats.h"
#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_writer.h"

namespace surfeit {
namespace {

namespace points = openvdb::points;

constexpr std::size_t kBatchRows = 8192;
constexpr const char* kProperties[] = {
    "x", "y", "z", "nx", "ny", "nz", "radius", "area", "radiosity_r", "radiosity_g", "radiosity_b"};

struct Read {
  std::uint64_t points = 0;
  double sum = 0;
};

Status write(const std::string& path, std::uint64_t count) {
  RowWriterOptions options;
  for (const char* name : kProperties) {
    RowProperty property;
    property.name = name;
    options.properties.push_back(property);
  }
  options.count = count;
  options.memory_bytes = std::uint64_t{64} << 30;
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer, createRowWriter(path, options));
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit;
  for (std::uint64_t i = 0; i < count; ++i) {
    std::array<float, std::size(kProperties)> row;
    for (float& value : row) value = unit(random);
    for (std::size_t axis = 0; axis < 3; ++axis) row[axis] *= 1000;
    SURFEIT_RETURN_IF_ERROR(writer->writeRows(std::as_bytes(std::span(row))));
  }
  return writer->finish();
}

Result<Read> readOurs(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openRowReader(path));
  const RowLayout& rows = reader->element();
  AlignedBuffer buffer;
  Read read;
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, reader->readRows(kBatchRows, buffer));
    if (bytes.empty()) return read;
    for (std::size_t at = 0; at < bytes.size(); at += rows.row_bytes, ++read.points) {
      for (const RowProperty& property : rows.properties) {
        visitValueType(property.type, [&]<typename Value>(std::type_identity<Value>) {
          Value value;
          std::memcpy(&value, bytes.data() + at + property.offset, sizeof value);
          read.sum += double(value);
        });
      }
    }
  }
}

// All values of an attribute of a leaf.
template <typename Value>
void addFloats(const points::AttributeArray& attribute, Read& read) {
  const points::AttributeHandle<Value> handle(attribute);
  for (openvdb::Index i = 0; i < attribute.size(); ++i) {
    if constexpr (std::is_same_v<Value, float>) {
      read.sum += double(handle.get(i));
    } else {
      const Value value = handle.get(i);
      read.sum += double(value.x()) + double(value.y()) + double(value.z());
    }
  }
}

Result<Read> readByLibrary(const std::string& path, bool delays) {
  openvdb::initialize();
  openvdb::io::File file(path);
  file.open(delays);
  const auto grid =
      openvdb::gridPtrCast<points::PointDataGrid>(file.readGrid(file.beginName().gridName()));
  Read read;
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
    const points::AttributeSet& set = leaf->attributeSet();
    const points::AttributeHandle<openvdb::Vec3f> positions(*set.getConst("P"));
    for (auto point = leaf->beginIndexOn(); point; ++point, ++read.points) {
      const openvdb::Vec3d place =
          grid->indexToWorld(openvdb::Vec3d(positions.get(*point)) + point.getCoord().asVec3d());
      read.sum += place.x() + place.y() + place.z();
    }
    for (const auto& [name, position] : set.descriptor().map()) {
      const points::AttributeArray& attribute = *set.getConst(position);
      if (name == "P") continue;
      if (attribute.hasValueType<float>()) {
        addFloats<float>(attribute, read);
      } else if (attribute.hasValueType<openvdb::Vec3f>()) {
        addFloats<openvdb::Vec3f>(attribute, read);
      } else {
        return Status::failed(name + ": neither floats nor vectors");
      }
    }
  }
  return read;
}

void report(const std::string& how, const Read& read) {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto secondsOf = [](const timeval& time) {
    return double(time.tv_sec) + 1e-6 * double(time.tv_usec);
  };
  fmt::print("{:<8} {} points, {:.2f} s of processor time, {:.1f} MiB at most, sum {:.8g}\n", how,
             read.points, secondsOf(usage.ru_utime) + secondsOf(usage.ru_stime),
             double(usage.ru_maxrss) / 1024, read.sum);
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  using namespace surfeit;
  const std::string how = argc > 2 ? argv[1] : "";
  if (how == "write") {
    need(write(argv[2], argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 4000000));
  } else if (how == "ours") {
    report(how, take(readOurs(argv[2])));
  } else if (how == "openvdb" || how == "delayed") {
    report(how, take(readByLibrary(argv[2], how == "delayed")));
  } else {
    fmt::print(stderr, "vdb_bench: expected write, ours, openvdb or delayed, and FILE\n");
    return 2;
  }
  return 0;
}
