// Strands from the curves of Houdini's geometry (cloud/houdini/bgeo_curves.h): open polygons, and
// points along NURBS and Bezier curves (sample/meshes/spline.h). Point attributes: width, the
// diameter, or else pscale, the radius; Cd, the albedo, linear.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/houdini/bgeo_ascii_reader.h"
#include "cloud/houdini/bgeo_curves.h"
#include "cloud/houdini/bgeo_json_cursor.h"
#include "cloud/houdini/bgeo_json_reader.h"
#include "cloud/houdini/bgeo_reader.h"
#include "core/resident_limit.h"
#include "sample/meshes/curves.h"
#include "sample/meshes/mesh_builder.h"
#include "sample/meshes/spline.h"
#include "storage/byte_input.h"

namespace surfeit {
namespace {

constexpr std::size_t kRowsAtOnce = 4096;

Result<std::string> firstBytes(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  std::string bytes(12, '\0');
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size,
                           input.readSome(0, std::as_writable_bytes(std::span(bytes))));
  bytes.resize(size);
  return bytes;
}

// Points as the file has them: no rule for colors.
Result<std::unique_ptr<RowReader>> openPoints(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const std::string first, firstBytes(path));
  if (recognisesBgeo(first)) return openBgeo(path, {});
  if (recognisesBgeoAscii(first)) return openBgeoAscii(path, {});
  return openBgeoJson(path, {});
}

// The points that curves have, each once, in the order of the file.
class PointTable {
 public:
  // The points of `curves` refer to rows of the file before, to the table after.
  static Result<PointTable> read(const std::string& path, const CurveOptions& options,
                                 const glm::vec3& default_albedo, HoudiniCurves& curves,
                                 Progress& progress) {
    PointTable table;
    std::vector<std::uint32_t>& points = curves.points;
    std::vector<std::uint32_t> used = points;
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (std::uint32_t& point : points) {
      point = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), point) -
                                         used.begin());
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openPoints(path));
    SURFEIT_RETURN_IF_ERROR(table.findProperties(reader->element(), path, options));
    SURFEIT_RETURN_IF_ERROR(checkResidentBytes(path, used.size() * sizeof(CurvePoint)));
    table.points_.reserve(used.size());
    SURFEIT_RETURN_IF_ERROR(table.readRows(*reader, used, options, default_albedo, progress));
    if (table.weights_.empty() && !curves.weights.empty()) {
      for (const std::uint32_t point : used) table.weights_.push_back(curves.weights[point]);
    }
    const std::uint64_t left_out = reader->element().count - used.size();
    if (left_out > 0) {
      progress.note(fmt::format("{}: {} points that no curve has are left out", path, left_out));
    }
    return table;
  }

  const CurvePoint& operator[](std::size_t i) const { return points_[i]; }
  // Of points in NURBS and Bezier curves; none: all are 1.
  const std::vector<float>& weights() const { return weights_; }

 private:
  Status findProperties(const RowLayout& element, const std::string& path,
                        const CurveOptions& options) {
    const auto find = [&](std::string_view name) -> const RowProperty* {
      for (const RowProperty& property : element.properties) {
        if (property.name == name) return &property;
      }
      return nullptr;
    };
    constexpr const char* kPlace[] = {"x", "y", "z"};
    constexpr const char* kColor[] = {"red", "green", "blue"};
    for (std::size_t i = 0; i < 3; ++i) {
      place_[i] = find(kPlace[i]);
      color_[i] = find(kColor[i]);
    }
    if (place_[0] == nullptr || place_[1] == nullptr || place_[2] == nullptr) {
      return Status::corruption(path + ": points have no attribute P of three values");
    }
    weight_ = find("Pw");
    width_ = find("width");
    if (width_ == nullptr) {
      width_ = find("radius");
      width_scale_ = 2;
    }
    if (width_ == nullptr && !(options.width > 0)) {
      return Status::corruption(
          path +
          ": points have no attribute width or pscale, expected one of them, or a diameter of "
          "all strands (--curve-width)");
    }
    return {};
  }

  Status readRows(RowReader& reader, const std::vector<std::uint32_t>& used,
                  const CurveOptions& options, const glm::vec3& default_albedo,
                  const Progress& progress) {
    AlignedBuffer buffer;
    std::uint64_t row = 0;
    const std::size_t row_bytes = reader.element().row_bytes;
    while (points_.size() < used.size()) {
      if (progress.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader.readRows(kRowsAtOnce, buffer));
      const std::uint64_t count = rows.size() / row_bytes;
      if (count == 0) {
        return Status::corruption(fmt::format("{}: {} points, a curve has point {}", reader.path(),
                                              row, used[points_.size()]));
      }
      while (points_.size() < used.size() && used[points_.size()] < row + count) {
        const std::byte* const at =
            rows.data() + static_cast<std::size_t>(used[points_.size()] - row) * row_bytes;
        points_.push_back(pointOf(at, options, default_albedo));
        if (weight_ != nullptr) {
          weights_.push_back(float(rowValue(at + weight_->offset, weight_->type)));
        }
      }
      row += count;
    }
    return {};
  }

  CurvePoint pointOf(const std::byte* row, const CurveOptions& options,
                     const glm::vec3& default_albedo) const {
    const auto value = [row](const RowProperty* property) {
      return rowValue(row + property->offset, property->type);
    };
    CurvePoint point;
    point.position = {value(place_[0]), value(place_[1]), value(place_[2])};
    point.width = options.width > 0 ? options.width : width_scale_ * value(width_);
    point.color = default_albedo;
    if (color_[0] != nullptr && color_[1] != nullptr && color_[2] != nullptr) {
      for (int i = 0; i < 3; ++i) {
        point.color[i] = std::max(0.0f, float(value(color_[static_cast<std::size_t>(i)])));
      }
    }
    return point;
  }

  std::array<const RowProperty*, 3> place_{}, color_{};  // while rows are read
  const RowProperty *width_ = nullptr, *weight_ = nullptr;
  double width_scale_ = 1;
  std::vector<CurvePoint> points_;
  std::vector<float> weights_;
};

// What else Houdini saves under these names.
Status checkFormat(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const std::string first, firstBytes(path));
  if (startsBinaryJson(first) || recognisesBgeo(first) || recognisesBgeoAscii(first)) return {};
  const bool is_text = first.starts_with("[") || first.starts_with("{");
  return Status::corruption(
      fmt::format("{}: found {}, expected binary .bgeo, or geometry of version 5: save it as that, "
                  "plain or compressed by gzip or zstd",
                  path,
                  is_text ? "geometry of Houdini 12 or later as text (.geo)"
                          : "no geometry of Houdini (.bgeo.sc is not read)"));
}

void noteOthers(const std::string& path, const HoudiniCurves& curves, Progress& progress) {
  if (curves.closed_polygons > 0) {
    progress.note(
        fmt::format("{}: {} closed polygons and curves are left out: open curves alone are read of "
                    "Houdini's files (faces are "
                    "read from OBJ and PLY)",
                    path, curves.closed_polygons));
  }
  std::string types;
  for (const auto& [type, count] : curves.others) {
    types += fmt::format("{}{} {}", types.empty() ? "" : ", ", count, type);
  }
  if (!types.empty()) {
    progress.note(fmt::format("{}: other primitives are left out: {}", path, types));
  }
}

void noteSplines(const std::string& path, const HoudiniCurves& curves, Progress& progress) {
  const auto count =
      std::count_if(curves.basis_of.begin(), curves.basis_of.end(), [&](std::uint32_t basis) {
        return curves.bases[basis].kind != HoudiniBasis::Kind::kPolygon;
      });
  if (count == 0) return;
  progress.inform(fmt::format(
      "{}: {} NURBS and Bezier curves become polygons of {} points for each span between knots",
      path, count, kSplineSteps));
}

}  // namespace

Status loadHoudiniMesh(const std::string& path, const glm::vec3& default_albedo,
                       const CurveOptions& options, MeshBuilder& builder, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkFormat(path));
  SURFEIT_ASSIGN_OR_RETURN(HoudiniCurves curves, readHoudiniCurves(path));
  noteOthers(path, curves, progress);
  if (curves.corners.empty()) {
    return Status::corruption(path +
                              ": found no open curves, expected polygons, NURBS or Bezier curves "
                              "(points alone are a cloud: surfeit index)");
  }
  SURFEIT_ASSIGN_OR_RETURN(const PointTable table,
                           PointTable::read(path, options, default_albedo, curves, progress));
  noteSplines(path, curves, progress);
  std::vector<CurvePoint> points, control;
  std::vector<float> weights;
  const auto for_each = [&](const StrandVisit& visit) -> Status {
    std::size_t corner = 0;
    for (std::size_t strand = 0; strand < curves.corners.size(); ++strand) {
      if (strand % 4096 == 0 && progress.isCancelled()) return Status::interrupted();
      control.clear();
      weights.clear();
      for (std::uint32_t k = 0; k < curves.corners[strand]; ++k, ++corner) {
        control.push_back(table[curves.points[corner]]);
        if (!table.weights().empty()) weights.push_back(table.weights()[curves.points[corner]]);
      }
      const Status status =
          evaluateSpline(curves.bases[curves.basis_of[strand]], control, weights, points);
      if (!status.ok()) {
        return Status::corruption(fmt::format("{}: curve {}: {}", path, strand, status.message()));
      }
      SURFEIT_RETURN_IF_ERROR(visit(strand, points));
    }
    return {};
  };
  return addStrands(path, curves.corners.size(), options, for_each, builder, progress);
}

}  // namespace surfeit
