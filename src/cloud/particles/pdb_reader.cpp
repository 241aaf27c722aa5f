#include "cloud/particles/pdb_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/column_rows.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kSwappedMagic = 0x9E020000;  // 670 in the other byte order
constexpr std::size_t kHeaderBytes = 60, kAttributeBytes = 42, kDataBytes = 20;
constexpr std::size_t kMaxNameBytes = 256;
constexpr std::uint32_t kMaxAttributes = 1024, kMaxValueBytes = 1024;
constexpr std::size_t kMaxRowBytes = 16 << 10;
constexpr std::uint32_t kVector = 1, kInteger = 3;  // 2 is a real

class PdbReader final : public ColumnRowReader {
 public:
  explicit PdbReader(SpooledInput input) : ColumnRowReader(std::move(input)) {
    path_ = input_.path();
  }

  Status open(const RowReaderOptions& options) {
    element_.name = "vertex";
    format_name_ = "PDB";
    std::array<std::byte, kHeaderBytes> header;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(0, header));
    is_swapped_ = wordAt(header.data()) == kSwappedMagic;
    element_.count = wordAt(&header[16]);
    const std::uint32_t attributes = wordAt(&header[20]);
    if (attributes == 0 || attributes > kMaxAttributes) {
      return damagedAt(
          20, fmt::format("{} attributes, expected 1 to {} (layout of 32-bit machines)", attributes,
                          kMaxAttributes));
    }
    std::uint64_t at = kHeaderBytes;
    for (std::uint32_t i = 0; i < attributes; ++i) {
      SURFEIT_RETURN_IF_ERROR(readAttribute(at, options));
    }
    std::string behind = noteOfBytesBehind(input_.size() - at, "attribute");
    if (!behind.empty()) notes_.push_back(std::move(behind));
    return {};
  }

 private:
  std::uint32_t wordAt(const std::byte* bytes) const {
    std::uint32_t word;
    std::memcpy(&word, bytes, sizeof word);
    return is_swapped_ ? __builtin_bswap32(word) : word;
  }

  // Of an attribute's name, which stands at `at`.
  Status readName(std::uint64_t at, std::string& name) {
    const std::size_t size = static_cast<std::size_t>(
        std::min<std::uint64_t>(kMaxNameBytes, input_.size() - std::min(input_.size(), at)));
    std::string text(size, '\0');
    SURFEIT_RETURN_IF_ERROR(
        input_.readAt(at, std::as_writable_bytes(std::span(text.data(), text.size()))));
    name = text.substr(0, text.find('\0'));
    if (name.empty() || name.size() == text.size()) {
      return damagedAt(at, fmt::format("found {}, expected the name of an attribute, 1 to {} bytes "
                                       "and a zero (layout of 32-bit machines)",
                                       quoteText(name), kMaxNameBytes - 1));
    }
    return {};
  }

  Status readAttribute(std::uint64_t& at, const RowReaderOptions& options) {
    std::string name;
    SURFEIT_RETURN_IF_ERROR(readName(at + kAttributeBytes, name));
    const std::uint64_t data_at = at + kAttributeBytes + name.size() + 1;
    std::array<std::byte, kDataBytes> data;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(data_at, data));
    const std::uint32_t type = wordAt(data.data()), value_bytes = wordAt(&data[4]);
    const std::uint32_t block_rows = wordAt(&data[8]), blocks = wordAt(&data[12]);
    const std::string quoted = quoteText(name);
    if (type < kVector || type > kInteger || value_bytes == 0 || value_bytes % 4 != 0 ||
        value_bytes > kMaxValueBytes) {
      return damagedAt(data_at, fmt::format("attribute {} of type {} takes {} bytes, expected "
                                            "vectors, reals or integers (1 to 3) of 4 bytes each",
                                            quoted, type, value_bytes));
    }
    if (blocks != 1 || block_rows != element_.count) {
      return damagedAt(data_at + 8, fmt::format("attribute {} in {} blocks of {} particles, "
                                                "expected 1 of {}",
                                                quoted, blocks, block_rows, element_.count));
    }

    Column column;
    column.offset = data_at + kDataBytes;
    column.type = type == kInteger ? StoredType::kInt32 : StoredType::kFloat32;
    column.is_swapped = is_swapped_;
    column.components = column.used_components = value_bytes / 4;
    column.to = element_.row_bytes;
    at = column.offset + column.bytes(element_.count);
    if (at > input_.size()) {
      return damagedRow((input_.size() - column.offset) / value_bytes,
                        fmt::format("file ends early: attribute {} ends at {}, the file at {}",
                                    quoted, at, input_.size()));
    }
    SURFEIT_RETURN_IF_ERROR(addChannel(name, column.components,
                                       guessChannelKind(name, column.components),
                                       plyTypeOf(column.type), options.channels, path_, element_));
    if (element_.row_bytes > kMaxRowBytes) {
      return damagedAt(data_at, fmt::format("particles of more than {} bytes", kMaxRowBytes));
    }
    if (element_.row_bytes > column.to) addColumn(std::move(column));
    return {};
  }

  bool is_swapped_ = false;
};

}  // namespace

bool recognisesPdb(std::string_view first_bytes) {
  // 670, then 1 as a number of 16 bits, in either byte order; the version is not known to be other
  // than 1
  using namespace std::string_view_literals;
  return first_bytes.starts_with("\x9E\x02\0\0\x01\0"sv) ||
         first_bytes.starts_with("\0\0\x02\x9E\0\x01"sv);
}

Result<std::unique_ptr<RowReader>> openPdb(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(SpooledInput input, SpooledInput::open(path, options.access));
  auto reader = std::make_unique<PdbReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
