// Deterministic scenes with any number of surfels, for tests of scale: each surfel is a function of
// the recipe and its record number alone, so that records can be made in any order, by any number
// of threads, and again.
//
// The geometry is fixed (surfels/generated/scene_surfaces.h); the number of surfels sets the
// density. Surfaces get surfels by their area, and a surface of n surfels is divided into n cells
// (core/square_strata.h); a surfel stands for one cell: its radius circumscribes the cell, and the
// areas of all surfels sum up to the area of the scene.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"
#include "surfels/generated/scene_recipe.h"
#include "surfels/generated/scene_surfaces.h"
#include "surfels/generated/surface_surfel.h"

namespace surfeit {

inline constexpr UpAxis kGeneratedUpAxis = UpAxis::kZ;

// A permutation of 0 .. count - 1 that needs no memory: a Feistel network of four rounds on the
// bits of count - 1, walked along until it comes back into the range (fewer than two steps on
// average). Immutable; safe from any thread.
class RecordPermutation {
 public:
  RecordPermutation(std::uint64_t count, std::uint64_t seed);
  // index < count.
  std::uint64_t operator()(std::uint64_t index) const;

 private:
  std::uint64_t count_;
  std::uint64_t key_;
  int low_bits_, high_bits_;
};

// The records of a recipe, numbered from 0 within its part. Takes about 5 MB. Immutable; safe from
// any thread.
class SceneGenerator {
 public:
  // kInvalidArgument as checkSceneRecipe.
  static Result<SceneGenerator> create(const SceneRecipe& recipe);

  const SceneRecipe& recipe() const { return recipe_; }
  // Records of the part.
  std::uint64_t recordCount() const { return end_ - begin_; }
  CloudChannels channels() const;
  // Area of all surfaces in m^2, which the areas of the surfels of all parts sum up to (but for the
  // outlier and for repeated records).
  double area() const { return area_; }

  // Makes records first_record .. first_record + surfels.size() - 1, all below recordCount().
  void generate(std::uint64_t first_record, std::span<Surfel> surfels) const;

 private:
  // A surface, the run of scan positions that it has, and the rows of its cells.
  struct Placed {
    std::uint64_t first = 0;  // the run ends where that of the next surface begins
    std::uint64_t rows = 0;
    std::uint64_t key = 0;  // of its random numbers
  };

  explicit SceneGenerator(const SceneRecipe& recipe);
  void placeSurfels();
  std::uint64_t originalOf(std::uint64_t record) const;
  std::size_t surfaceOf(std::uint64_t position) const;
  Surfel outlier() const;

  SceneRecipe recipe_;
  std::uint64_t begin_ = 0, end_ = 0;  // records of the part, in the whole
  RecordPermutation permutation_;
  std::uint64_t duplicate_limit_ =
      0;  // a record repeats another when 32 bits of its hash are below
  std::vector<Surface> surfaces_;
  std::vector<Placed> placed_;  // one more than surfaces
  double area_ = 0;
  double area_share_ = 0;  // of one surfel

  // guide_[position >> guide_shift_] is the surface where a search for `position` begins
  std::vector<std::uint32_t> guide_;
  int guide_shift_ = 0;
};

}  // namespace surfeit
