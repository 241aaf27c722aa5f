// Turns normals that point to either side of their surface so that neighbours agree, over the whole
// cloud and out of core (docs/surfels.md, "Normals from the neighbourhood"):
//
//   chunks along the curve --spanning trees--> pieces --votes of pairs--> components --> sides
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octree/build/sorted_surfels.h"
#include "octree/read/paged_octree.h"
#include "storage/temporary_bytes.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

struct OrientationOptions {
  int threads = 1;
  std::uint64_t memory_bytes = 0;  // of the sorter of edges
  std::string temporary_directory;
  UpAxis up = kDefaultUpAxis;
};

// Of all surfels of a scene: to be turned or not. One thread at a time.
class Sides {
 public:
  // Normals that need a side, of the surfels that the octree holds. Memory besides: 60 bytes for
  // every piece, of mostly some thousand surfels, and 100 for its neighbours.
  static Result<Sides> find(PagedOctree& octree, const OrientationOptions& options,
                            Progress& progress);
  // What searches of so many threads take, besides the octree's own readers.
  static std::uint64_t searcherBytes(int threads);

  // Of the surfels of a page.
  Status read(std::uint32_t page, std::span<bool> is_turned);

  std::uint64_t temporaryBytes() const { return labels_.size(); }

 private:
  Sides(TemporaryBytes labels, std::vector<bool> is_turned, std::size_t page_capacity)
      : labels_(std::move(labels)),
        is_turned_(std::move(is_turned)),
        page_capacity_(page_capacity) {}

  TemporaryBytes labels_;        // by surfelId
  std::vector<bool> is_turned_;  // by piece
  std::size_t page_capacity_ = 0;
  std::vector<std::uint32_t> buffer_;
};

// The surfels of a scene in curve order, with normals turned.
class OrientedSurfelStream : public SortedSurfelStream {
 public:
  OrientedSurfelStream(const SceneFile& scene, Sides& sides) : scene_(scene), sides_(sides) {}
  Result<std::shared_ptr<const SortedBatch>> next() override;

 private:
  const SceneFile& scene_;
  Sides& sides_;
  std::uint32_t next_page_ = 0;
  std::unique_ptr<bool[]> is_turned_;
};

}  // namespace surfeit
