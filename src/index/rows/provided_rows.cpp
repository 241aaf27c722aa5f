#include "index/rows/provided_rows.h"

#include <string>
#include <utility>
#include <vector>

#include "core/up_comment.h"
#include "index/rows/memory_rows.h"
#include "surfels/rows/surfel_rows.h"

namespace surfeit {
namespace {

RowLayout layoutOf(const SurfelProvider& provider, const SurfelRows& rows) {
  RowLayout layout;
  layout.name = "surfel";
  layout.count = provider.count();
  layout.properties = rows.properties();
  layout.row_bytes = rows.rowBytes();
  return layout;
}

class ProvidedRows : public MemoryRows {
 public:
  ProvidedRows(SurfelProvider& provider, SurfelRows rows)
      : MemoryRows(layoutOf(provider, rows)),
        provider_(provider),
        name_(provider.name()),
        rows_(std::move(rows)) {}

  const std::string& path() const override { return name_; }
  std::string formatName() const override { return "surfels in memory"; }
  std::vector<std::string> comments() const override { return {upComment(provider_.up())}; }

 private:
  Status pack(std::uint64_t first, std::size_t count, std::byte* rows) override {
    surfels_.resize(count);
    SURFEIT_RETURN_IF_ERROR(provider_.read(first, count, surfels_.data()));
    rows_.pack(surfels_, rows);
    return {};
  }

  SurfelProvider& provider_;
  const std::string name_;
  const SurfelRows rows_;
  std::vector<Surfel> surfels_;
};

}  // namespace

std::unique_ptr<RowReader> readProvidedSurfels(SurfelProvider& provider) {
  return std::make_unique<ProvidedRows>(provider,
                                        SurfelRows(provider.channels(), provider.origin()));
}

}  // namespace surfeit
