#include "cloud/houdini/geo_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>

#include "cloud/houdini/geo_parts.h"
#include "cloud/parts/spooled_input.h"

namespace surfeit {
namespace {

constexpr std::size_t kHeaderBytes = 41, kWordBytes = 4;
constexpr std::int32_t kVersion = 5;
constexpr std::uint32_t kRun = 0xFFFFFFFF, kMostAttributes = 1024, kMostStrings = 1 << 20;
constexpr std::uint32_t kMostOrder = 32;
constexpr std::int32_t kString = 2, kIndexedString = 4, kVector = 5;
constexpr std::size_t kMostRecordBytes = 16 << 10;

class BinaryGeo {
 public:
  explicit BinaryGeo(SpooledInput input) : input_(std::move(input)), path_(input_.path()) {}

  Result<HoudiniCurves> read() {
    std::array<std::uint32_t, 9> counts{};  // version, points, primitives, groups, attributes
    at_ = 5;
    for (std::uint32_t& count : counts) SURFEIT_RETURN_IF_ERROR(next(count));
    if (counts[0] != std::uint32_t{kVersion}) {
      return damaged(5, fmt::format("version {}, expected {}", counts[0], kVersion));
    }
    points_ = counts[1];
    std::size_t point_bytes = 4 * kWordBytes, vertex_bytes = 0, primitive_bytes = 0;
    SURFEIT_RETURN_IF_ERROR(readAttributes(counts[5], point_bytes));
    SURFEIT_RETURN_IF_ERROR(readWeights(point_bytes));
    SURFEIT_RETURN_IF_ERROR(readAttributes(counts[6], vertex_bytes));
    SURFEIT_RETURN_IF_ERROR(readAttributes(counts[7], primitive_bytes));
    vertex_bytes_ = vertex_bytes;
    primitive_bytes_ = primitive_bytes;
    for (std::uint32_t done = 0; done < counts[2];) {
      std::uint32_t type = 0;
      std::uint16_t times = 1;
      SURFEIT_RETURN_IF_ERROR(next(type));
      if (type == kRun) {
        SURFEIT_RETURN_IF_ERROR(next(times));
        SURFEIT_RETURN_IF_ERROR(next(type));
      }
      if (times == 0) return damaged(at_, "a run of no primitives");
      for (std::uint16_t i = 0; i < times && done < counts[2]; ++i, ++done) {
        SURFEIT_RETURN_IF_ERROR(readPrimitive(type));
      }
    }
    return std::move(curves_);
  }

 private:
  Status damaged(std::uint64_t at, std::string_view what) const {
    return Status::corruption(fmt::format("{}: byte {}: {}", path_, at, what));
  }

  // The next bytes, at most kWindowBytes.
  Result<const std::byte*> take(std::size_t bytes) {
    const bool is_held = at_ >= window_begin_ && at_ + bytes <= window_begin_ + window_.size();
    if (!is_held) {
      const std::uint64_t left = input_.size() - std::min(input_.size(), at_);
      if (bytes > left) {
        return damaged(at_, fmt::format("file ends early: {} bytes, expected {}", left, bytes));
      }
      window_begin_ = at_;
      SURFEIT_ASSIGN_OR_RETURN(
          window_,
          input_.readView(at_, std::size_t(std::min<std::uint64_t>(left, kWindowBytes)), buffer_));
    }
    const std::byte* const found = window_.data() + (at_ - window_begin_);
    at_ += bytes;
    return found;
  }

  template <typename T>
  Status next(T& value) {
    SURFEIT_ASSIGN_OR_RETURN(const std::byte* const bytes, take(sizeof(T)));
    std::array<std::byte, sizeof(T)> reversed;
    std::reverse_copy(bytes, bytes + sizeof(T), reversed.begin());
    value = std::bit_cast<T>(reversed);
    return {};
  }

  // Names, sizes, types and defaults; `bytes` grow by those of a record.
  Status readAttributes(std::uint32_t count, std::size_t& bytes) {
    if (count > kMostAttributes) return damaged(at_, fmt::format("{} attributes", count));
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint64_t begin = at_;
      std::uint16_t length = 0, values = 0;
      std::int32_t type = 0;
      SURFEIT_RETURN_IF_ERROR(next(length));
      at_ += length;
      SURFEIT_RETURN_IF_ERROR(next(values));
      SURFEIT_RETURN_IF_ERROR(next(type));
      if (type == kIndexedString) {
        std::uint32_t strings = 0;
        SURFEIT_RETURN_IF_ERROR(next(strings));
        if (strings > kMostStrings) return damaged(begin, fmt::format("{} strings", strings));
        for (std::uint32_t k = 0; k < strings; ++k) {
          SURFEIT_RETURN_IF_ERROR(next(length));
          at_ += length;
        }
        bytes += kWordBytes * values;
        continue;
      }
      if (type < 0 || type > kVector || type == 3) {
        return damaged(begin,
                       fmt::format("an attribute of type {}, expected 0, 1, 2, 4 or 5", type));
      }
      const std::size_t record = (type == kString ? 1 : kWordBytes) * std::size_t{values};
      at_ += record;  // defaults
      bytes += record;
    }
    return bytes <= kMostRecordBytes ? Status() : damaged(at_, "records of too many bytes");
  }

  Status readWeights(std::size_t record_bytes) {
    for (std::uint32_t i = 0; i < points_; ++i) {
      SURFEIT_ASSIGN_OR_RETURN(const std::byte* const record, take(record_bytes));
      std::array<std::byte, kWordBytes> reversed;
      std::reverse_copy(record + 3 * kWordBytes, record + 4 * kWordBytes, reversed.begin());
      curves_.addWeight(i, std::bit_cast<float>(reversed));
    }
    return {};
  }

  Status readPrimitive(std::uint32_t type_number) {
    const std::uint64_t begin = at_;
    const GeoType type{type_number};
    const bool is_known = type == GeoType::kPoly || type == GeoType::kNurbs ||
                          type == GeoType::kBezier || type == GeoType::kParticles;
    if (!is_known) return unknownGeoPrimitive(path_, begin, fmt::format("{:x}h", type_number));
    std::uint32_t count = 0;
    SURFEIT_RETURN_IF_ERROR(next(count));
    const std::size_t index_bytes = points_ <= 65535 ? 2 : 4;
    if (count > (input_.size() - std::min(input_.size(), at_)) / (index_bytes + vertex_bytes_)) {
      return damaged(begin, fmt::format("{} vertices, more than the file has", count));
    }
    bool is_closed = false;
    HoudiniBasis basis;
    if (type != GeoType::kParticles) {
      std::uint8_t flag = 0;
      SURFEIT_RETURN_IF_ERROR(next(flag));
      is_closed = flag == '<';
      SURFEIT_RETURN_IF_ERROR(readBasis(type, count, is_closed, basis));
    }
    vertices_.clear();
    for (std::uint32_t i = 0; i < count; ++i) SURFEIT_RETURN_IF_ERROR(readVertex(index_bytes));
    at_ += primitive_bytes_;
    if (at_ > input_.size()) {
      return damaged(begin, fmt::format("file ends early, in a primitive of {} vertices", count));
    }
    addGeoCurve(type, is_closed, std::move(basis), vertices_, curves_);
    return {};
  }

  Status readVertex(std::size_t index_bytes) {
    std::uint16_t near = 0;
    std::uint32_t point = 0;
    if (index_bytes == 2) {
      SURFEIT_RETURN_IF_ERROR(next(near));
      point = near;
    } else {
      SURFEIT_RETURN_IF_ERROR(next(point));
    }
    if (point >= points_) {
      return damaged(at_, fmt::format("point {}, expected less than {}", point, points_));
    }
    vertices_.push_back(point);
    at_ += vertex_bytes_;
    return {};
  }

  Status readBasis(GeoType type, std::uint32_t vertices, bool is_closed, HoudiniBasis& basis) {
    if (type == GeoType::kPoly) return {};
    basis.kind = type == GeoType::kNurbs ? HoudiniBasis::Kind::kNurbs : HoudiniBasis::Kind::kBezier;
    const std::uint64_t begin = at_;
    SURFEIT_RETURN_IF_ERROR(next(basis.order));
    if (basis.order < 2 || basis.order > kMostOrder) {
      return damaged(begin,
                     fmt::format("a curve of order {}, expected 2 to {}", basis.order, kMostOrder));
    }
    bool has_knots = true;
    if (type == GeoType::kNurbs) {
      std::uint16_t ends = 0, unused = 0;
      SURFEIT_RETURN_IF_ERROR(next(ends));
      SURFEIT_RETURN_IF_ERROR(next(unused));
      basis.has_ends = ends != 0;
    } else {
      std::uint8_t uses = 0;
      SURFEIT_RETURN_IF_ERROR(next(uses));
      has_knots = uses != 0;
    }
    const std::size_t knots = has_knots ? geoKnotCount(basis, vertices, is_closed) : 0;
    for (std::size_t i = 0; i < knots; ++i) {
      float knot = 0;
      SURFEIT_RETURN_IF_ERROR(next(knot));
      basis.knots.push_back(knot);
    }
    return {};
  }

  static constexpr std::size_t kWindowBytes = 256 << 10;

  SpooledInput input_;
  const std::string path_;
  std::uint64_t at_ = 0, window_begin_ = 0;
  Bytes window_;
  AlignedBuffer buffer_;
  std::uint32_t points_ = 0;
  std::size_t vertex_bytes_ = 0, primitive_bytes_ = 0;
  std::vector<std::uint32_t> vertices_;
  HoudiniCurves curves_;
};

}  // namespace

Result<HoudiniCurves> readGeoCurves(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(SpooledInput input, SpooledInput::open(path, Access::kCached));
  return BinaryGeo(std::move(input)).read();
}

}  // namespace surfeit
