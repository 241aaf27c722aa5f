// Surfels by count: the pieces of a DicePlan.
#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "sample/surfel_maker.h"

namespace surfeit {
namespace {

// Pieces [begin, end) of a triangle.
struct PieceRange {
  DiceJob job;
  std::uint64_t begin = 0, end = 0;
};

class PlanTask final : public SurfelTask {
 public:
  PlanTask(const DicePlan& plan, const SurfelMaker& maker, std::vector<PieceRange> ranges)
      : plan_(plan), maker_(maker), mesh_(maker.mesh()), ranges_(std::move(ranges)) {}

  void fill(SurfelBatch& batch) const override {
    for (const PieceRange& range : ranges_) addPieces(range, batch);
  }

 private:
  // A triangle that has no surfels of its own, and the piece that takes it over: the nearest one.
  struct Carried {
    std::uint64_t piece = 0;
    std::uint32_t triangle = 0;
    glm::vec3 centroid{0};
  };

  // By piece.
  std::vector<Carried> gatherCarried(const DiceJob& job, const TriangleDice& dice) const {
    std::vector<Carried> all;
    for (const std::uint32_t triangle : job.carried) {
      const glm::dvec3 centroid = wholeTriangle(mesh_, triangle).centroid();
      all.push_back({dice.pieceNear(centroid), triangle, glm::vec3(centroid)});
    }
    std::sort(all.begin(), all.end(), [](const Carried& a, const Carried& b) {
      return std::pair(a.piece, a.triangle) < std::pair(b.piece, b.triangle);
    });
    return all;
  }

  // Gives its area to the nearest of the surfels from `begin`, and widens the disk of that one over
  // it, so that it leaves no hole. One far away, which shares no corner with a triangle that has
  // surfels, is left: a hole of its size is better than so large a disk.
  void takeOver(const Carried& carried, std::vector<Surfel>& surfels, std::size_t begin) const {
    Surfel& surfel = *std::min_element(surfels.begin() + std::ptrdiff_t(begin), surfels.end(),
                                       [&](const auto& a, const auto& b) {
                                         return glm::distance(a.position, carried.centroid) <
                                                glm::distance(b.position, carried.centroid);
                                       });
    surfel.area = float(double(surfel.area) + triangleArea(mesh_, carried.triangle));
    float radius = 0;
    for (int k = 0; k < 3; ++k) {
      const glm::vec3& corner = mesh_.position[mesh_.triangle[carried.triangle][k]];
      radius = std::max(radius, glm::distance(corner, surfel.position));
    }
    if (radius <= float(2 * plan_.spacing())) surfel.radius = std::max(surfel.radius, radius);
  }

  void addPieces(const PieceRange& range, SurfelBatch& batch) const {
    const DiceJob& job = range.job;
    std::vector<Surfel>& surfels = batch.surfels;
    const Micropolygon whole = wholeTriangle(mesh_, job.triangle);
    const TriangleDice dice(whole, job.area, job.piece_count, plan_.spacing());
    const std::vector<Carried> carried = gatherCarried(job, dice);
    auto next = std::partition_point(carried.begin(), carried.end(),
                                     [&](const Carried& one) { return one.piece < range.begin; });
    std::vector<PiecePart> parts;
    std::vector<float> there;
    for (std::uint64_t i = range.begin; i < range.end; ++i) {
      parts.clear();
      dice.appendParts(i, parts);
      there.resize(parts.size());
      const std::size_t begin = surfels.size();
      for (std::size_t k = 0; k < parts.size(); ++k) {
        const std::uint64_t seed = ((job.first_surfel + i) << kMaxSlabBits) + k;
        surfels.push_back(maker_.make(job.triangle, parts[k], seed, there[k]));
      }
      for (; next != carried.end() && next->piece == i; ++next) takeOver(*next, surfels, begin);
      maker_.applyMasks(there, begin, batch);
    }
  }

  const DicePlan& plan_;
  const SurfelMaker& maker_;
  const Mesh& mesh_;
  const std::vector<PieceRange> ranges_;
};

// Cut by counts alone; a large triangle spans many tasks.
class PlanTasks final : public SurfelTasks {
 public:
  PlanTasks(DicePlan& plan, const SurfelMaker& maker) : plan_(plan), maker_(maker) {}

  std::unique_ptr<SurfelTask> next() override {
    std::vector<PieceRange> ranges;
    std::uint64_t room = kTaskPieces;
    while (room > 0) {
      if (current_.begin == current_.end) {
        if (!plan_.next(current_.job)) break;
        current_.begin = 0;
        current_.end = current_.job.piece_count;
      }
      PieceRange range = current_;
      range.end = range.begin + std::min(room, range.end - range.begin);
      room -= range.end - range.begin;
      current_.begin = range.end;
      ranges.push_back(range);
    }
    if (ranges.empty()) return nullptr;
    return std::make_unique<PlanTask>(plan_, maker_, std::move(ranges));
  }

 private:
  DicePlan& plan_;
  const SurfelMaker& maker_;
  PieceRange current_;
};

}  // namespace

std::unique_ptr<SurfelTasks> makePlanTasks(DicePlan& plan, const SurfelMaker& maker) {
  return std::make_unique<PlanTasks>(plan, maker);
}

}  // namespace surfeit
