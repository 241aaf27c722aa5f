#include "surfels/generated/scene_generator.h"

#include <gtest/gtest.h>
#include <xxhash.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/square_strata.h"
#include "io/test_bytes.h"
#include "io/test_directory.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr SceneKind kKinds[] = {SceneKind::kTerrain, SceneKind::kCity, SceneKind::kVolume};

SceneRecipe recipeOf(SceneKind kind, std::uint64_t surfels) {
  SceneRecipe recipe;
  recipe.kind = kind;
  recipe.surfels = surfels;
  return recipe;
}

SceneGenerator generatorOf(const SceneRecipe& recipe) {
  return std::move(SceneGenerator::create(recipe).value());
}

std::vector<Surfel> allSurfels(const SceneRecipe& recipe) {
  const SceneGenerator generator = generatorOf(recipe);
  std::vector<Surfel> surfels(generator.recordCount());
  generator.generate(0, surfels);
  return surfels;
}

void sortByContent(std::vector<Surfel>& surfels) {
  std::sort(surfels.begin(), surfels.end(),
            [](const Surfel& a, const Surfel& b) { return std::memcmp(&a, &b, sizeof a) < 0; });
}

double areaOf(const std::vector<Surfel>& surfels) {
  double area = 0;
  for (const Surfel& surfel : surfels) area += double(surfel.area);
  return area;
}

Bounds3 boundsOf(const std::vector<Surfel>& surfels) {
  Bounds3 bounds;
  for (const Surfel& surfel : surfels) bounds.add(surfel.position);
  return bounds;
}

TEST(SquareStrata, CellsCoverTheSquareExactly) {
  for (const std::uint64_t count : {1u, 2u, 7u, 100u, 997u}) {
    const std::uint64_t rows = stratumRows(count, 2.5);
    double area = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      const Share row = shareOf(i, count, rows);
      ASSERT_TRUE(row.begin <= i && i < row.end && row.end <= count);
      const Stratum cell = squareStratum(row, i, count, 5, hashOf(5, i));
      EXPECT_GT(cell.du, 0);
      EXPECT_TRUE(cell.u > 0 && cell.u < 1 && cell.v > 0 && cell.v < 1) << cell.u << " " << cell.v;
      area += cell.du * cell.dv;
    }
    EXPECT_NEAR(area, 1, 1e-12);
  }
}

TEST(SceneGenerator, AreaIsThatOfTheSceneAtEveryDensity) {
  for (const SceneKind kind : kKinds) {
    const double area = generatorOf(recipeOf(kind, 1)).area();
    for (const std::uint64_t count : {10'000u, 1'000'000u}) {
      EXPECT_NEAR(areaOf(allSurfels(recipeOf(kind, count))) / area, 1, 0.002)
          << sceneKindName(kind) << " " << count;
    }
  }
}

TEST(SceneGenerator, BoundsAreThoseOfTheSceneAtEveryDensity) {
  for (const SceneKind kind : kKinds) {
    const Bounds3 thin = boundsOf(allSurfels(recipeOf(kind, 30'000)));
    const Bounds3 dense = boundsOf(allSurfels(recipeOf(kind, 1'000'000)));
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(thin.min[axis], dense.min[axis], 25) << sceneKindName(kind) << " " << axis;
      EXPECT_NEAR(thin.max[axis], dense.max[axis], 25) << sceneKindName(kind) << " " << axis;
    }
    EXPECT_NEAR(dense.extent().x, kWorldExtent, 10);
    EXPECT_NEAR(dense.extent().y, kWorldExtent, 10);
  }
}

TEST(SceneGenerator, EverySurfelIsValid) {
  for (const SceneKind kind : kKinds) {
    for (const std::uint64_t count : {1u, 100u, 10'000u, 500'000u}) {
      for (const Surfel& surfel : allSurfels(recipeOf(kind, count))) {
        ASSERT_GT(surfel.area, 0);
        // The disk is no smaller than what it stands for
        ASSERT_GE(3.14160 * double(surfel.radius) * double(surfel.radius), double(surfel.area));
        ASSERT_EQ(surfel.isSphere(), kind == SceneKind::kVolume);
        const glm::dvec3 normal(surfel.normal);
        const double length_sq = normal.x * normal.x + normal.y * normal.y + normal.z * normal.z;
        ASSERT_NEAR(length_sq, surfel.isSphere() ? 0 : 1, 1e-6);
        for (int i = 0; i < 3; ++i) {
          ASSERT_TRUE(surfel.albedo[i] > 0 && surfel.albedo[i] <= 1) << surfel.albedo[i];
          ASSERT_GE(surfel.radiosity[i], 0);
          ASSERT_TRUE(surfel.position[i] > -1100 && surfel.position[i] < 1100);
        }
      }
    }
  }
}

TEST(SceneGenerator, TheCityHasTwoSidedLeavesAtEveryDensity) {
  for (const std::uint64_t count : {100'000u, 2'000'000u}) {
    double leaf_area = 0, area = 0;
    for (const Surfel& surfel : allSurfels(recipeOf(SceneKind::kCity, count))) {
      area += double(surfel.area);
      if (surfel.isTwoSided()) leaf_area += double(surfel.area);
    }
    EXPECT_NEAR(leaf_area / area, 0.135, 0.005) << count;
  }
}

// Where there are more surfels than leaves, those of a leaf lie on it and have its area.
TEST(SceneGenerator, DenseLeavesAreDiscsOfTheirArea) {
  const std::uint64_t count = 4'000'000'000;
  const SceneGenerator generator = generatorOf(recipeOf(SceneKind::kCity, count));
  std::vector<Surfel> surfels(200'000);
  std::size_t leaves = 0;
  for (std::uint64_t begin = 0; leaves < 20 && begin + surfels.size() < count; begin += 1'000'000) {
    generator.generate(begin, surfels);
    double area = -1e9;  // the first leaf of the batch may have begun before
    Bounds3 bounds;
    for (std::size_t i = 1; i < surfels.size(); ++i) {
      if (!surfels[i].isTwoSided()) {
        area = -1e9;
      } else if (surfels[i].normal == surfels[i - 1].normal) {
        area += double(surfels[i].area);
        bounds.add(surfels[i].position);
      } else {
        if (area > 0) {
          ++leaves;
          EXPECT_NEAR(area, 3.14159 * 0.09 * 0.09, 0.0015);
          const glm::vec3 extent = bounds.extent();
          const double diameter = std::max({extent.x, extent.y, extent.z});
          EXPECT_TRUE(diameter > 0.1 && diameter < 0.181) << diameter;
        }
        area = double(surfels[i].area);
        bounds = {};
        bounds.add(surfels[i].position);
      }
    }
  }
  EXPECT_GE(leaves, 20u);
}

// The same on every machine: a change of these numbers is a change of all scenes.
TEST(SceneGenerator, FirstSurfelsAreTheseBytes) {
  const auto hashOfFirst = [](SceneRecipe recipe) {
    const SceneGenerator generator = generatorOf(recipe);
    std::vector<Surfel> surfels(1000);
    generator.generate(0, surfels);
    std::string bytes;  // without tints, which nothing generated has
    for (const Surfel& surfel : surfels) {
      EXPECT_FALSE(surfel.isTinted());
      bytes.append(reinterpret_cast<const char*>(&surfel), offsetof(Surfel, tint));
    }
    return XXH3_64bits(bytes.data(), bytes.size());
  };
  EXPECT_EQ(hashOfFirst(recipeOf(SceneKind::kTerrain, 1'000'000)), 9148122055814863637u);
  EXPECT_EQ(hashOfFirst(recipeOf(SceneKind::kVolume, 1'000'000)), 12887501534336039266u);
  SceneRecipe city = recipeOf(SceneKind::kCity, 1'000'000);
  city.order = RecordOrder::kShuffled;  // some of all shapes
  EXPECT_EQ(hashOfFirst(city), 4060475722766349515u);
  city.seed = 2;
  EXPECT_EQ(hashOfFirst(city), 6765333007388874125u);
}

TEST(SceneGenerator, RecordsDoNotDependOnTheBatch) {
  for (const SceneKind kind : kKinds) {
    for (const RecordOrder order : {RecordOrder::kScan, RecordOrder::kShuffled}) {
      SceneRecipe recipe = recipeOf(kind, 20'000);
      recipe.order = order;
      recipe.duplicate_percent = 10;
      const SceneGenerator generator = generatorOf(recipe);
      const std::vector<Surfel> whole = allSurfels(recipe);
      std::vector<Surfel> single(whole.size());
      for (std::size_t i = whole.size(); i-- > 0;) generator.generate(i, {&single[i], 1});
      EXPECT_TRUE(areEqual(single, whole)) << sceneKindName(kind);
    }
  }
}

TEST(SceneGenerator, PartsConcatenateToTheWhole) {
  SceneRecipe recipe = recipeOf(SceneKind::kCity, 10'001);
  recipe.outlier_distance = 1e6;
  recipe.duplicate_percent = 20;
  const std::vector<Surfel> whole = allSurfels(recipe);
  for (const std::uint32_t parts : {1u, 3u, 7u, 20'000u}) {
    std::vector<Surfel> joined;
    recipe.part_count = parts;
    // Of very many parts, only some are looked at
    const std::uint32_t first = parts > 100 ? parts - 3 : 1;
    for (recipe.part = first; recipe.part <= parts; ++recipe.part) {
      const std::vector<Surfel> part = allSurfels(recipe);
      joined.insert(joined.end(), part.begin(), part.end());
    }
    ASSERT_LE(joined.size(), whole.size());
    EXPECT_TRUE(areEqual(joined, {whole.end() - std::ptrdiff_t(joined.size()), whole.end()}));
    if (first == 1) {
      EXPECT_EQ(joined.size(), whole.size());
    }
  }
}

TEST(SceneGenerator, ShuffledRecordsAreThoseOfTheScan) {
  SceneRecipe recipe = recipeOf(SceneKind::kCity, 12'345);
  std::vector<Surfel> scan = allSurfels(recipe);
  recipe.order = RecordOrder::kShuffled;
  std::vector<Surfel> shuffled = allSurfels(recipe);
  EXPECT_FALSE(areEqual(scan, shuffled));
  sortByContent(scan);
  sortByContent(shuffled);
  EXPECT_TRUE(areEqual(scan, shuffled));
}

TEST(RecordPermutation, IsOneToOneForEveryCount) {
  for (const std::uint64_t count : {1u, 2u, 3u, 5u, 64u, 65u, 1000u, 4097u}) {
    const RecordPermutation permutation(count, 3);
    std::set<std::uint64_t> images;
    for (std::uint64_t i = 0; i < count; ++i) {
      EXPECT_LT(permutation(i), count);
      images.insert(permutation(i));
    }
    EXPECT_EQ(images.size(), count);
  }
}

TEST(SceneGenerator, NeighboursInTheScanAreNeighboursInSpace) {
  const auto meanStep = [](RecordOrder order) {
    SceneRecipe recipe = recipeOf(SceneKind::kCity, 100'000);
    recipe.order = order;
    const std::vector<Surfel> surfels = allSurfels(recipe);
    double sum = 0;
    for (std::size_t i = 1; i < surfels.size(); ++i) {
      const glm::vec3 step = surfels[i].position - surfels[i - 1].position;
      sum += std::abs(double(step.x)) + std::abs(double(step.y)) + std::abs(double(step.z));
    }
    return sum / double(surfels.size());
  };
  EXPECT_LT(meanStep(RecordOrder::kScan), 12);
  EXPECT_GT(meanStep(RecordOrder::kShuffled), 500);
}

TEST(SceneGenerator, DuplicatesRepeatEarlierRecords) {
  SceneRecipe recipe = recipeOf(SceneKind::kTerrain, 20'000);
  recipe.duplicate_percent = 25;
  std::vector<Surfel> surfels = allSurfels(recipe);
  sortByContent(surfels);
  std::size_t repeated = 0;
  for (std::size_t i = 1; i < surfels.size(); ++i) {
    if (std::memcmp(&surfels[i], &surfels[i - 1], sizeof(Surfel)) == 0) ++repeated;
  }
  EXPECT_NEAR(double(repeated) / 20'000, 0.25, 0.01);

  recipe.duplicate_percent = 100;
  surfels = allSurfels(recipe);
  for (const Surfel& surfel : surfels) ASSERT_EQ(surfel.position, surfels[0].position);
}

TEST(SceneGenerator, OutlierIsOneMoreRecord) {
  SceneRecipe recipe = recipeOf(SceneKind::kCity, 1000);
  const std::vector<Surfel> without = allSurfels(recipe);
  recipe.outlier_distance = 1e6;
  std::vector<Surfel> with = allSurfels(recipe);
  ASSERT_EQ(with.size(), 1001u);
  EXPECT_EQ(with.back().position, glm::vec3(1'000'500, 500, 0));
  with.pop_back();
  EXPECT_TRUE(areEqual(with, without));
}

class RecipeSourceTest : public DirectoryTest {
 protected:
  // As the program writes them.
  void writePly(const std::string& name, const SceneRecipe& recipe) const {
    const SceneGenerator generator = generatorOf(recipe);
    Result<SurfelWriter> writer = SurfelWriter::create(path(name), generator.channels());
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    ASSERT_TRUE(writer->write(allSurfels(recipe)).ok());
    ASSERT_TRUE(writer->finish().ok());
  }

  std::unique_ptr<SurfelSource> open(const std::string& name) const {
    Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(path(name), true);
    EXPECT_TRUE(source.ok()) << source.status().message();
    return source.ok() ? std::move(*source) : nullptr;
  }

  static std::vector<Surfel> readAll(SurfelSource& source) {
    std::vector<Surfel> surfels, batch(777);
    for (;;) {
      const Result<std::size_t> count = source.read(batch);
      EXPECT_TRUE(count.ok());
      if (!count.ok() || *count == 0) return surfels;
      surfels.insert(surfels.end(), batch.begin(), batch.begin() + std::ptrdiff_t(*count));
    }
  }

  // The same through raw rows.
  static std::vector<Surfel> readAllRows(SurfelSource& source) {
    std::vector<Surfel> surfels;
    AlignedBuffer buffer;
    SurfelDefects defects;
    for (;;) {
      const Result<Bytes> rows = source.readRows(1000, buffer);
      EXPECT_TRUE(rows.ok());
      if (!rows.ok() || rows->empty()) return surfels;
      const std::size_t begin = surfels.size();
      surfels.resize(begin + rows->size() / source.rowBytes());
      const Result<std::size_t> count =
          source.decodeRows(*rows, begin, std::span(surfels).subspan(begin), defects);
      EXPECT_TRUE(count.ok() && *count == surfels.size() - begin);
    }
  }
};

TEST_F(RecipeSourceTest, RecipeAndPlyDeliverTheSameSurfels) {
  for (const SceneKind kind : kKinds) {
    SceneRecipe recipe = recipeOf(kind, 60'000);
    recipe.order = RecordOrder::kShuffled;
    recipe.part = 2, recipe.part_count = 2;
    recipe.outlier_distance = 5e4;
    write("scene.recipe", formatSceneRecipe(recipe));
    writePly("scene.ply", recipe);
    const auto from_recipe = open("scene.recipe"), from_ply = open("scene.ply");
    ASSERT_TRUE(from_recipe && from_ply);
    EXPECT_EQ(from_recipe->recordCount(), 30'001u);
    EXPECT_EQ(from_recipe->channels().normal, from_ply->channels().normal);
    EXPECT_EQ(from_recipe->channels().two_sided, from_ply->channels().two_sided);
    const std::vector<Surfel> expected = readAll(*from_ply);
    EXPECT_EQ(expected.size(), 30'001u);
    EXPECT_TRUE(areEqual(readAll(*from_recipe), expected)) << sceneKindName(kind);
    ASSERT_TRUE(from_recipe->rewind().ok());
    EXPECT_TRUE(areEqual(readAllRows(*from_recipe), expected)) << sceneKindName(kind);
  }
}

TEST_F(RecipeSourceTest, RowsCanBeReadFromAnyRecord) {
  const SceneRecipe recipe = recipeOf(SceneKind::kCity, 5000);
  write("scene.recipe", formatSceneRecipe(recipe));
  const auto source = open("scene.recipe");
  ASSERT_TRUE(source && source->isSeekable());
  ASSERT_TRUE(source->seekRow(4990).ok());
  AlignedBuffer buffer;
  EXPECT_EQ(source->readRows(100, buffer)->size(), 10 * source->rowBytes());
  EXPECT_TRUE(source->readRows(100, buffer)->empty());
  EXPECT_EQ(source->seekRow(5001).code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
