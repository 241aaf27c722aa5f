#include "cloud/houdini/bgeo_ascii_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "cloud/houdini/geo_notes.h"
#include "cloud/houdini/geo_words.h"
#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/stored_values.h"
#include "cloud/ply/ply_number.h"
#include "storage/byte_input.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic = "PGEOMETRY V5";
constexpr std::size_t kMaxAttributes = 1024, kMaxComponents = 256, kMaxStrings = 1 << 20;
constexpr std::size_t kMaxRowBytes = 16 << 10;

class BgeoAsciiReader final : public CountedRowReader {
 public:
  explicit BgeoAsciiReader(ByteInput input) : words_(std::move(input), "()") {
    path_ = words_.input().path();
    element_.name = "vertex";
    format_name_ = "GEO 5 (text)";
  }

  Status open(const RowReaderOptions& options) {
    std::uint64_t unused = 0, attributes = 0, primitives = 0;
    words_.moveTo(kMagic.size());
    SURFEIT_RETURN_IF_ERROR(readNamed("NPoints", element_.count));
    SURFEIT_RETURN_IF_ERROR(readNamed("NPrims", primitives));
    if (std::string note = noteOfGeoPrimitives(primitives); !note.empty()) notes_.push_back(note);
    for (const char* name : {"NPointGroups", "NPrimGroups"}) {
      SURFEIT_RETURN_IF_ERROR(readNamed(name, unused));
    }
    SURFEIT_RETURN_IF_ERROR(readNamed("NPointAttrib", attributes));
    for (const char* name : {"NVertexAttrib", "NPrimAttrib", "NAttrib"}) {
      SURFEIT_RETURN_IF_ERROR(readNamed(name, unused));
    }
    if (attributes > kMaxAttributes) {
      return unexpected(fmt::format("at most {} attributes", kMaxAttributes));
    }
    SURFEIT_RETURN_IF_ERROR(addAttribute("P", 3, ValueType::kFloat32, options));
    values_.push_back({ValueType::kFloat32, 0, false});  // w
    has_attributes_ = attributes > 0;
    if (has_attributes_) SURFEIT_RETURN_IF_ERROR(expect("PointAttrib"));
    for (std::uint64_t i = 0; i < attributes; ++i) SURFEIT_RETURN_IF_ERROR(readAttribute(options));
    data_begin_ = words_.nextOffset();
    return checkCount();
  }

 private:
  struct Value {
    ValueType type = ValueType::kFloat32;
    std::size_t to = 0;
    bool is_kept = true;
  };

  Status unexpected(std::string_view expected) const {
    return damagedAt(
        words_.offset(),
        fmt::format("found {}, expected {}",
                    word_.empty() ? "the end of the file" : quoteText(word_), expected));
  }

  Status expect(std::string_view expected) {
    SURFEIT_RETURN_IF_ERROR(words_.next(word_));
    return word_ == expected ? Status() : unexpected(quoteText(expected));
  }

  // A number that counts something.
  Status readCount(std::string_view what, std::uint64_t& count) {
    SURFEIT_RETURN_IF_ERROR(words_.next(word_));
    std::uint32_t value = 0;
    if (!parsePlyNumber(word_, ValueType::kUint32, reinterpret_cast<std::byte*>(&value))) {
      return unexpected(fmt::format("a number of {}", what));
    }
    count = value;
    return {};
  }

  Status readNamed(std::string_view name, std::uint64_t& count) {
    SURFEIT_RETURN_IF_ERROR(expect(name));
    return readCount(name, count);
  }

  // name components type defaults
  Status readAttribute(const RowReaderOptions& options) {
    SURFEIT_RETURN_IF_ERROR(words_.next(word_));
    if (word_.empty()) return unexpected("an attribute");
    const std::string name(word_);
    std::uint64_t components = 0;
    SURFEIT_RETURN_IF_ERROR(readCount("components", components));
    if (components < 1 || components > kMaxComponents) {
      return unexpected(fmt::format("1 to {} components", kMaxComponents));
    }
    SURFEIT_RETURN_IF_ERROR(words_.next(word_));
    const std::string type(word_);
    std::uint64_t defaults = components;
    if (type == "index") {
      SURFEIT_RETURN_IF_ERROR(readCount("strings", defaults));
      if (defaults > kMaxStrings) return unexpected(fmt::format("at most {}", kMaxStrings));
      notes_.push_back("strings are read as their indices: " + quoteText(name));
    } else if (type != "float" && type != "int" && type != "vector") {
      return unexpected("float, int, vector or index");
    }
    for (std::uint64_t i = 0; i < defaults; ++i) {
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      if (word_.empty()) return unexpected("a default");
    }
    const bool is_real = type == "float" || type == "vector";
    return addAttribute(name, components, is_real ? ValueType::kFloat32 : ValueType::kInt32,
                        options);
  }

  Status addAttribute(const std::string& name, std::size_t components, ValueType type,
                      const RowReaderOptions& options) {
    const std::size_t to = element_.row_bytes;
    SURFEIT_RETURN_IF_ERROR(addChannel(name, components, guessChannelKind(name, components), type,
                                       options.channels, path_, element_));
    if (element_.row_bytes > kMaxRowBytes) {
      return unexpected(fmt::format("points of at most {} bytes", kMaxRowBytes));
    }
    const bool is_kept = element_.row_bytes > to;
    for (std::size_t c = 0; c < components; ++c) {
      values_.push_back({type, to + c * valueTypeBytes(type), is_kept});
    }
    return {};
  }

  // A value takes a digit and a blank.
  Status checkCount() const {
    const std::optional<std::uint64_t> size = words_.input().size();
    if (!size) return {};
    const std::uint64_t most = (*size - std::min(*size, data_begin_) + 1) / (2 * values_.size());
    if (element_.count <= most) return {};
    return damagedRow(most, fmt::format("file ends early: {} bytes hold at most {} points, "
                                        "expected {}",
                                        *size, most, element_.count));
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    for (std::size_t i = 0; i < count; ++i) {
      SURFEIT_RETURN_IF_ERROR(decodeRow(row() + i, rows + i * element_.row_bytes));
    }
    return {};
  }

  Status decodeRow(std::uint64_t at_row, std::byte* row_bytes) {
    constexpr std::size_t kPositionWords = 4;
    for (std::size_t i = 0; i < values_.size(); ++i) {
      if (i == kPositionWords) SURFEIT_RETURN_IF_ERROR(expect("("));
      SURFEIT_RETURN_IF_ERROR(words_.next(word_));
      std::byte value[8];
      if (!parsePlyNumber(word_, values_[i].type, value)) {
        return damagedRow(
            at_row, fmt::format("byte {}: found {}, expected a number of type {}", words_.offset(),
                                quoteText(word_), valueTypeName(values_[i].type)));
      }
      if (values_[i].is_kept) {
        std::memcpy(row_bytes + values_[i].to, value, valueTypeBytes(values_[i].type));
      }
    }
    return has_attributes_ ? expect(")") : Status();
  }

  Status moveTo(std::uint64_t) override {
    words_.moveTo(data_begin_);
    return {};
  }

  Status checkEnd() override { return words_.input().checkUnchanged(); }

  GeoWords words_;
  std::string_view word_;
  std::vector<Value> values_;
  bool has_attributes_ = false;
  std::uint64_t data_begin_ = 0;
};

}  // namespace

bool recognisesBgeoAscii(std::string_view first_bytes) { return first_bytes.starts_with(kMagic); }

Result<std::unique_ptr<RowReader>> openBgeoAscii(const std::string& path,
                                                 const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, Access::kCached));
  auto reader = std::make_unique<BgeoAsciiReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
