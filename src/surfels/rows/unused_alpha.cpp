#include "surfels/rows/unused_alpha.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "cloud/rows/channels.h"
#include "surfels/rows/sampled_rows.h"

namespace surfeit {
namespace {

// How many of the rows seen have an alpha below its largest value.
struct AlphaCounts {
  std::uint64_t rows = 0;
  std::uint64_t below_one = 0;   // of reals, which may be from 0 to 1
  std::uint64_t below_code = 0;  // below the largest of the codes
  double most = 0;
};

// Of integers; reals may be codes of 8 bits, too.
double largestCode(ValueType type) { return valueTypeBytes(type) == 2 ? 65535 : 255; }

void count(Bytes rows, std::size_t row_bytes, const RowProperty& alpha, AlphaCounts& counts) {
  const double largest = largestCode(alpha.type);
  visitValueType(alpha.type, [&]<typename T>(std::type_identity<T>) {
    for (std::size_t at = alpha.offset; at < rows.size(); at += row_bytes) {
      T stored;
      std::memcpy(&stored, &rows[at], sizeof stored);
      double value = static_cast<double>(stored);
      // Signed integers of few bits stand for their bits
      if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
        value = static_cast<double>(static_cast<std::make_unsigned_t<T>>(stored));
      }
      ++counts.rows;
      // Written so that NaN is below
      counts.below_one += value >= 1 ? 0 : 1;
      counts.below_code += value >= largest ? 0 : 1;
      if (value > counts.most) counts.most = value;
    }
  });
}

bool isUnit(const RowProperty& alpha, const AlphaCounts& counts) {
  return isFloatType(alpha.type) && counts.most <= 1;
}

std::uint64_t countBelow(const RowProperty& alpha, const AlphaCounts& counts) {
  return isUnit(alpha, counts) ? counts.below_one : counts.below_code;
}

Result<AlphaCounts> look(RowReader& reader, const RowProperty& alpha) {
  AlphaCounts counts;
  constexpr RowSampling kSampling = {.places = 1024, .rows_of_place = 64};
  SURFEIT_RETURN_IF_ERROR(sampleRows(reader, kSampling, [&](Bytes rows) {
    count(rows, reader.element().row_bytes, alpha, counts);
    return counts.rows < kSampling.places * kSampling.rows_of_place ||
           countBelow(alpha, counts) == 0;
  }));
  return counts;
}

}  // namespace

Result<std::string> noteOfUnusedAlpha(RowReader& reader, bool has_opacity) {
  const RowProperty* const alpha = reader.element().find("alpha");
  // In pictures alpha says which pixels there are
  if (alpha == nullptr || alpha->is_list || reader.file().formatName() == "OpenEXR") {
    return std::string();
  }
  SURFEIT_ASSIGN_OR_RETURN(const AlphaCounts counts, look(reader, *alpha));
  const std::uint64_t below = countBelow(*alpha, counts);
  if (below == 0) return std::string();

  const bool is_unit = isUnit(*alpha, counts);
  const std::string what =
      fmt::format("the alpha of {} of {} records looked at is below {} and not used", below,
                  counts.rows, is_unit ? 1 : largestCode(alpha->type));
  const std::string typed = typedNames(reader.element(), "alpha").front();
  if (has_opacity) {
    return fmt::format("{} beside the opacity: --channels {}=- leaves it out", what, typed);
  }
  // An opacity of these types is of 1 or of 65535
  const bool is_scaled = !is_unit && valueTypeBytes(alpha->type) > 2;
  return fmt::format(
      "{0}: {1}--channels {2}=opacity takes it for how opaque surfels are, {2}=- leaves it out",
      what, is_scaled ? "write it as uchar, then " : "", typed);
}

}  // namespace surfeit
