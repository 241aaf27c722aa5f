#include "cloud/edits/moved_positions.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "core/bounds.h"

namespace surfeit {
namespace {

class WatchingWriter final : public RowWriter {
 public:
  WatchingWriter(std::unique_ptr<RowWriter> writer, const std::array<std::size_t, 3>& offsets)
      : writer_(std::move(writer)), offsets_(offsets) {}

  const RowLayout& element() const override { return writer_->element(); }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = writer_->notes();
    if (is_finished_) {
      if (std::optional<std::string> note = ofMoves()) notes.push_back(std::move(*note));
    }
    return notes;
  }

  Status writeRows(std::span<const std::byte> rows) override {
    SURFEIT_RETURN_IF_ERROR(writer_->writeRows(rows));
    for (std::size_t at = 0; at < rows.size(); at += element().row_bytes) look(&rows[at]);
    return {};
  }

  Status finish() override {
    SURFEIT_RETURN_IF_ERROR(writer_->finish());
    is_finished_ = true;
    return {};
  }

 private:
  void look(const std::byte* row) {
    glm::dvec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      double value = 0;
      std::memcpy(&value, row + offsets_[static_cast<std::size_t>(axis)], sizeof value);
      if (!std::isfinite(value)) return;
      farthest_ =
          std::max(farthest_, std::abs(static_cast<double>(static_cast<float>(value)) - value));
      position[axis] = value;
    }
    bounds_.add(position);
    ++count_;
  }

  // As for the floats of an index: what moves by less than a thousandth of the spacing stays.
  std::optional<std::string> ofMoves() const {
    const double spacing =
        bounds_.longestSide() / std::sqrt(std::max(1.0, static_cast<double>(count_)));
    if (farthest_ <= 1e-3 * spacing) return std::nullopt;
    return fmt::format(
        "positions are floats in this format: they move by up to {:.2g}, beside a spacing of about "
        "{:.2g}: PLY, text, LAS, PRT and OpenVDB keep them, or move the cloud near 0 "
        "(convert --transform)",
        farthest_, spacing);
  }

  std::unique_ptr<RowWriter> writer_;
  std::array<std::size_t, 3> offsets_;  // of x, y, z in a row
  Bounds3d bounds_;
  std::uint64_t count_ = 0;
  double farthest_ = 0;
  bool is_finished_ = false;
};

}  // namespace

std::unique_ptr<RowWriter> watchPositions(std::unique_ptr<RowWriter> writer) {
  std::array<std::size_t, 3> offsets{};
  for (std::size_t i = 0; i < 3; ++i) {
    constexpr const char* kNames[] = {"x", "y", "z"};
    const RowProperty* const property = writer->element().find(kNames[i]);
    if (property == nullptr || property->type != ValueType::kFloat64) return writer;
    offsets[i] = property->offset;
  }
  return std::make_unique<WatchingWriter>(std::move(writer), offsets);
}

}  // namespace surfeit
