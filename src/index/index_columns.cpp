// Rows in memory go to the indexer through the reader of rows that files go through, so that the
// same rules make the same scene.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "cloud/color_reader.h"
#include "core/guard.h"
#include "core/up_comment.h"
#include "index/column_copies.h"
#include "index/index_from.h"
#include "surfeit/cloud_rows.h"

namespace surfeit {
namespace {

class ColumnReader : public RowReader {
 public:
  ColumnReader(const CloudColumns& rows, RowLayout layout)
      : rows_(rows), layout_(std::move(layout)) {}

  const std::string& path() const override { return rows_.name; }
  std::string formatName() const override { return "rows in memory"; }
  const RowLayout& element() const override { return layout_; }
  std::vector<std::string> comments() const override {
    if (!rows_.up) return {};
    return {upComment(*rows_.up)};
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, layout_.count - next_));
    if (count == 0) return Bytes();
    buffer.reserve(count * layout_.row_bytes);
    packRows(layout_, rows_.values.data(), static_cast<std::size_t>(next_), count, buffer.data());
    next_ += count;
    return Bytes(buffer.data(), count * layout_.row_bytes);
  }
  Status rewind() override { return seekRow(0); }
  bool isSeekable() const override { return true; }
  Status seekRow(std::uint64_t row) override {
    next_ = row;
    return {};
  }

 private:
  const CloudColumns& rows_;
  const RowLayout layout_;
  std::uint64_t next_ = 0;
};

}  // namespace

Result<IndexStats> indexColumns(const CloudColumns& rows, const std::string& output,
                                const IndexOptions& options, Progress& progress) {
  return guarded(output, [&]() -> Result<IndexStats> {
    SURFEIT_ASSIGN_OR_RETURN(RowLayout layout, layoutOf(rows.columns, rows.name));
    layout.count = rows.count;
    if (rows.values.size() != rows.columns.size()) {
      return Status::invalidArgument(fmt::format("{}: values of {} columns, expected {}", rows.name,
                                                 rows.values.size(), rows.columns.size()));
    }
    const SourceOpener opener =
        [&](const std::string&, bool strict,
            const RowReaderOptions& reading) -> Result<std::unique_ptr<SurfelSource>> {
      std::unique_ptr<RowReader> reader = std::make_unique<ColumnReader>(rows, layout);
      if (reading.color_range) {
        SURFEIT_ASSIGN_OR_RETURN(reader, readColors(std::move(reader), *reading.color_range));
      }
      return makeSurfelSource(std::move(reader), strict);
    };
    IndexOptions used = options;
    used.channels.clear();
    used.part.clear();
    used.filter.clear();
    return indexFrom({rows.name}, opener, output, used, progress);
  });
}

}  // namespace surfeit
