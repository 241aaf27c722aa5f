// Surfels into clouds of any format, under the names that src/surfels/rows/surfel_mapping.h reads.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Writes surfels as rows (surfels/rows/surfel_rows.h) into the format that the extension of the
// name tells (cloud/cloud_formats.h). One thread at a time. The file appears when finish()
// succeeds.
class SurfelWriter {
 public:
  // `channels` says which optional properties the file gets. `options` has the rest; its
  // properties are set here, and its progress is told what the format cannot keep, here and in
  // finish(). Surfels are counted from `origin`.
  static Result<SurfelWriter> create(const std::string& path, const CloudChannels& channels,
                                     RowWriterOptions options = {},
                                     const glm::dvec3& origin = glm::dvec3(0));
  SurfelWriter(SurfelWriter&&) noexcept;
  SurfelWriter& operator=(SurfelWriter&&) noexcept;
  ~SurfelWriter();
  Status write(std::span<const Surfel> surfels);
  Status finish();
  // As RowWriter has it.
  std::uint64_t temporaryBytes() const;

 private:
  struct State;
  explicit SurfelWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
