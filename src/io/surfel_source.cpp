#include "io/surfel_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "io/ply_reader.h"
#include "io/recipe_surfel_source.h"
#include "io/scene_recipe.h"

namespace surfeit {
namespace {

constexpr std::size_t kRowBufferBytes = 256 << 10;

class PlySurfelSource : public SurfelSource {
 public:
  PlySurfelSource(PlyReader reader, SurfelMapping mapping, std::size_t element_index, bool strict)
      : reader_(std::move(reader)),
        mapping_(std::move(mapping)),
        element_index_(element_index),
        is_strict_(strict),
        is_seekable_(reader_.hasFixedRows()) {}

  const std::string& path() const override { return reader_.path(); }
  std::uint64_t recordCount() const override {
    return reader_.header().elements[element_index_].count;
  }
  CloudChannels channels() const override { return mapping_.channels(); }
  const SurfelDefects& defects() const override { return defects_; }
  std::size_t rowBytes() const override { return mapping_.rowBytes(); }
  bool isSeekable() const override { return is_seekable_; }

  Result<std::size_t> read(std::span<Surfel> surfels) override {
    std::size_t size = 0;
    while (size < surfels.size()) {
      // Fetch rows
      if (rows_.empty()) {
        const std::size_t max_rows = std::max<std::size_t>(1, kRowBufferBytes / rowBytes());
        SURFEIT_ASSIGN_OR_RETURN(rows_, readRows(max_rows, buffer_));
        if (rows_.empty()) break;
      }

      // Decode as many as there is room for
      const std::size_t count = std::min(rows_.size() / rowBytes(), surfels.size() - size);
      const Bytes rows = rows_.first(count * rowBytes());
      const std::uint64_t first_record = record_;
      rows_ = rows_.subspan(rows.size());
      record_ += count;
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t valid,
                               decodeRows(rows, first_record, surfels.subspan(size), defects_));
      size += valid;
    }
    return size;
  }

  Status rewind() override {
    rows_ = {};
    record_ = 0;
    defects_ = {};
    return reader_.seekElement(element_index_);
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    return reader_.readRowView(max_rows, buffer);
  }

  Result<std::size_t> decodeRows(Bytes rows, std::uint64_t first_record, std::span<Surfel> surfels,
                                 SurfelDefects& defects) const override {
    SurfelDefects found;
    const std::size_t size = mapping_.decodeRows(rows, first_record, surfels, found);
    if (is_strict_ && found.total() > 0) {
      const std::uint64_t record = found.firstRecord();
      const std::size_t row = static_cast<std::size_t>(record - first_record);
      return Status::corruption(
          fmt::format("{}: record {}: {}", path(), record,
                      mapping_.describeDefect(rows.data() + row * rowBytes())));
    }
    defects.add(found);
    return size;
  }

  Status seekRow(std::uint64_t record) override { return reader_.seekRow(record); }

 private:
  PlyReader reader_;
  SurfelMapping mapping_;
  std::size_t element_index_;
  bool is_strict_, is_seekable_;

  // Of read(): rows in the buffer that are still to be decoded, the first of them record_
  SurfelDefects defects_;
  AlignedBuffer buffer_;
  Bytes rows_;
  std::uint64_t record_ = 0;
};

Result<std::unique_ptr<SurfelSource>> openPly(const std::string& path, bool strict, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path, access));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t index, findSurfelElement(reader.header(), path));
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping mapping,
                           SurfelMapping::create(reader.header().elements[index], path));
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(index));
  return std::unique_ptr<SurfelSource>(
      std::make_unique<PlySurfelSource>(std::move(reader), std::move(mapping), index, strict));
}

}  // namespace

Result<std::unique_ptr<SurfelSource>> openSurfelSource(const std::string& path, bool strict,
                                                       Access access) {
  // Formats announce themselves by their first bytes
  std::array<std::byte, kRecipeMagic.size()> magic{};
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(0, magic));
  const std::string_view text(reinterpret_cast<const char*>(magic.data()), size);
  if (text.starts_with("ply\n") || text.starts_with("ply\r")) return openPly(path, strict, access);
  if (text == kRecipeMagic) return openRecipeSource(path);
  return Status::corruption(
      fmt::format("{}: found {} at 0, expected 'ply' (PLY is the format that is read)", path,
                  quotePlyText(text.substr(0, 4))));
}

}  // namespace surfeit
