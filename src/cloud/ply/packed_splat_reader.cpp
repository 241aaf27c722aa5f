#include "cloud/ply/packed_splat_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/parts/counted_row_reader.h"
#include "cloud/ply/ply_reader.h"
#include "cloud/ply/splat_reader.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kChunkSplats = 256;
constexpr const char* kChunkElement = "chunk";
constexpr const char* kSplatElement = "vertex";

constexpr const char* kWords[] = {"packed_position", "packed_rotation", "packed_scale",
                                  "packed_color"};
// Ranges of a chunk: least and largest value of each component.
constexpr const char* kRanges[] = {"min_x",       "min_y",       "min_z",       "max_x",
                                   "max_y",       "max_z",       "min_scale_x", "min_scale_y",
                                   "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z"};
// Those of colors came later.
constexpr const char* kColorRanges[] = {"min_r", "min_g", "min_b", "max_r", "max_g", "max_b"};

// Of a row, in this order.
constexpr const char* kFloats[] = {"x",      "y",       "z",       "f_dc_0",  "f_dc_1",
                                   "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
                                   "rot_0",  "rot_1",   "rot_2",   "rot_3"};
using Splat = std::array<float, std::size(kFloats)>;

// Bits of a word from 0 to 1.
double unit(std::uint32_t word, int shift, int bits) {
  const std::uint32_t most = (1u << bits) - 1;
  return double(word >> shift & most) / double(most);
}

double between(double least, double most, double part) { return least + (most - least) * part; }

struct Chunk {
  double position[2][3]{}, scale[2][3]{};
  double color[2][3] = {{0, 0, 0}, {1, 1, 1}};
};

// x, y and z of 11, 10 and 11 bits, within a range.
void unpackTriple(std::uint32_t word, const double (&range)[2][3], float* values) {
  const double parts[3] = {unit(word, 21, 11), unit(word, 11, 10), unit(word, 0, 11)};
  for (std::size_t i = 0; i < 3; ++i) {
    values[i] = static_cast<float>(between(range[0][i], range[1][i], parts[i]));
  }
}

// A quaternion without its largest component, which the first two bits tell: the others take 10
// bits each and lie between -sqrt(1/2) and sqrt(1/2).
void unpackRotation(std::uint32_t word, float* values) {
  const std::size_t largest = word >> 30;
  double sum = 0;
  int shift = 20;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const double value = (unit(word, shift, 10) - 0.5) * std::numbers::sqrt2;
    values[i] = static_cast<float>(value);
    sum += value * value;
    shift -= 10;
  }
  values[largest] = static_cast<float>(std::sqrt(std::max(0.0, 1 - sum)));
}

Splat unpack(const std::uint32_t (&words)[4], const Chunk& chunk) {
  Splat splat;
  unpackTriple(words[0], chunk.position, &splat[0]);
  for (std::size_t i = 0; i < 3; ++i) {
    const double part = unit(words[3], 24 - 8 * int(i), 8);
    const double color = between(chunk.color[0][i], chunk.color[1][i], part);
    splat[3 + i] = static_cast<float>((color - 0.5) / kSplatColorFactor);
  }
  // Opacity itself; splats have its logit
  const double opacity = unit(words[3], 0, 8);
  splat[6] = static_cast<float>(std::log(opacity / (1 - opacity)));
  unpackTriple(words[2], chunk.scale, &splat[7]);
  unpackRotation(words[1], &splat[10]);
  return splat;
}

class PackedSplatReader final : public CountedRowReader {
 public:
  PackedSplatReader(PlyReader splats, PlyReader chunks)
      : splats_(std::move(splats)), chunks_(std::move(chunks)) {}

  Status open() {
    const PlyHeader& header = splats_.header();
    splat_index_ = *header.findElement(kSplatElement);
    chunk_index_ = *header.findElement(kChunkElement);
    const RowLayout& splat = header.elements[splat_index_];
    const RowLayout& chunk = header.elements[chunk_index_];
    path_ = splats_.path();
    format_name_ = "PLY, compressed by SuperSplat,";
    comments_ = header.comments;
    element_.name = splat.name;
    element_.count = splat.count;
    for (const char* name : kFloats) element_.properties.push_back({name, ValueType::kFloat32});
    packRow(element_);

    const std::uint64_t chunks = splat.count / kChunkSplats + (splat.count % kChunkSplats != 0);
    if (chunk.count < chunks) {
      return Status::corruption(
          fmt::format("{}: element chunk: found {} rows, expected {} for {} "
                      "splats",
                      path_, chunk.count, chunks, splat.count));
    }
    for (const char* name : kWords) words_.push_back(*splat.find(name));
    for (const char* name : kRanges) {
      SURFEIT_RETURN_IF_ERROR(addRange(chunk, name));
    }
    if (chunk.find(kColorRanges[0]) != nullptr) {
      for (const char* name : kColorRanges) SURFEIT_RETURN_IF_ERROR(addRange(chunk, name));
    }
    for (std::size_t i = 0; i < header.elements.size(); ++i) {
      if (i == splat_index_ || i == chunk_index_) continue;
      notes_.push_back(fmt::format("element {} is not kept", header.elements[i].name));
    }
    for (const RowProperty& property : splat.properties) {
      const bool is_known = std::any_of(std::begin(kWords), std::end(kWords),
                                        [&](const char* name) { return property.name == name; });
      if (!is_known) notes_.push_back(fmt::format("property {} is not kept", property.name));
    }
    return moveTo(0);
  }

  bool isSeekable() const override { return splats_.hasFixedRows() && chunks_.hasFixedRows(); }

 private:
  Status addRange(const RowLayout& chunk, const char* name) {
    const RowProperty* const property = chunk.find(name);
    if (property == nullptr || property->is_list) {
      return Status::corruption(fmt::format(
          "{}: element chunk: found no property {}, expected the ranges of splats", path_, name));
    }
    ranges_.push_back(*property);
    return {};
  }

  Status moveTo(std::uint64_t row) override {
    loaded_chunks_ = 0;
    SURFEIT_RETURN_IF_ERROR(splats_.seekElement(splat_index_));
    SURFEIT_RETURN_IF_ERROR(chunks_.seekElement(chunk_index_));
    if (row == 0) return {};
    loaded_chunks_ = row / kChunkSplats;
    SURFEIT_RETURN_IF_ERROR(splats_.seekRow(row));
    return chunks_.seekRow(loaded_chunks_);
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    const std::size_t splat_bytes = splats_.header().elements[splat_index_].row_bytes;
    for (std::size_t done = 0; done < count;) {
      const std::uint64_t record = row() + done;
      while (loaded_chunks_ <= record / kChunkSplats) SURFEIT_RETURN_IF_ERROR(loadChunk());
      const auto most = static_cast<std::size_t>(
          std::min<std::uint64_t>(count - done, kChunkSplats - record % kChunkSplats));
      SURFEIT_ASSIGN_OR_RETURN(const Bytes view, splats_.readRowView(most, splat_rows_));
      if (view.empty()) return damagedRow(record, "file ends early");
      for (std::size_t at = 0; at < view.size(); at += splat_bytes, ++done) {
        std::uint32_t words[4];
        for (std::size_t i = 0; i < 4; ++i) {
          std::memcpy(&words[i], &view[at + words_[i].offset], sizeof words[i]);
        }
        const Splat splat = unpack(words, chunk_);
        std::memcpy(rows + done * sizeof splat, splat.data(), sizeof splat);
      }
    }
    return {};
  }

  Status checkEnd() override {
    // Looks at what follows, where the file has nothing more to say
    return splats_.readRowView(1, splat_rows_).status();
  }

  Status loadChunk() {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes view, chunks_.readRowView(1, chunk_rows_));
    if (view.empty()) return damagedRow(row(), "file ends early, expected another chunk");
    double* const values[3] = {&chunk_.position[0][0], &chunk_.scale[0][0], &chunk_.color[0][0]};
    for (std::size_t i = 0; i < ranges_.size(); ++i) {
      values[i / 6][i % 6] = rowValue(view.data() + ranges_[i].offset, ranges_[i].type);
    }
    ++loaded_chunks_;
    return {};
  }

  PlyReader splats_, chunks_;
  std::size_t splat_index_ = 0, chunk_index_ = 0;
  std::vector<RowProperty> words_, ranges_;
  Chunk chunk_;                      // number loaded_chunks_ - 1
  std::uint64_t loaded_chunks_ = 0;  // the next one to be read
  AlignedBuffer splat_rows_, chunk_rows_;
};

}  // namespace

bool arePackedSplats(const PlyHeader& header) {
  const std::optional<std::size_t> splats = header.findElement(kSplatElement);
  if (!splats || !header.findElement(kChunkElement)) return false;
  return std::all_of(std::begin(kWords), std::end(kWords), [&](const char* name) {
    const RowProperty* const property = header.elements[*splats].find(name);
    return property != nullptr && !property->is_list &&
           (property->type == ValueType::kUint32 || property->type == ValueType::kInt32);
  });
}

Result<std::unique_ptr<RowReader>> openPackedSplats(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader splats, PlyReader::open(path, access));
  SURFEIT_ASSIGN_OR_RETURN(PlyReader chunks, PlyReader::open(path));
  auto reader = std::make_unique<PackedSplatReader>(std::move(splats), std::move(chunks));
  SURFEIT_RETURN_IF_ERROR(reader->open());
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
