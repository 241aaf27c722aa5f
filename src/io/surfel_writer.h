// Surfels into PLY, under the names that src/io/surfel_mapping.h reads.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/ply_format.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Writes surfels as PLY with the properties above, as floats (two_sided and group: uchar). One
// thread at a time. The file appears when finish() succeeds.
class SurfelWriter {
 public:
  // `channels` says which optional properties the file gets.
  static Result<SurfelWriter> create(const std::string& path, const CloudChannels& channels,
                                     PlyEncoding encoding, std::vector<std::string> comments = {});
  SurfelWriter(SurfelWriter&&) noexcept;
  SurfelWriter& operator=(SurfelWriter&&) noexcept;
  ~SurfelWriter();
  Status write(std::span<const Surfel> surfels);
  Status finish();

 private:
  struct State;
  explicit SurfelWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
