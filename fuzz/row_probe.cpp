#include "fuzz/row_probe.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/assert.h"
#include "surfeit/surfel.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

// A few KiB of a compressed file may stand for gigabytes of rows: this much of them is read, and
// what the first of them are is remembered
constexpr std::uint64_t kMaxRows = 1 << 16;
constexpr std::size_t kMaxReadBytes = 1 << 20;
constexpr std::size_t kMaxKeptBytes = 1 << 16;
constexpr std::size_t kSmallBatch = 3, kLargeBatch = 1000;

struct Reading {
  bool ok = true;               // without an error so far
  bool at_end = false;          // all rows were read
  std::uint64_t count = 0;      // rows read
  std::vector<std::byte> kept;  // values of the first rows, without what lies between them
};

void checkElement(const RowLayout& element) {
  std::size_t end = 0;
  for (const RowProperty& property : element.properties) {
    SURFEIT_CHECK(!property.is_list && !property.name.empty());
    SURFEIT_CHECK(property.offset >= end);
    end = property.offset + valueTypeBytes(property.type);
  }
  SURFEIT_CHECK(end <= element.row_bytes);
}

void keepValues(const RowLayout& element, Bytes rows, std::vector<std::byte>& kept) {
  for (; !rows.empty() && kept.size() < kMaxKeptBytes; rows = rows.subspan(element.row_bytes)) {
    for (const RowProperty& property : element.properties) {
      const std::size_t at = kept.size(), size = valueTypeBytes(property.type);
      kept.resize(at + size);
      std::memcpy(&kept[at], &rows[property.offset], size);
    }
  }
}

// Reads on from row `first`, in batches of that many.
Reading readFrom(RowReader& reader, std::uint64_t first, std::size_t batch) {
  const RowLayout& element = reader.element();
  const std::uint64_t max_rows = std::min<std::uint64_t>(
      kMaxRows, kMaxReadBytes / std::max<std::size_t>(element.row_bytes, 1) + 1);
  AlignedBuffer buffer;
  Reading reading;
  while (reading.count < max_rows) {
    const std::size_t wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(batch, max_rows - reading.count));
    const Result<Bytes> rows = reader.readRows(wanted, buffer);
    if (!rows.ok()) {
      checkRefusal(rows.status());
      SURFEIT_CHECK(!reader.readRows(1, buffer).ok());
      reading.ok = false;
      return reading;
    }
    if (rows->empty()) {
      reading.at_end = true;
      SURFEIT_CHECK(first + reading.count == element.count);
      return reading;
    }
    SURFEIT_CHECK(rows->size() % element.row_bytes == 0);
    const std::size_t count = rows->size() / element.row_bytes;
    SURFEIT_CHECK(count <= wanted && first + reading.count + count <= element.count);
    // "max_rows, or as many as are left"
    SURFEIT_CHECK(count == wanted || first + reading.count + count == element.count);
    reading.count += count;
    keepValues(element, *rows, reading.kept);
  }
  return reading;
}

// What both readings kept must agree, as far as both went.
void checkSame(std::span<const std::byte> one, std::span<const std::byte> other) {
  const std::size_t size = std::min(one.size(), other.size());
  SURFEIT_CHECK(
      std::equal(one.begin(), one.begin() + static_cast<std::ptrdiff_t>(size), other.begin()));
}

void checkSame(const Reading& one, const Reading& other) {
  checkSame(std::span(one.kept), std::span(other.kept));
  SURFEIT_CHECK(one.ok == other.ok);
  if (one.ok) SURFEIT_CHECK(one.count == other.count && one.kept.size() == other.kept.size());
}

// Reads on from a row in the middle of what was kept.
void probeSeek(RowReader& reader, const Reading& all) {
  const RowLayout& element = reader.element();
  std::size_t value_bytes = 0;
  for (const RowProperty& property : element.properties) {
    value_bytes += valueTypeBytes(property.type);
  }
  SURFEIT_CHECK(!reader.seekRow(element.count + 1).ok());
  if (value_bytes == 0) return;
  const std::uint64_t row = all.kept.size() / value_bytes / 2;
  SURFEIT_CHECK(reader.seekRow(row).ok());
  const Reading rest = readFrom(reader, row, kLargeBatch);
  checkSame(std::span(all.kept).subspan(static_cast<std::size_t>(row) * value_bytes), rest.kept);
}

// As surfels, where the first bytes of the file are of a format and the rows of a cloud. Not by
// read(), which passes over invalid rows, however many there are.
void probeSurfels(const std::string& path) {
  Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(path, false);
  if (!source.ok()) return checkRefusal(source.status());
  AlignedBuffer buffer;
  const Result<Bytes> rows = (*source)->readRows(kLargeBatch, buffer);
  if (!rows.ok()) return checkRefusal(rows.status());
  std::vector<Surfel> surfels(kLargeBatch);
  SurfelDefects defects;
  const Result<std::size_t> count = (*source)->decodeRows(*rows, 0, surfels, defects);
  if (!count.ok()) return checkRefusal(count.status());
  SURFEIT_CHECK(*count <= rows->size() / (*source)->rowBytes());
}

}  // namespace

void checkRefusal(const Status& status) {
  const StatusCode code = status.code();
  SURFEIT_CHECK(code == StatusCode::kCorruption || code == StatusCode::kInvalidArgument);
  SURFEIT_CHECK(!status.message().empty());
}

void probeRows(const std::string& path, OpenRows open) {
  Result<std::unique_ptr<RowReader>> opened = open(path, {});
  if (!opened.ok()) return checkRefusal(opened.status());
  RowReader& reader = **opened;
  checkElement(reader.element());
  SURFEIT_CHECK(!reader.formatName().empty());
  static_cast<void>(reader.comments());
  static_cast<void>(reader.notes());

  const Reading all = readFrom(reader, 0, kLargeBatch);
  SURFEIT_CHECK(reader.rewind().ok());
  checkSame(all, readFrom(reader, 0, kSmallBatch));
  if (reader.isSeekable()) probeSeek(reader, all);
  probeSurfels(path);
}

}  // namespace surfeit
