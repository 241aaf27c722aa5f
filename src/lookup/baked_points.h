// The points of a baked cloud, out of core: sorted along a curve in a temporary file, in pages of
// equal size with a tree of boxes above them, and a cache of pages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "brick/brick_input.h"
#include "core/bounds.h"
#include "storage/temporary_bytes.h"
#include "surfeit/brick.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// A run of points along the curve, decoded. Immutable.
struct BakedPage {
  static constexpr std::size_t kPoints = 512;
  // Points with a box of their own within the page.
  static constexpr std::size_t kRunPoints = 32;

  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;  // unit; zero: none
  std::vector<float> values;       // of all points
  std::vector<Bounds3d> runs;
};

// Safe from any thread once it is open.
class BakedPoints {
 public:
  // Boxes of one level that share one of the next.
  static constexpr std::size_t kFanOut = 8;

  struct Options {
    std::string path;
    std::vector<std::string> values;  // as LookupOptions
    RowReaderOptions reading;
    bool strict = false;
    std::uint64_t sort_bytes = 0;  // while it is opened
    std::uint64_t hold_bytes = 0;  // afterwards: boxes and cached pages
    int threads = 1;               // each holds kHeldPages
    // The budget of the job that gives so much is hold_bytes twice, and this: for the message that
    // tells what would do.
    std::uint64_t beside_bytes = 0;
    std::string temporary_directory;
  };
  static constexpr std::size_t kHeldPages = 4;

  // Reads the cloud twice: bounds, and points. kBudgetTooSmall where hold_bytes has no room for the
  // boxes, and 4 pages a thread.
  static Result<std::unique_ptr<BakedPoints>> open(const Options& options, Progress& progress);

  const std::vector<BrickChannel>& channels() const { return channels_; }
  std::size_t valueCount() const { return value_count_; }
  std::uint64_t pointCount() const { return point_count_; }
  std::uint64_t skippedCount() const { return skipped_; }
  bool hasNormals() const { return has_normals_; }
  // Between neighbours on a surface: the median over the pages; 0: all points are at one place.
  double spacing() const { return spacing_; }

  // Level 0 has a box for each page; the last level has one.
  const std::vector<std::vector<Bounds3d>>& boxes() const { return boxes_; }
  Result<std::shared_ptr<const BakedPage>> page(std::size_t number);

  std::uint64_t temporaryBytes() const { return temporary_bytes_; }
  std::uint64_t loads() const { return loads_; }

 private:
  struct Record;
  BakedPoints() = default;
  Result<BrickExtent> measure(const Options& options, Progress& progress);
  Status sortInto(const Options& options, const BrickExtent& extent, Progress& progress);
  Status addBoxes(std::span<const std::byte> records, AreaMedian& areas);
  void raiseTree();
  Result<std::shared_ptr<const BakedPage>> load(std::size_t number);
  std::size_t recordBytes() const;
  std::size_t pageBytes() const;

  std::vector<BrickChannel> channels_;
  std::size_t value_count_ = 0;
  std::uint64_t point_count_ = 0, skipped_ = 0;
  bool has_normals_ = false, has_areas_ = false;
  double spacing_ = 0;
  std::vector<std::vector<Bounds3d>> boxes_;
  std::uint64_t temporary_bytes_ = 0;

  using Entry = std::pair<std::size_t, std::shared_ptr<const BakedPage>>;
  std::mutex mutex_, file_mutex_;  // of the cache, and of the file
  std::optional<TemporaryBytes> file_;
  std::size_t most_pages_ = 0;  // in the cache
  std::list<Entry> cache_;      // the last used first
  std::unordered_map<std::size_t, std::list<Entry>::iterator> places_;
  std::uint64_t loads_ = 0;
};

}  // namespace surfeit
