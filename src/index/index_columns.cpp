// Rows in memory go to the indexer through the reader of rows that files go through, so that the
// same rules make the same scene.
#include <fmt/format.h>

#include <utility>

#include "cloud/edits/color_reader.h"
#include "core/guard.h"
#include "core/up_comment.h"
#include "index/index_from.h"
#include "index/rows/column_copies.h"
#include "index/rows/memory_rows.h"
#include "surfeit/cloud_rows.h"

namespace surfeit {
namespace {

class ColumnReader : public MemoryRows {
 public:
  ColumnReader(const CloudColumns& rows, RowLayout layout)
      : MemoryRows(std::move(layout)), rows_(rows) {}

  const std::string& path() const override { return rows_.name; }
  std::string formatName() const override { return "rows in memory"; }
  std::vector<std::string> comments() const override {
    if (!rows_.up) return {};
    return {upComment(*rows_.up)};
  }

 private:
  Status pack(std::uint64_t first, std::size_t count, std::byte* rows) override {
    packRows(layout_, rows_.values.data(), static_cast<std::size_t>(first), count, rows);
    return {};
  }

  const CloudColumns& rows_;
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
