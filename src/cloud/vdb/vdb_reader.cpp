#include "cloud/vdb/vdb_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "cloud/vdb/vdb_file.h"
#include "cloud/vdb/vdb_points_reader.h"
#include "cloud/vdb/vdb_tree.h"
#include "cloud/vdb/vdb_volume_reader.h"

namespace surfeit {
namespace {

// "density (Tree_float_5_4_3), points (...)".
std::string listGrids(const VdbFile& file) {
  std::string text;
  for (const VdbGrid& grid : file.grids) {
    if (text.size() > 1000) return text + ", ...";
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", quoteText(grid.name),
                        quoteText(grid.type));
  }
  return text.empty() ? "none" : text;
}

Result<const VdbGrid*> chooseGrid(const VdbFile& file, const std::string& part) {
  const std::string& path = file.input.path();
  for (const VdbGrid& grid : file.grids) {
    if (!part.empty() && grid.name == part) return &grid;
  }
  if (!part.empty()) {
    return Status::invalidArgument(
        fmt::format("{}: no grid is called {}; its grids: {}", path, part, listGrids(file)));
  }
  for (const VdbGrid& grid : file.grids) {
    if (grid.isPoints()) return &grid;
  }
  for (const VdbGrid& grid : file.grids) {
    if (vdbValueType(grid).has_value()) return &grid;
  }
  return Status::corruption(
      fmt::format("{}: no grid that is read; its grids: {}", path, listGrids(file)));
}

}  // namespace

bool recognisesVdb(std::string_view first_bytes) {
  return first_bytes.size() >= kVdbMagic.size() &&
         std::memcmp(first_bytes.data(), kVdbMagic.data(), kVdbMagic.size()) == 0;
}

Result<std::unique_ptr<RowReader>> openVdb(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const VdbFile> file,
                           VdbFile::open(path, options.access));
  SURFEIT_ASSIGN_OR_RETURN(const VdbGrid* grid, chooseGrid(*file, options.part));
  if (grid->isPoints()) return openVdbPoints(std::move(file), *grid, options);
  if (!vdbValueType(*grid).has_value()) {
    return Status::corruption(fmt::format(
        "{}: grid {} is of type {}, expected points or a volume of float, double, vec3s, vec3d or "
        "int32 in a tree of 5_4_3",
        path, quoteText(grid->name), quoteText(grid->type)));
  }
  return VdbVolumeReader::open(std::move(file), *grid, options);
}

}  // namespace surfeit
