#include "view/brick_rows.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "surfeit/brick.h"
#include "view/cloud_record.h"

namespace surfeit {
namespace {

constexpr std::size_t kLookUpsAtOnce = 256;

// The element of rows with floats behind what they have.
RowLayout withProperties(RowLayout element, const BrickMap& brick) {
  for (const BrickChannel& channel : brick.channels()) {
    for (const std::string& name : channel.properties) {
      std::erase_if(element.properties,
                    [&](const RowProperty& property) { return property.name == name; });
      RowProperty property;
      property.name = name;
      property.offset = element.row_bytes;
      element.properties.push_back(property);
      element.row_bytes += sizeof(float);
    }
  }
  return element;
}

class BrickRows final : public CloudRows {
 public:
  BrickRows(std::unique_ptr<CloudRows> rows, BrickMap brick, RecordDecoder decoder,
            std::optional<double> filter_width)
      : rows_(std::move(rows)),
        brick_(std::move(brick)),
        decoder_(std::move(decoder)),
        filter_width_(filter_width),
        element_(withProperties(rows_->element(), brick_)) {}

  const std::string& path() const override { return rows_->path(); }
  const RowLayout& element() const override { return element_; }
  UpAxis up() const override { return rows_->up(); }
  std::vector<std::string> notes() const override { return rows_->notes(); }
  Status rewind() override { return rows_->rewind(); }
  std::optional<Bounds3d> statedBounds() const override { return rows_->statedBounds(); }

  Result<std::span<const std::byte>> next() override {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> batch, rows_->next());
    const std::size_t own_bytes = rows_->element().row_bytes;
    const std::size_t count = batch.size() / own_bytes;
    bytes_.resize(count * element_.row_bytes);
    Status failure;
    std::mutex mutex;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kLookUpsAtOnce),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        for (std::size_t i = range.begin(); i < range.end(); ++i) {
                          std::byte* row = &bytes_[i * element_.row_bytes];
                          std::memcpy(row, &batch[i * own_bytes], own_bytes);
                          const Status status = lookUp(row, row + own_bytes);
                          if (status.ok()) continue;
                          const std::lock_guard lock(mutex);
                          failure = status;
                          return;
                        }
                      });
    if (!failure.ok()) return failure;
    return std::span<const std::byte>(bytes_);
  }

 private:
  // Writes the values for a row.
  Status lookUp(const std::byte* row, std::byte* out) const {
    std::array<float, kMaxBrickValues> values;
    const std::span<float> found(values.data(), brick_.valueCount());
    CloudRecord record;
    bool has_values = decoder_.decode(row, record);
    if (has_values) {
      const double width = filter_width_.value_or(2 * static_cast<double>(record.radius));
      SURFEIT_ASSIGN_OR_RETURN(has_values,
                               brick_.lookup(record.position, record.normal, width, &found[0]));
    }
    if (!has_values) std::fill(found.begin(), found.end(), std::numeric_limits<float>::quiet_NaN());
    std::memcpy(out, found.data(), found.size_bytes());
    return {};
  }

  std::unique_ptr<CloudRows> rows_;
  BrickMap brick_;
  RecordDecoder decoder_;
  std::optional<double> filter_width_;
  RowLayout element_;
  std::vector<std::byte> bytes_;
};

}  // namespace

Result<std::unique_ptr<CloudRows>> addBrickValues(std::unique_ptr<CloudRows> rows,
                                                  const std::string& brick_path,
                                                  std::optional<double> filter_width) {
  SURFEIT_ASSIGN_OR_RETURN(BrickMap brick, BrickMap::open(brick_path, kBrickRowsBytes));
  SURFEIT_ASSIGN_OR_RETURN(RecordDecoder decoder,
                           RecordDecoder::create(rows->element(), rows->path()));
  return std::unique_ptr<CloudRows>(std::make_unique<BrickRows>(std::move(rows), std::move(brick),
                                                                std::move(decoder), filter_width));
}

}  // namespace surfeit
