#include "cloud/houdini/bgeo_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>
#include <utility>

#include "cloud/houdini/bgeo_json_walk.h"
#include "cloud/houdini/geo_curves.h"

namespace surfeit {
namespace {

// Numbers that the cursor decodes at once.
constexpr std::uint64_t kMostNumbers = 4096;

// Polygons that follow each other, or one that lists its vertices.
struct PolygonRun {
  bool is_closed = true, is_listed = false, is_rle = false;
  std::uint64_t start = 0, count = 0;
  std::vector<std::uint32_t> numbers;  // of vertices of each; with times; or the vertices
  HoudiniBasis basis;
};

// What stands in front of a primitive.
struct PrimitiveHead {
  std::string type, run_type;
  std::vector<std::string> varying;
  bool is_closed = true;  // of a run of Houdini 12, where it is the same for all
  HoudiniBasis basis;     // likewise
};

constexpr std::uint32_t kMostOrder = 32;

HoudiniBasis::Kind kindOf(std::string_view type) {
  if (type == "NURBCurve") return HoudiniBasis::Kind::kNurbs;
  return type == "BezierCurve" ? HoudiniBasis::Kind::kBezier : HoudiniBasis::Kind::kPolygon;
}

class CurveReader : private BgeoJsonWalk {
 public:
  explicit CurveReader(SpooledInput& input) : BgeoJsonWalk(input), path_(input.path()) {}

  Result<HoudiniCurves> read() {
    SURFEIT_RETURN_IF_ERROR(cursor_.start());
    SURFEIT_RETURN_IF_ERROR(readPairs([&](const std::string& key) -> Status {
      if (key == "pointcount") return readCount(point_count_);
      if (key == "topology") return readTopology();
      if (key == "primitives") {
        return readItems([&](const JsonToken& token) { return readPrimitive(token); });
      }
      return skipValue();
    }));
    for (const PolygonRun& run : runs_) SURFEIT_RETURN_IF_ERROR(resolve(run));
    return std::move(curves_);
  }

 private:
  Status readTopology() {
    return readPairs([&](const std::string& key) -> Status {
      if (key != "pointref") return skipValue();
      return readPairs([&](const std::string& inner) {
        return inner == "indices" ? readIndices(topology_) : skipValue();
      });
    });
  }

  // An array of numbers from 0 on.
  Status readIndices(std::vector<std::uint32_t>& indices) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    return readIndicesFrom(token, indices);
  }

  Status readIndicesFrom(const JsonToken& token, std::vector<std::uint32_t>& indices) {
    indices.clear();
    if (token.kind == Kind::kUniformArray) {
      std::vector<double> numbers;
      JsonToken part = token;
      for (std::uint64_t done = 0; done < token.length; done += part.length) {
        part.length = std::min(kMostNumbers, token.length - done);
        SURFEIT_RETURN_IF_ERROR(cursor_.readNumbers(part, numbers));
        for (const double number : numbers) SURFEIT_RETURN_IF_ERROR(addIndex(number, indices));
        part.offset += part.length * (token.type ? storedBytes(*token.type) : 0);
      }
      return {};
    }
    if (token.kind != Kind::kArrayBegin) return cursor_.damaged("expected numbers");
    JsonToken item;
    while (true) {
      SURFEIT_RETURN_IF_ERROR(cursor_.next(item));
      if (item.kind == Kind::kArrayEnd) return {};
      if (item.kind != Kind::kInteger) return cursor_.damaged("expected a number");
      SURFEIT_RETURN_IF_ERROR(addIndex(item.real, indices));
    }
  }

  Status addIndex(double number, std::vector<std::uint32_t>& indices) {
    if (!(number >= 0 && number < double(std::numeric_limits<std::uint32_t>::max()))) {
      return cursor_.damaged(fmt::format("found {}, expected a number from 0 to 2^32 - 2", number));
    }
    indices.push_back(static_cast<std::uint32_t>(number));
    return {};
  }

  Status readBool(bool& value) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    if (token.kind != Kind::kBool) return cursor_.damaged("expected true or false");
    value = token.integer != 0;
    return {};
  }

  // --- Primitives ---

  Status readPrimitive(const JsonToken& begin) {
    if (begin.kind != Kind::kArrayBegin) return cursor_.damaged("expected a primitive");
    PrimitiveHead head;
    SURFEIT_RETURN_IF_ERROR(readHead(head));
    const std::string& type = head.type == "run" ? head.run_type : head.type;
    const bool is_face = type == "Poly" || kindOf(type) != HoudiniBasis::Kind::kPolygon;
    if (type == "PolygonCurve_run" || type == "c_r") {
      SURFEIT_RETURN_IF_ERROR(readRun(false));
    } else if (type == "Polygon_run" || type == "p_r") {
      SURFEIT_RETURN_IF_ERROR(readRun(true));
    } else if (is_face && head.type == "run") {
      head.basis.kind = kindOf(type);
      SURFEIT_RETURN_IF_ERROR(readOldRun(head));
    } else if (is_face) {
      SURFEIT_RETURN_IF_ERROR(readPolygon(kindOf(type)));
    } else {
      ++curves_.others[type.substr(0, 64)];
      if (curves_.others.size() > 256) return cursor_.damaged("too many types of primitives");
      SURFEIT_RETURN_IF_ERROR(skipValue());
    }
    JsonToken end;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(end));
    if (end.kind != Kind::kArrayEnd) return cursor_.damaged("expected the end of a primitive");
    return {};
  }

  Status readHead(PrimitiveHead& head) {
    return readPairs([&](const std::string& key) -> Status {
      if (key == "type") return readText(head.type);
      if (key == "runtype") return readText(head.run_type);
      if (key == "uniformfields") {
        return readPairs([&](const std::string& field) -> Status {
          if (field == "basis") return readBasis(head.basis);
          return field == "closed" ? readBool(head.is_closed) : skipValue();
        });
      }
      if (key != "varyingfields") return skipValue();
      JsonToken token;
      SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      if (token.kind != Kind::kArrayBegin) return cursor_.skip(token);
      while (true) {
        SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
        if (token.kind == Kind::kArrayEnd) return {};
        if (token.kind != Kind::kText || head.varying.size() == 64) {
          return cursor_.damaged("expected names of fields");
        }
        head.varying.push_back(token.text);
      }
    });
  }

  Status readRun(bool is_closed) {
    PolygonRun run;
    run.is_closed = is_closed;
    SURFEIT_RETURN_IF_ERROR(readPairs([&](const std::string& key) -> Status {
      if (key == "startvertex" || key == "s_v") return readCount(run.start);
      if (key == "nprimitives" || key == "n_p") return readCount(run.count);
      run.is_rle = run.is_rle || key == "nvertices_rle" || key == "r_v";
      const bool is_counts =
          key == "nvertices" || key == "n_v" || key == "nvertices_rle" || key == "r_v";
      return is_counts ? readIndices(run.numbers) : skipValue();
    }));
    runs_.push_back(std::move(run));
    return {};
  }

  Status readBasis(HoudiniBasis& basis) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    return readBasisFrom(token, basis);
  }

  // Its kind stays.
  Status readBasisFrom(const JsonToken& begin, HoudiniBasis& basis) {
    return readPairsFrom(begin, [&](const std::string& key) -> Status {
      if (key == "endinterpolation") return readBool(basis.has_ends);
      if (key == "knots") return readKnots(basis.knots);
      if (key != "order") return skipValue();
      std::uint64_t order = 0;
      SURFEIT_RETURN_IF_ERROR(readCount(order));
      if (order < 2 || order > kMostOrder) {
        return cursor_.damaged(
            fmt::format("a curve of order {}, expected 2 to {}", order, kMostOrder));
      }
      basis.order = static_cast<std::uint32_t>(order);
      return {};
    });
  }

  Status readKnots(std::vector<float>& knots) {
    knots.clear();
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    if (token.kind == Kind::kUniformArray) {
      std::vector<double> numbers;
      JsonToken part = token;
      for (std::uint64_t done = 0; done < token.length; done += part.length) {
        part.length = std::min(kMostNumbers, token.length - done);
        SURFEIT_RETURN_IF_ERROR(cursor_.readNumbers(part, numbers));
        knots.insert(knots.end(), numbers.begin(), numbers.end());
        part.offset += part.length * (token.type ? storedBytes(*token.type) : 0);
      }
      return {};
    }
    if (token.kind != Kind::kArrayBegin) return cursor_.damaged("expected knots");
    while (true) {
      SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      if (token.kind == Kind::kArrayEnd) return {};
      if (token.kind != Kind::kInteger && token.kind != Kind::kReal) {
        return cursor_.damaged("expected a knot");
      }
      knots.push_back(static_cast<float>(token.real));
    }
  }

  Status readPolygon(HoudiniBasis::Kind kind) {
    PolygonRun run;
    run.is_listed = true;
    run.basis.kind = kind;
    SURFEIT_RETURN_IF_ERROR(readPairs([&](const std::string& key) -> Status {
      if (key == "vertex") return readIndices(run.numbers);
      if (key == "basis") return readBasis(run.basis);
      return key == "closed" ? readBool(run.is_closed) : skipValue();
    }));
    runs_.push_back(std::move(run));
    return {};
  }

  // A list of the values that differ, for each polygon.
  Status readOldRun(const PrimitiveHead& head) {
    return readItems([&](const JsonToken& begin) -> Status {
      if (begin.kind != Kind::kArrayBegin) return cursor_.damaged("expected fields of a polygon");
      PolygonRun run;
      run.is_listed = true;
      run.is_closed = head.is_closed;
      run.basis = head.basis;
      JsonToken token;
      for (std::size_t field = 0;; ++field) {
        SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
        if (token.kind == Kind::kArrayEnd) break;
        const std::string name = field < head.varying.size() ? head.varying[field]
                                 : field == 0                ? "vertex"
                                                             : "";
        if (name == "vertex") {
          SURFEIT_RETURN_IF_ERROR(readIndicesFrom(token, run.numbers));
        } else if (name == "basis" && token.kind != Kind::kUniformArray) {
          SURFEIT_RETURN_IF_ERROR(readBasisFrom(token, run.basis));
        } else if (name == "closed" && token.kind == Kind::kBool) {
          run.is_closed = token.integer != 0;
        } else {
          SURFEIT_RETURN_IF_ERROR(cursor_.skip(token));
        }
      }
      runs_.push_back(std::move(run));
      return {};
    });
  }

  // --- Curves ---

  Status resolve(const PolygonRun& run) {
    if (run.is_closed) {
      curves_.closed_polygons += run.is_listed ? 1 : run.count;
      return {};
    }
    if (run.is_listed) {
      for (const std::uint32_t vertex : run.numbers) SURFEIT_RETURN_IF_ERROR(addVertex(vertex));
      curves_.corners.push_back(static_cast<std::uint32_t>(run.numbers.size()));
      curves_.addBasis(run.basis);
      return {};
    }
    std::uint64_t vertex = run.start, count = 0;
    for (std::size_t i = 0; i < run.numbers.size(); i += run.is_rle ? 2 : 1) {
      if (run.is_rle && i + 1 == run.numbers.size()) break;
      const std::uint32_t corners = run.numbers[i];
      const std::uint32_t times = run.is_rle ? run.numbers[i + 1] : 1;
      // Each takes a vertex at least, so that the vertices that there are bound the loop
      for (std::uint32_t k = 0; k < times; ++k, ++count, vertex += corners) {
        if (corners == 0 || vertex + corners > topology_.size()) {
          return noSuchVertices(vertex, corners);
        }
        for (std::uint32_t v = 0; v < corners; ++v) {
          SURFEIT_RETURN_IF_ERROR(addVertex(vertex + v));
        }
        curves_.corners.push_back(corners);
        curves_.addBasis(run.basis);
      }
    }
    if (count == run.count) return {};
    return Status::corruption(fmt::format("{}: a run of {} curves has numbers of vertices for {}",
                                          path_, run.count, count));
  }

  Status addVertex(std::uint64_t vertex) {
    if (vertex >= topology_.size()) return noSuchVertices(vertex, 1);
    const std::uint32_t point = topology_[static_cast<std::size_t>(vertex)];
    if (point >= point_count_) {
      return Status::corruption(fmt::format("{}: curve {}: point {}, expected less than {}", path_,
                                            curves_.corners.size(), point, point_count_));
    }
    curves_.points.push_back(point);
    return {};
  }

  Status noSuchVertices(std::uint64_t vertex, std::uint64_t corners) const {
    return Status::corruption(
        fmt::format("{}: curve {}: {} vertices from {} on, expected one or more of {}", path_,
                    curves_.corners.size(), corners, vertex, topology_.size()));
  }

  const std::string path_;
  std::uint64_t point_count_ = 0;
  std::vector<std::uint32_t> topology_;  // point of each vertex
  std::vector<PolygonRun> runs_;
  HoudiniCurves curves_;
};

}  // namespace

Result<HoudiniCurves> readHoudiniCurves(const std::string& path) {
  std::array<char, 12> begin{};
  SURFEIT_ASSIGN_OR_RETURN(ByteInput bytes, ByteInput::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size,
                           bytes.readSome(0, std::as_writable_bytes(std::span(begin))));
  const std::string_view first(begin.data(), size);
  if (first.starts_with("BgeoV")) return readGeoCurves(path);
  if (first.starts_with("PGEOMETRY V5")) return readGeoTextCurves(path);
  SURFEIT_ASSIGN_OR_RETURN(SpooledInput input, SpooledInput::open(path, Access::kCached));
  return CurveReader(input).read();
}

}  // namespace surfeit
