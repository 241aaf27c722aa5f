// A slab: a run of whole octree cells ("bricks") along the curve, the unit of work of the octree
// builder. Where slabs and bricks begin follows from the surfels alone, so the file does not depend
// on threads or memory. docs/architecture.md, "Building", has the picture.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "octree/build/sorted_surfels.h"

namespace surfeit {

// Most surfels of a brick, unless they all lie in one cell of the finest level. A multiple of all
// page capacities and at least the largest leaf.
inline constexpr std::size_t kBrickSurfels = 16384;

// A slab ends where a cell of two bricks or more has had so many surfels, counted before repeated
// ones are left out. So slabs begin anew at places that can be told without cutting all before:
// machines that share a scene cut it there.
inline constexpr std::size_t kFreshSurfels = 4 * kBrickSurfels;

// What lies around the surfels of a stream, where they are a part of a cloud that begins and ends
// at such places.
struct StreamEnds {
  int begin_level =
      0;              // at which the surfel before the first one differs from it; 0: there is none
  int end_level = 0;  // at which the last surfel differs from the one behind it; 0: there is none
};

// The largest cell that begins where the last brick ended and holds no more than kBrickSurfels.
struct Brick {
  std::size_t end = 0;     // surfels of the slab before its end
  int level = 0;           // of the cell
  int boundary_level = 0;  // where its last surfel and the next one come to lie in different cells;
                           // 0 at the end of the cloud
};

// A cell of the finest level with more surfels than a brick is one leaf that is made in pieces.
struct GiantPiece {
  bool begins = false, ends = false;  // whether it is the first, and the last
};

struct Slab {
  // Its surfels: tickets [begin, end) of batches, in order.
  struct Run {
    std::shared_ptr<const SortedBatch> batch;
    std::size_t begin = 0, end = 0;
  };
  std::vector<Run> runs;
  std::size_t surfel_count = 0;
  std::vector<Brick> bricks;
  std::optional<GiantPiece> giant;  // then the slab has one brick, which is the piece
};

// Cuts a stream into slabs of kBrickSurfels to 2 * kBrickSurfels surfels (the last, and those
// before slabs begin anew: any). One thread at a time.
class SlabCutter {
 public:
  explicit SlabCutter(SortedSurfelStream& stream, const StreamEnds& ends = {});
  // The next slab; nothing at the end.
  Result<std::optional<Slab>> next();

 private:
  Status ensure(std::size_t count);
  CurveKey keyAt(std::size_t offset) const;
  std::int64_t frontPlace() const;
  bool beginsAnew() const;
  // Surfels from the front, at most `limit`, that share the first one's cell of a level.
  std::size_t runInCell(int level, std::size_t limit) const;
  void take(std::size_t count, int level, Slab& slab);
  void takeGiantPiece(Slab& slab);

  SortedSurfelStream& stream_;
  std::deque<std::shared_ptr<const SortedBatch>> batches_;
  std::size_t at_ = 0;         // the front, in the first batch
  std::size_t available_ = 0;  // surfels from the front on, in all batches
  bool stream_ended_ = false;
  int boundary_level_;  // between the surfel before the front and the front
  const int end_level_;
  std::int64_t batch_place_ = 0;  // unfiltered surfels before the first batch
  // Where the cell of each level began that the surfel before the front lies in
  std::array<std::int64_t, kCurveLevels + 1> cell_places_{};
  bool in_giant_ = false;
};

}  // namespace surfeit
