// Rows of clouds on their way through a gather: where a receiver stands in a row of the input, and
// how a row of the result is made of an input row and what was gathered there.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cloud/edits/rows_with_values.h"
#include "cloud/rows/row_layout.h"
#include "gather/rules/receiver.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"
#include "surfels/rows/surfel_mapping.h"

namespace surfeit {

// Finds position and normal in the rows of an element, by the names of docs/format.md, "Surfel
// clouds in PLY". What else a receiver holds (a radius of zero, say) is no concern of the gather
// and never makes it invalid. Immutable; safe from any thread.
class ReceiverMapping {
 public:
  // kCorruption as SurfelMapping::create has it for these properties.
  static Result<ReceiverMapping> create(const RowLayout& element, const std::string& path);

  // What positions of receivers are counted from: the origin of the scene. Before rows are decoded.
  void setOrigin(const glm::dvec3& origin) { surfels_.setOrigin(origin); }

  // Without normals every receiver gathers over the whole sphere.
  bool hasNormals() const { return surfels_.channels().normal; }
  // Whether receivers say from where they are looked at: view_x view_y view_z, a direction of any
  // length from the eye to the receiver.
  bool hasViews() const { return views_.has_value(); }

  // Returns false, and counts the defect under `record`, when the row holds no valid receiver.
  bool decode(const std::byte* row, std::uint64_t record, LocalReceiver& receiver,
              SurfelDefects& defects) const;

  // The position of a valid row, about no origin.
  glm::dvec3 positionOf(const std::byte* row) const { return surfels_.positionOf(row); }

  // What is wrong with a row that decode refused, found and expected.
  std::string describeDefect(const std::byte* row) const { return surfels_.describeDefect(row); }

 private:
  glm::vec3 viewOf(const std::byte* row) const;

  using Views = std::array<RowProperty, 3>;
  ReceiverMapping(SurfelMapping surfels, std::optional<Views> views)
      : surfels_(std::move(surfels)), views_(std::move(views)) {}

  SurfelMapping surfels_;  // made from an element that has nothing but position and normal
  std::optional<Views> views_;
};

// Rows of the result: the scalars of the input row, then what was gathered, as floats. A property
// that the input has under the name of a result is replaced where it stands. Immutable.
class ResultRows {
 public:
  ResultRows(const RowLayout& input, std::uint32_t outputs, GatherMode mode);

  const std::vector<RowProperty>& properties() const { return rows_.properties(); }
  std::size_t rowBytes() const { return rows_.rowBytes(); }

  // Makes one row of rowBytes() at `output`.
  void make(const std::byte* input, const GatherResult& result, std::byte* output) const;

 private:
  std::uint32_t outputs_;
  RowsWithValues rows_;
};

}  // namespace surfeit
