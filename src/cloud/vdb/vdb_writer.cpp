#include "cloud/vdb/vdb_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "cloud/rows/surfel_names.h"
#include "cloud/vdb/vdb_volume_reader.h"
#include "cloud/vdb/vdb_writers.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

Status checkProperties(const std::string& path, const RowLayout& element) {
  std::set<std::string_view> names;
  for (const RowProperty& property : element.properties) {
    if (property.is_list) {
      return Status::invalidArgument(
          fmt::format("{}: OpenVDB holds no lists: {}", path, property.name));
    }
    if (!names.insert(property.name).second) {
      return Status::invalidArgument(
          fmt::format("{}: property {} occurs twice", path, property.name));
    }
  }
  return {};
}

template <std::size_t N>
bool hasAll(const RowLayout& element, const char* const (&names)[N]) {
  return std::all_of(std::begin(names), std::end(names),
                     [&](const char* name) { return element.find(name) != nullptr; });
}

}  // namespace

std::string vdbName(std::string_view name) {
  std::string fit(name);
  std::replace_if(
      fit.begin(), fit.end(),
      [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '|' && c != ':';
      },
      '_');
  return fit;
}

Result<std::unique_ptr<RowWriter>> createVdb(const std::string& path,
                                             const RowWriterOptions& options) {
  if (withoutCompression(path).size() != path.size()) {
    return Status::invalidArgument(
        fmt::format("{}: OpenVDB files are compressed inside: let the name end with .vdb", path));
  }
  RowLayout element;
  element.name = "vertex";
  element.properties = options.properties;
  packRow(element);
  SURFEIT_RETURN_IF_ERROR(checkProperties(path, element));
  const RowReader* const original = options.like ? &options.like->file() : nullptr;
  const auto* like = dynamic_cast<const VdbVolumeReader*>(original);
  if (like != nullptr && hasAll(element, kVoxelNames)) {
    return createVdbVolumes(path, std::move(element), *like, options);
  }
  if (!hasAll(element, kPositionNames)) {
    return Status::invalidArgument(fmt::format("{}: OpenVDB points need x y z", path));
  }
  return createVdbPoints(path, std::move(element), options);
}

}  // namespace surfeit
