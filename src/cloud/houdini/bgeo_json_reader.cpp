#include "cloud/houdini/bgeo_json_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "cloud/houdini/bgeo_json_walk.h"
#include "cloud/houdini/geo_notes.h"
#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/column_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxAttributes = 1024, kMaxComponents = 256, kMaxRowBytes = 16 << 10;
// Houdini has 1024; smaller pages cost memory for their flags, larger ones let a few bytes stand
// for any number of points
constexpr std::uint64_t kLeastPageRows = 16, kMostPageRows = 1 << 16;
constexpr std::size_t kSpoolBytes = 64 << 10;

// An array of numbers, in the file or in the spool.
struct NumberArray {
  bool is_found = false, is_spooled = false;
  StoredType type = StoredType::kFloat32;
  std::uint64_t offset = 0, length = 0;
};

// What the file says of an attribute, before it is held against the count of points.
struct Attribute {
  std::string name, type;
  std::size_t components = 1;
  std::string storage;
  std::uint64_t page_rows = 0;
  std::vector<std::size_t> packing;
  std::vector<std::vector<bool>> constant;
  NumberArray pages, tuples;
  std::vector<NumberArray> arrays;  // by component
};

class BgeoJsonReader final : public ColumnRowReader, private BgeoJsonWalk {
 public:
  explicit BgeoJsonReader(SpooledInput input)
      : ColumnRowReader(std::move(input)), BgeoJsonWalk(input_) {
    path_ = input_.path();
    element_.name = "vertex";
    format_name_ = "BGEO (binary JSON)";
  }

  Status open(const RowReaderOptions& options) {
    SURFEIT_RETURN_IF_ERROR(cursor_.start());
    bool has_count = false, has_attributes = false;
    SURFEIT_RETURN_IF_ERROR(readPairs([&](const std::string& key) -> Status {
      if (key == "pointcount") {
        has_count = true;
        return readCount(element_.count);
      }
      if (key == "primitivecount") return readPrimitiveCount();
      if (key != "attributes") return skipValue();
      has_attributes = true;
      return readPairs([&](const std::string& kind) {
        return kind == "pointattributes" ? readAttributes() : skipValue();
      });
    }));
    if (std::string note = noteOfBytesBehind(input_.size() - cursor_.offset(), "value");
        !note.empty()) {
      notes_.push_back(std::move(note));
    }
    if (!has_count || !has_attributes) {
      return Status::corruption(path_ + ": no pointcount or no attributes, expected geometry");
    }
    if (spool_) SURFEIT_RETURN_IF_ERROR(flushSpool());
    for (Attribute& attribute : attributes_) SURFEIT_RETURN_IF_ERROR(place(attribute, options));
    if (element_.properties.empty()) {
      return Status::corruption(path_ + ": no point attributes, expected at least P");
    }
    attributes_.clear();
    return {};
  }

 private:
  Status readPrimitiveCount() {
    std::uint64_t primitives = 0;
    SURFEIT_RETURN_IF_ERROR(readCount(primitives));
    std::string note = noteOfGeoPrimitives(primitives);
    if (!note.empty()) notes_.push_back(std::move(note));
    return {};
  }

  // --- Attributes ---

  Status readAttributes() {
    return readItems([&](const JsonToken& begin) -> Status {
      if (begin.kind != Kind::kArrayBegin) return cursor_.damaged("expected an attribute");
      if (attributes_.size() == kMaxAttributes) {
        return cursor_.damaged(fmt::format("more than {} attributes", kMaxAttributes));
      }
      Attribute attribute;
      SURFEIT_RETURN_IF_ERROR(readPairs([&](const std::string& key) -> Status {
        if (key == "name") return readText(attribute.name);
        if (key == "type") return readText(attribute.type);
        return skipValue();
      }));
      SURFEIT_RETURN_IF_ERROR(readPairs([&](const std::string& key) -> Status {
        if (key == "values" || key == "indices") return readValues(attribute);
        return skipValue();
      }));
      JsonToken end;
      SURFEIT_RETURN_IF_ERROR(cursor_.next(end));
      if (end.kind != Kind::kArrayEnd) return cursor_.damaged("expected the end of an attribute");
      attributes_.push_back(std::move(attribute));
      return {};
    });
  }

  Status readValues(Attribute& attribute) {
    return readPairs([&](const std::string& key) -> Status {
      if (key == "size") {
        std::uint64_t size = 0;
        SURFEIT_RETURN_IF_ERROR(readCount(size));
        if (size < 1 || size > kMaxComponents) {
          return cursor_.damaged(
              fmt::format("{} components, expected 1 to {}", size, kMaxComponents));
        }
        attribute.components = static_cast<std::size_t>(size);
        return {};
      }
      if (key == "storage") return readText(attribute.storage);
      if (key == "pagesize") return readCount(attribute.page_rows);
      if (key == "packing") return readPacking(attribute.packing);
      if (key == "constantpageflags") return readFlags(attribute.constant);
      if (key == "rawpagedata") return readNumbers(attribute, attribute.pages);
      if (key == "tuples") return readTuples(attribute);
      if (key == "arrays") return readArrays(attribute);
      return skipValue();
    });
  }

  Status readPacking(std::vector<std::size_t>& packing) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    std::vector<double> sizes;
    if (token.kind == Kind::kUniformArray) {
      SURFEIT_RETURN_IF_ERROR(cursor_.readNumbers(token, sizes));
    } else if (token.kind == Kind::kArrayBegin) {
      SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      while (token.kind == Kind::kInteger && sizes.size() <= kMaxComponents) {
        sizes.push_back(token.real);
        SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      }
      if (token.kind != Kind::kArrayEnd) return cursor_.damaged("expected numbers of components");
    }
    packing.clear();
    for (const double size : sizes) {
      if (!(size >= 1 && size <= double{kMaxComponents})) {
        return cursor_.damaged("a slice without components");
      }
      packing.push_back(static_cast<std::size_t>(size));
    }
    return {};
  }

  // By slice: bools, in any kind of array.
  Status readFlags(std::vector<std::vector<bool>>& flags) {
    flags.clear();
    return readItems([&](const JsonToken& token) -> Status {
      if (flags.size() == kMaxComponents) return cursor_.damaged("too many slices");
      flags.emplace_back();
      if (token.kind == Kind::kUniformArray && token.is_bools) {
        return cursor_.readBools(token, flags.back());
      }
      if (token.kind == Kind::kUniformArray && token.length == 0) return {};
      if (token.kind != Kind::kArrayBegin) return cursor_.damaged("expected flags of pages");
      JsonToken flag;
      SURFEIT_RETURN_IF_ERROR(cursor_.next(flag));
      while (flag.kind == Kind::kBool) {
        flags.back().push_back(flag.integer != 0);
        SURFEIT_RETURN_IF_ERROR(cursor_.next(flag));
      }
      if (flag.kind != Kind::kArrayEnd) return cursor_.damaged("expected flags of pages");
      return {};
    });
  }

  // --- Numbers ---

  // An array of numbers: where it stands, or, value by value, in the spool.
  Status readNumbers(const Attribute& attribute, NumberArray& numbers) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    return readNumbersFrom(token, attribute, numbers);
  }

  Status readNumbersFrom(const JsonToken& token, const Attribute& attribute, NumberArray& numbers) {
    if (token.kind == Kind::kUniformArray && token.type) {
      numbers = {true, false, *token.type, token.offset, token.length};
      return {};
    }
    if (token.kind != Kind::kArrayBegin) return cursor_.damaged("expected numbers");
    SURFEIT_RETURN_IF_ERROR(beginSpooled(attribute, numbers));
    return spoolItems(numbers);
  }

  // Arrays of components, one per point: all in a row in the spool.
  Status readTuples(Attribute& attribute) {
    SURFEIT_RETURN_IF_ERROR(beginSpooled(attribute, attribute.tuples));
    return readItems([&](const JsonToken& token) -> Status {
      const std::uint64_t before = attribute.tuples.length;
      if (token.kind == Kind::kUniformArray) {
        SURFEIT_RETURN_IF_ERROR(cursor_.readNumbers(token, numbers_));
        for (const double number : numbers_) {
          SURFEIT_RETURN_IF_ERROR(spoolNumber(number, attribute.tuples));
        }
      } else if (token.kind == Kind::kArrayBegin) {
        SURFEIT_RETURN_IF_ERROR(spoolItems(attribute.tuples));
      } else if (token.kind == Kind::kInteger || token.kind == Kind::kReal) {
        SURFEIT_RETURN_IF_ERROR(spoolNumber(token.real, attribute.tuples));
      }
      if (attribute.tuples.length - before == attribute.components) return {};
      return cursor_.damaged(fmt::format("{} components, expected {}",
                                         attribute.tuples.length - before, attribute.components));
    });
  }

  Status readArrays(Attribute& attribute) {
    attribute.arrays.clear();
    return readItems([&](const JsonToken& token) -> Status {
      if (attribute.arrays.size() == kMaxComponents) return cursor_.damaged("too many arrays");
      attribute.arrays.emplace_back();
      return readNumbersFrom(token, attribute, attribute.arrays.back());
    });
  }

  // In the spool numbers are doubles, or floats and 32-bit integers where the storage says so.
  Status beginSpooled(const Attribute& attribute, NumberArray& numbers) {
    if (!spool_) {
      SURFEIT_ASSIGN_OR_RETURN(TemporaryFile file, TemporaryFile::create(spoolDirectory()));
      spool_.emplace(std::move(file));
    }
    StoredType type = StoredType::kFloat64;
    const std::string& storage = attribute.storage;
    if (storage == "fpreal32" || storage == "fpreal16") type = StoredType::kFloat32;
    if (storage == "int8" || storage == "int16" || storage == "int32" || storage == "uint8" ||
        storage == "uint16" || storage == "bool") {
      type = StoredType::kInt32;
    }
    numbers = {true, true, type, spool_->size() + pending_.size(), 0};
    return {};
  }

  Status spoolItems(NumberArray& numbers) {
    JsonToken token;
    while (true) {
      SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      if (token.kind == Kind::kArrayEnd) return {};
      if (token.kind != Kind::kInteger && token.kind != Kind::kReal) {
        return cursor_.damaged("expected a number");
      }
      SURFEIT_RETURN_IF_ERROR(spoolNumber(token.real, numbers));
    }
  }

  Status spoolNumber(double number, NumberArray& numbers) {
    ++numbers.length;
    if (numbers.type == StoredType::kFloat32) return spoolValue(static_cast<float>(number));
    if (numbers.type == StoredType::kFloat64) return spoolValue(number);
    const double most = std::numeric_limits<std::int32_t>::max();
    const double least = std::numeric_limits<std::int32_t>::min();
    return spoolValue(static_cast<std::int32_t>(number >= least && number <= most ? number : 0.0));
  }

  template <typename T>
  Status spoolValue(T value) {
    const auto bytes = std::as_bytes(std::span(&value, 1));
    pending_.insert(pending_.end(), bytes.begin(), bytes.end());
    return pending_.size() < kSpoolBytes ? Status() : flushSpool();
  }

  Status flushSpool() {
    SURFEIT_RETURN_IF_ERROR(spool_->append(pending_).status());
    pending_.clear();
    return {};
  }

  // --- Columns ---

  Status place(Attribute& attribute, const RowReaderOptions& options) {
    const std::string quoted = quoteText(attribute.name);
    const bool is_string = attribute.type == "string";
    const bool has_values =
        attribute.pages.is_found || attribute.tuples.is_found || !attribute.arrays.empty();
    if ((attribute.type != "numeric" && !is_string) || !has_values) {
      notes_.push_back(
          fmt::format("attribute {} of type {} is not read", quoted, quoteText(attribute.type)));
      return {};
    }
    if (is_string) notes_.push_back("strings are read as their indices: " + quoted);

    // Older positions are homogeneous; w is a weight of curves, not a divisor
    const bool is_homogeneous = attribute.name == "P" && attribute.components == 4;
    const std::size_t used = is_homogeneous ? 3 : attribute.components;
    const NumberArray& first = attribute.pages.is_found    ? attribute.pages
                               : attribute.tuples.is_found ? attribute.tuples
                                                           : attribute.arrays[0];
    const std::size_t to = element_.row_bytes;
    SURFEIT_RETURN_IF_ERROR(addChannel(attribute.name, used, guessChannelKind(attribute.name, used),
                                       plyTypeOf(first.type), options.channels, path_, element_));
    if (element_.row_bytes > kMaxRowBytes) {
      return Status::corruption(fmt::format("{}: attribute {}: points of more than {} bytes", path_,
                                            quoted, kMaxRowBytes));
    }
    if (element_.row_bytes == to) return {};  // dropped
    if (first.type == StoredType::kInt64) {
      notes_.push_back("int64 becomes float64, exact up to 2^53: " + quoted);
    }
    if (attribute.pages.is_found) return placePages(attribute, used, to);
    if (attribute.tuples.is_found) {
      return placeArray(attribute, attribute.tuples, attribute.components, used, to);
    }
    if (attribute.arrays.size() != attribute.components) {
      return badLength(attribute, attribute.arrays.size(), attribute.components);
    }
    for (std::size_t c = 0; c < used; ++c) {
      if (attribute.arrays[c].type != first.type) {
        return Status::corruption(
            fmt::format("{}: attribute {}: arrays of several types", path_, quoted));
      }
      SURFEIT_RETURN_IF_ERROR(placeArray(attribute, attribute.arrays[c], 1, 1,
                                         to + c * valueTypeBytes(plyTypeOf(first.type))));
    }
    return {};
  }

  Status badLength(const Attribute& attribute, std::uint64_t found, std::uint64_t expected) const {
    return Status::corruption(fmt::format("{}: attribute {}: {} values, expected {}", path_,
                                          quoteText(attribute.name), found, expected));
  }

  Column columnOf(const NumberArray& numbers, std::size_t components, std::size_t used,
                  std::size_t to) const {
    Column column;
    column.offset = numbers.offset;
    column.is_spooled = numbers.is_spooled;
    column.type = numbers.type;
    column.is_swapped = !numbers.is_spooled && cursor_.isSwapped();
    column.components = components;
    column.used_components = used;
    column.to = to;
    return column;
  }

  Status placeArray(const Attribute& attribute, const NumberArray& numbers, std::size_t components,
                    std::size_t used, std::size_t to) {
    if (numbers.length % components != 0 || numbers.length / components != element_.count) {
      return badLength(attribute, numbers.length, element_.count * components);
    }
    addColumn(columnOf(numbers, components, used, to));
    return {};
  }

  Status placePages(Attribute& attribute, std::size_t used, std::size_t to) {
    Column column = columnOf(attribute.pages, attribute.components, used, to);
    ColumnPages pages;
    pages.rows = attribute.page_rows;
    pages.slices = attribute.packing;
    if (pages.slices.empty()) pages.slices = {attribute.components};
    pages.constant = std::move(attribute.constant);
    const std::size_t slices = pages.slices.size();
    std::size_t components = 0;
    for (const std::size_t slice : pages.slices) components += slice;

    // Flags are for every page, or for none
    const std::uint64_t page_count =
        pages.rows == 0 ? 0 : element_.count / pages.rows + (element_.count % pages.rows ? 1 : 0);
    bool flags_fit = pages.constant.empty() || pages.constant.size() == slices;
    for (const std::vector<bool>& flags : pages.constant) {
      flags_fit = flags_fit && (flags.empty() || flags.size() == page_count);
    }
    if (pages.rows < kLeastPageRows || pages.rows > kMostPageRows ||
        components != attribute.components || !flags_fit) {
      return Status::corruption(fmt::format(
          "{}: attribute {}: pages of {} points in {} slices of {} components, expected {} to {} "
          "points, {} components and flags of {} pages",
          path_, quoteText(attribute.name), pages.rows, slices, components, kLeastPageRows,
          kMostPageRows, attribute.components, page_count));
    }
    // Where no page is constant a product does; where some are, their flags bound the loop. The
    // count is held against what an array without constant pages can have first
    const bool has_flags =
        std::any_of(pages.constant.begin(), pages.constant.end(),
                    [](const std::vector<bool>& flags) { return !flags.empty(); });
    if (!has_flags) pages.constant.clear();
    column.pages = std::move(pages);
    const std::uint64_t length = attribute.pages.length;
    if (!has_flags && element_.count > length) {
      return badLength(attribute, length, element_.count);
    }
    const std::uint64_t expected = column.bytes(element_.count) / storedBytes(column.type);
    if (expected != length) return badLength(attribute, length, expected);
    addColumn(std::move(column));
    return {};
  }

  std::vector<Attribute> attributes_;
  std::vector<std::byte> pending_;  // of the spool
  std::vector<double> numbers_;
};

}  // namespace

bool recognisesBgeoJson(std::string_view first_bytes) { return startsBinaryJson(first_bytes); }

Result<std::unique_ptr<RowReader>> openBgeoJson(const std::string& path,
                                                const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(SpooledInput input, SpooledInput::open(path, options.access));
  auto reader = std::make_unique<BgeoJsonReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
