#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "cloud/houdini/geo_curves.h"
#include "cloud/houdini/geo_parts.h"
#include "cloud/houdini/geo_words.h"
#include "cloud/ply/ply_number.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic = "PGEOMETRY V5", kOwnWords = "()[]";
constexpr std::uint32_t kMostAttributes = 1024, kMostDefaults = 1 << 20, kMostOrder = 32;

class TextGeo {
 public:
  explicit TextGeo(ByteInput input) : path_(input.path()), words_(std::move(input), kOwnWords) {}

  Result<HoudiniCurves> read() {
    words_.moveTo(kMagic.size());
    constexpr std::array<std::string_view, 8> kNames = {
        "NPoints",      "NPrims",        "NPointGroups", "NPrimGroups",
        "NPointAttrib", "NVertexAttrib", "NPrimAttrib",  "NAttrib"};
    std::array<std::uint32_t, 8> counts{};
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      SURFEIT_RETURN_IF_ERROR(expect(kNames[i]));
      SURFEIT_RETURN_IF_ERROR(number(counts[i]));
    }
    points_ = counts[0];
    SURFEIT_RETURN_IF_ERROR(readAttributes("PointAttrib", counts[4]));
    for (std::uint32_t i = 0; i < points_; ++i) {
      float value = 0;
      for (int k = 0; k < 4; ++k) SURFEIT_RETURN_IF_ERROR(number(value));
      curves_.addWeight(i, value);
      if (counts[4] > 0) SURFEIT_RETURN_IF_ERROR(skipGroup("(", ")"));
    }
    SURFEIT_RETURN_IF_ERROR(readAttributes("VertexAttrib", counts[5]));
    SURFEIT_RETURN_IF_ERROR(readAttributes("PrimitiveAttrib", counts[6]));
    has_vertex_attributes_ = counts[5] > 0;
    has_primitive_attributes_ = counts[6] > 0;
    for (std::uint32_t done = 0; done < counts[1];) {
      std::uint32_t times = 1;
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      if (word_ == "Run") {
        SURFEIT_RETURN_IF_ERROR(number(times));
        SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      }
      const std::string type(word_);
      if (times == 0) return unexpected("a number of primitives");
      for (std::uint32_t i = 0; i < times && done < counts[1]; ++i, ++done) {
        SURFEIT_RETURN_IF_ERROR(readPrimitive(type));
      }
    }
    return std::move(curves_);
  }

 private:
  Status unexpected(std::string_view expected) const {
    return Status::corruption(
        fmt::format("{}: byte {}: found {}, expected {}", path_, words_.offset(),
                    word_.empty() ? "the end of the file" : quoteText(word_), expected));
  }
  Status expect(std::string_view expected) {
    SURFEIT_RETURN_IF_ERROR(words_.next(word_));
    return word_ == expected ? Status() : unexpected(quoteText(expected));
  }
  template <typename T>
  Status number(T& value) {
    constexpr ValueType kType = std::is_same_v<T, float> ? ValueType::kFloat32 : ValueType::kUint32;
    SURFEIT_RETURN_IF_ERROR(words_.next(word_));
    return parsePlyNumber(word_, kType, reinterpret_cast<std::byte*>(&value))
               ? Status()
               : unexpected("a number");
  }
  // From `open` to the next `close`.
  Status skipGroup(std::string_view open, std::string_view close) {
    SURFEIT_RETURN_IF_ERROR(expect(open));
    do {
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      if (word_.empty()) return unexpected(quoteText(close));
    } while (word_ != close);
    return {};
  }

  // A label, and for each: name, components, type, defaults.
  Status readAttributes(std::string_view label, std::uint32_t count) {
    if (count == 0) return {};
    if (count > kMostAttributes) return unexpected(fmt::format("at most {}", kMostAttributes));
    SURFEIT_RETURN_IF_ERROR(expect(label));
    for (std::uint32_t i = 0; i < count; ++i) {
      std::uint32_t defaults = 0;
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      SURFEIT_RETURN_IF_ERROR(number(defaults));
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      const bool is_index = word_ == "index", is_text = word_ == "char";
      if (!is_index && !is_text && word_ != "float" && word_ != "int" && word_ != "vector") {
        return unexpected("float, int, vector, index or char");
      }
      if (is_text) defaults = 1;
      if (is_index) SURFEIT_RETURN_IF_ERROR(number(defaults));
      if (defaults > kMostDefaults) return unexpected(fmt::format("at most {}", kMostDefaults));
      for (std::uint32_t k = 0; k < defaults; ++k) {
        SURFEIT_RETURN_IF_ERROR(words_.next(word_));
        if (word_.empty()) return unexpected("a default");
      }
    }
    return {};
  }

  Status readPrimitive(const std::string& name) {
    GeoType type = GeoType::kPoly;
    if (name == "NURBCurve") {
      type = GeoType::kNurbs;
    } else if (name == "BezierCurve") {
      type = GeoType::kBezier;
    } else if (name == "Part") {
      type = GeoType::kParticles;
    } else if (name != "Poly") {
      return unknownGeoPrimitive(path_, words_.offset(), quoteText(name));
    }
    std::uint32_t count = 0;
    SURFEIT_RETURN_IF_ERROR(number(count));
    bool is_closed = false;
    HoudiniBasis basis;
    if (type != GeoType::kParticles) {
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      is_closed = word_ == "<";
      if (!is_closed && word_ != ":") return unexpected("< or :");
      SURFEIT_RETURN_IF_ERROR(readBasis(type, count, is_closed, basis));
    }
    vertices_.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
      std::uint32_t point = 0;
      SURFEIT_RETURN_IF_ERROR(number(point));
      if (point >= points_) return unexpected(fmt::format("a point below {}", points_));
      vertices_.push_back(point);
      if (has_vertex_attributes_) SURFEIT_RETURN_IF_ERROR(skipGroup("(", ")"));
    }
    if (has_primitive_attributes_) SURFEIT_RETURN_IF_ERROR(skipGroup("[", "]"));
    addGeoCurve(type, is_closed, std::move(basis), vertices_, curves_);
    return {};
  }

  Status readBasis(GeoType type, std::uint32_t vertices, bool is_closed, HoudiniBasis& basis) {
    if (type == GeoType::kPoly) return {};
    basis.kind = type == GeoType::kNurbs ? HoudiniBasis::Kind::kNurbs : HoudiniBasis::Kind::kBezier;
    SURFEIT_RETURN_IF_ERROR(expect("Basis"));
    SURFEIT_RETURN_IF_ERROR(number(basis.order));
    if (basis.order < 2 || basis.order > kMostOrder) {
      return unexpected(fmt::format("an order from 2 to {}", kMostOrder));
    }
    if (type == GeoType::kNurbs) {
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      basis.has_ends = word_ == "end";
      if (!basis.has_ends && word_ != "noend") return unexpected("end or noend");
    } else {
      const std::uint64_t behind = words_.nextOffset();
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      if (word_ != "use") {
        words_.moveTo(behind);
        return {};
      }
    }
    for (std::size_t i = geoKnotCount(basis, vertices, is_closed); i > 0; --i) {
      float knot = 0;
      SURFEIT_RETURN_IF_ERROR(number(knot));
      basis.knots.push_back(knot);
    }
    return {};
  }

  const std::string path_;
  GeoWords words_;
  std::string_view word_;
  std::uint32_t points_ = 0;
  bool has_vertex_attributes_ = false, has_primitive_attributes_ = false;
  std::vector<std::uint32_t> vertices_;
  HoudiniCurves curves_;
};

}  // namespace

Result<HoudiniCurves> readGeoTextCurves(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  return TextGeo(std::move(input)).read();
}

}  // namespace surfeit
