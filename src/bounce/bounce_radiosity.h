// The new radiosities and lobes of a bounce between the gather, which finds them page by page in
// any order, and the rewriting of the scene, which takes them in order: a temporary file, and 8
// bytes of memory for every surfel page.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octree/node/lobe.h"
#include "octree/relight/radiosity_rewriter.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// Safe from any thread.
class BounceRadiosity : public RadiositySource {
 public:
  // For so many surfel pages, in a temporary file in `directory`.
  static Result<BounceRadiosity> create(const std::string& directory, std::uint32_t surfel_pages,
                                        bool has_lobes = false);
  BounceRadiosity(BounceRadiosity&& other) noexcept;

  // Once for each page. As many lobes, or none without.
  Status put(std::uint32_t surfel_page, std::span<const glm::vec3> radiosity,
             std::span<const Lobe> lobes = {});
  // All are in; before the first read.
  Status finish() { return file_.flush(); }
  // kIoError when the file does not hold what was written.
  Status read(std::uint32_t surfel_page, std::span<glm::vec3> radiosity) override {
    return read(surfel_page, radiosity, {});
  }
  Status read(std::uint32_t surfel_page, std::span<glm::vec3> radiosity,
              std::span<Lobe> lobes) override;
  bool hasLobes() const override { return has_lobes_; }

  // A number that differs between different radiosities of the scene, after finish().
  std::uint64_t content() const { return content_; }
  std::uint64_t fileBytes() const { return file_.size(); }

  static std::uint64_t memoryBytes(std::uint32_t surfel_pages);

 private:
  BounceRadiosity(TemporaryFile file, std::uint32_t surfel_pages, bool has_lobes)
      : file_(std::move(file)), offsets_(surfel_pages), has_lobes_(has_lobes) {}

  TemporaryFile file_;
  std::vector<std::uint64_t> offsets_;  // of the pages' records, each written by one thread
  bool has_lobes_ = false;
  std::atomic<std::uint64_t> content_{0};
};

}  // namespace surfeit
