// Surfels by count: the pieces of a DicePlan.
#include <algorithm>
#include <glm/geometric.hpp>

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
  // Area and reach of the triangles that have no surfels of their own.
  struct Carried {
    double area = 0;
    glm::dvec3 centroid{0};
    std::uint64_t piece = 0;  // that takes them over: the one nearest to their centroid
  };

  Carried gatherCarried(const DiceJob& job, const TriangleDice& dice) const {
    Carried carried;
    for (std::uint64_t i = job.carried_begin; i < job.carried_end; ++i) {
      const std::uint32_t triangle = plan_.order()[i];
      if (triangle == job.triangle) continue;
      const double area = triangleArea(mesh_, triangle);
      carried.area += area;
      carried.centroid += area * wholeTriangle(mesh_, triangle).centroid();
    }
    if (carried.area > 0) {
      carried.centroid /= carried.area;
      carried.piece = dice.pieceNear(carried.centroid);
    }
    return carried;
  }

  // Gives the carried area to the nearest of the surfels from `begin`, and widens its disk over the
  // carried triangles, so that they leave no holes. Those far away (the curve jumps now and then)
  // are left: a hole of their size is better than so large a disk.
  void takeOver(const DiceJob& job, const Carried& carried, std::vector<Surfel>& surfels,
                std::size_t begin) const {
    const glm::vec3 centroid(carried.centroid);
    Surfel& surfel = *std::min_element(
        surfels.begin() + std::ptrdiff_t(begin), surfels.end(), [&](const auto& a, const auto& b) {
          return glm::distance(a.position, centroid) < glm::distance(b.position, centroid);
        });
    surfel.area = float(double(surfel.area) + carried.area);
    const float reach = float(2 * plan_.spacing());
    for (std::uint64_t i = job.carried_begin; i < job.carried_end; ++i) {
      const std::uint32_t triangle = plan_.order()[i];
      if (triangle == job.triangle) continue;
      float radius = 0;
      for (int k = 0; k < 3; ++k) {
        const glm::vec3& corner = mesh_.position[mesh_.triangle[triangle][k]];
        radius = std::max(radius, glm::distance(corner, surfel.position));
      }
      if (radius <= reach) surfel.radius = std::max(surfel.radius, radius);
    }
  }

  void addPieces(const PieceRange& range, SurfelBatch& batch) const {
    const DiceJob& job = range.job;
    std::vector<Surfel>& surfels = batch.surfels;
    const Micropolygon whole = wholeTriangle(mesh_, job.triangle);
    const TriangleDice dice(whole, job.area, job.piece_count, plan_.spacing());
    const Carried carried = gatherCarried(job, dice);
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
      if (carried.area > 0 && i == carried.piece) takeOver(job, carried, surfels, begin);
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
