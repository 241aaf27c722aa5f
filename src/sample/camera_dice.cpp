#include "sample/camera_dice.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "core/split_mix.h"

namespace surfeit {
namespace {

// A piece has from 1 / kSlack to kSlack times the area that is allowed.
constexpr double kSlack = std::numbers::sqrt2;
// Halvings after which a piece stays as it is: 2^-60 of a triangle is below the digits of places.
constexpr std::uint64_t kDeepestPath = std::uint64_t{1} << 60;
// Radius of a disk that stands for triangles left out, over the root of its area: as of half a
// square, around which pieces come to lie.
constexpr double kRouletteRadius = 1.06;

}  // namespace

double rouletteNumber(std::uint64_t index) {
  // Bit k of the index, flipped by a hash of the bits above, is digit k after the point
  double number = 0;
  for (int k = 0; k < 32; ++k) {
    const std::uint64_t above = index >> (k + 1);
    const std::uint64_t flip = splitMix(above * 64 + std::uint64_t(k)) >> 63;
    number += double(((index >> k) & 1) ^ flip) * std::ldexp(1.0, -k - 1);
  }
  return number;
}

CameraPiece CameraDice::whole(std::uint32_t triangle) const {
  return {triangle, 1, triangleArea(mesh_, triangle), wholeTriangle(mesh_, triangle)};
}

double CameraDice::allowedArea(const CameraPiece& piece) const {
  return spacing_.areaFor(piece.polygon.centroid(), piece.polygon.radius());
}

bool CameraDice::isSmall(const CameraPiece& piece) const {
  return piece.area <= kSlack * allowedArea(piece) || piece.path >= kDeepestPath;
}

void CameraDice::halve(const CameraPiece& piece, CameraPiece (&halves)[2]) const {
  for (std::uint64_t i = 0; i < 2; ++i) {
    halves[i] = {piece.triangle, piece.path << 1 | i, 0.5 * piece.area,
                 surfeit::piece(piece.polygon, 2, i)};
  }
}

double CameraDice::mostPieces(const CameraPiece& piece) const {
  if (isSmall(piece)) return 1;
  const double least = spacing_.leastArea(piece.polygon.centroid(), piece.polygon.radius());
  return 2 * piece.area / std::max(least, 1e-300);
}

void CameraDice::appendParts(const CameraPiece& piece, std::vector<PiecePart>& parts) const {
  const double allowed = allowedArea(piece), least = allowed / kSlack;
  const std::size_t begin = parts.size();
  surfeit::appendParts(piece.polygon, piece.area, std::sqrt(allowed), parts);
  if (piece.path > 1 || piece.area >= least) return;

  // The numbers of slabs are those of the triangle, spread evenly
  double number = rouletteNumber(piece.triangle);
  std::size_t kept = begin;
  for (std::size_t k = begin; k < parts.size(); ++k, number += std::numbers::phi) {
    if ((number - std::floor(number)) * least >= parts[k].area) continue;
    parts[kept] = parts[k];
    parts[kept].area = std::max(parts[k].area, least);
    parts[kept].radius = std::max(parts[k].radius, kRouletteRadius * std::sqrt(least));
    ++kept;
  }
  parts.resize(kept);
}

namespace {

// Pieces that are cut where they are lit.
class CameraTask final : public SurfelTask {
 public:
  CameraTask(const CameraDice& dice, const SurfelMaker& maker, std::vector<CameraPiece> pieces)
      : dice_(dice), maker_(maker), pieces_(std::move(pieces)) {}

  void fill(SurfelBatch& batch) const override {
    std::vector<CameraPiece> stack;
    CameraPiece halves[2];
    for (const CameraPiece& first : pieces_) {
      stack.push_back(first);
      while (!stack.empty()) {
        const CameraPiece piece = stack.back();
        stack.pop_back();
        if (dice_.isSmall(piece)) {
          addPiece(piece, batch);
          continue;
        }
        dice_.halve(piece, halves);
        stack.push_back(halves[1]);
        stack.push_back(halves[0]);
      }
    }
  }

 private:
  void addPiece(const CameraPiece& piece, SurfelBatch& batch) const {
    std::vector<PiecePart> parts;
    dice_.appendParts(piece, parts);
    std::vector<float> there(parts.size());
    const std::size_t begin = batch.surfels.size();
    // Light that is sampled anew when a camera moves would flicker: the piece alone decides
    const std::uint64_t seed = splitMix(splitMix(piece.triangle) ^ piece.path);
    for (std::size_t k = 0; k < parts.size(); ++k) {
      batch.surfels.push_back(maker_.make(piece.triangle, parts[k], seed + k, there[k]));
    }
    maker_.applyMasks(there, begin, batch);
  }

  const CameraDice& dice_;
  const SurfelMaker& maker_;
  const std::vector<CameraPiece> pieces_;
};

class CameraTasks final : public SurfelTasks {
 public:
  CameraTasks(const CameraDice& dice, const SurfelMaker& maker, std::vector<std::uint32_t> order)
      : dice_(dice), maker_(maker), order_(std::move(order)) {}

  std::unique_ptr<SurfelTask> next() override {
    std::vector<CameraPiece> pieces;
    for (double room = double(kTaskPieces); room > 0;) {
      CameraPiece piece;
      if (!nextPiece(piece)) break;
      room -= dice_.mostPieces(piece);
      pieces.push_back(piece);
    }
    if (pieces.empty()) return nullptr;
    return std::make_unique<CameraTask>(dice_, maker_, std::move(pieces));
  }

 private:
  // The next piece that gives at most half as many surfels as a task has.
  bool nextPiece(CameraPiece& piece) {
    for (;;) {
      if (!stack_.empty()) {
        piece = stack_.back();
        stack_.pop_back();
      } else {
        if (next_ == order_.size()) return false;
        piece = dice_.whole(order_[next_++]);
      }
      if (dice_.mostPieces(piece) <= double(kTaskPieces / 2)) return true;
      CameraPiece halves[2];
      dice_.halve(piece, halves);
      stack_.push_back(halves[1]);
      stack_.push_back(halves[0]);
    }
  }

  const CameraDice& dice_;
  const SurfelMaker& maker_;
  const std::vector<std::uint32_t> order_;
  std::size_t next_ = 0;
  std::vector<CameraPiece> stack_;
};

}  // namespace

std::unique_ptr<SurfelTasks> makeCameraTasks(const CameraDice& dice, const SurfelMaker& maker,
                                             std::vector<std::uint32_t> triangle_order) {
  return std::make_unique<CameraTasks>(dice, maker, std::move(triangle_order));
}

}  // namespace surfeit
