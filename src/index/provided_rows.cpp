#include "index/provided_rows.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/up_comment.h"
#include "surfels/surfel_rows.h"

namespace surfeit {
namespace {

class ProvidedRows : public RowReader {
 public:
  explicit ProvidedRows(SurfelProvider& provider)
      : provider_(provider), name_(provider.name()), rows_(provider.channels(), provider.origin()) {
    layout_.name = "surfel";
    layout_.count = provider.count();
    layout_.properties = rows_.properties();
    layout_.row_bytes = rows_.rowBytes();
  }

  const std::string& path() const override { return name_; }
  std::string formatName() const override { return "surfels in memory"; }
  const RowLayout& element() const override { return layout_; }
  std::vector<std::string> comments() const override { return {upComment(provider_.up())}; }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, layout_.count - next_));
    if (count == 0) return Bytes();
    surfels_.resize(count);
    SURFEIT_RETURN_IF_ERROR(provider_.read(next_, count, surfels_.data()));
    buffer.reserve(count * layout_.row_bytes);
    rows_.pack(surfels_, buffer.data());
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
  SurfelProvider& provider_;
  const std::string name_;
  const SurfelRows rows_;
  RowLayout layout_;
  std::vector<Surfel> surfels_;
  std::uint64_t next_ = 0;
};

}  // namespace

std::unique_ptr<RowReader> readProvidedSurfels(SurfelProvider& provider) {
  return std::make_unique<ProvidedRows>(provider);
}

}  // namespace surfeit
