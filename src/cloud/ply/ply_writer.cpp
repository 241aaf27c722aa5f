#include "cloud/ply/ply_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "cloud/ply/ply_number.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

constexpr std::size_t kScratchBytes = 64 << 10;
constexpr std::size_t kMaxCountDigits = 20;  // of 2^64 - 1

// The header with its count padded to a fixed size. Parsers split lines at blanks in different
// ways, but all of them skip comments: the room is a comment behind the element line.
std::string paddedHeader(const PlyHeader& header) {
  std::string text = formatPlyHeader(header);
  const RowLayout& element = header.elements.front();
  const std::string line = fmt::format("\nelement {} {}\n", element.name, element.count);
  const std::size_t digits = fmt::formatted_size("{}", element.count);
  text.insert(text.find(line) + line.size(),
              "comment" + std::string(1 + kMaxCountDigits - digits, ' ') + "\n");
  return text;
}

Status checkProperties(const std::string& path, const std::vector<RowProperty>& properties) {
  if (properties.empty()) {
    return Status::invalidArgument(fmt::format("{}: no properties to write", path));
  }
  for (std::size_t i = 0; i < properties.size(); ++i) {
    const std::string& name = properties[i].name;
    const bool is_twin = std::any_of(properties.begin(), properties.begin() + std::ptrdiff_t(i),
                                     [&](const RowProperty& other) { return other.name == name; });
    if (!isPropertyName(name) || is_twin || properties[i].is_list) {
      return Status::invalidArgument(
          fmt::format("{}: property {}: expected a scalar with a name of "
                      "one word that no other property has",
                      path, quoteText(name)));
    }
  }
  return {};
}

}  // namespace

struct PlyWriter::State {
  State(ByteOutput new_file, PlyHeader new_header)
      : file(std::move(new_file)), header(std::move(new_header)) {}

  ByteOutput file;
  PlyHeader header;
  bool is_finished = false;
  std::vector<std::byte> scratch;  // rows on their way to another byte order or to text

  RowLayout& element() { return header.elements.front(); }

  Status appendSwapped(Bytes rows) {
    const std::size_t row_bytes = element().row_bytes;
    const std::size_t batch_bytes = std::max<std::size_t>(1, kScratchBytes / row_bytes) * row_bytes;
    while (!rows.empty()) {
      const Bytes batch = rows.first(std::min(batch_bytes, rows.size()));
      scratch.assign(batch.begin(), batch.end());
      swapRows(element(), scratch);
      SURFEIT_RETURN_IF_ERROR(file.append(scratch));
      rows = rows.subspan(batch.size());
    }
    return {};
  }

  // A row is a line, its values parted by single blanks.
  Status appendText(Bytes rows) {
    scratch.resize(kScratchBytes);
    std::size_t size = 0;
    for (; !rows.empty(); rows = rows.subspan(element().row_bytes)) {
      for (const RowProperty& property : element().properties) {
        if (scratch.size() - size <= kLongestPlyNumber) {
          SURFEIT_RETURN_IF_ERROR(file.append(Bytes(scratch).first(size)));
          size = 0;
        }
        char* const begin = reinterpret_cast<char*>(scratch.data()) + size;
        char* const end = formatPlyNumber(&rows[property.offset], property.type, begin);
        *end = &property == &element().properties.back() ? '\n' : ' ';
        size += static_cast<std::size_t>(end - begin) + 1;
      }
    }
    return file.append(Bytes(scratch).first(size));
  }
};

Result<PlyWriter> PlyWriter::create(const std::string& path, PlyEncoding encoding,
                                    std::vector<RowProperty> properties,
                                    std::vector<std::string> comments, Progress* progress) {
  SURFEIT_RETURN_IF_ERROR(checkProperties(path, properties));
  RowLayout element;
  element.name = "vertex";
  element.properties = std::move(properties);
  packRow(element);

  PlyHeader header;
  header.encoding = encoding;
  header.comments = std::move(comments);
  header.elements.push_back(std::move(element));
  const std::string text = paddedHeader(header);
  if (text.size() > kMaxPlyHeaderBytes) {
    return Status::invalidArgument(fmt::format("{}: header of {} bytes, expected at most {}", path,
                                               text.size(), kMaxPlyHeaderBytes));
  }
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput file, ByteOutput::create(path, progress));
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(text))));
  return PlyWriter(std::make_unique<State>(std::move(file), std::move(header)));
}

PlyWriter::PlyWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
PlyWriter::PlyWriter(PlyWriter&&) noexcept = default;
PlyWriter& PlyWriter::operator=(PlyWriter&&) noexcept = default;
PlyWriter::~PlyWriter() = default;

const RowLayout& PlyWriter::element() const { return state_->element(); }

Status PlyWriter::writeRows(std::span<const std::byte> rows) {
  RowLayout& element = state_->element();
  if (state_->is_finished || rows.size() % element.row_bytes != 0) {
    return Status::invalidArgument(
        fmt::format("{}: {} bytes to write, expected whole rows of {} bytes before finish",
                    state_->file.path(), rows.size(), element.row_bytes));
  }
  element.count += rows.size() / element.row_bytes;
  if (state_->header.encoding == PlyEncoding::kAscii) return state_->appendText(rows);
  if (needsByteSwap(state_->header.encoding)) return state_->appendSwapped(rows);
  return state_->file.append(rows);
}

Status PlyWriter::finish() {
  if (state_->is_finished) {
    return Status::invalidArgument(fmt::format("{}: finished twice", state_->file.path()));
  }
  const std::string header = paddedHeader(state_->header);
  SURFEIT_RETURN_IF_ERROR(state_->file.writeAt(0, std::as_bytes(std::span(header))));
  SURFEIT_RETURN_IF_ERROR(state_->file.commit());
  state_->is_finished = true;
  return {};
}

}  // namespace surfeit
