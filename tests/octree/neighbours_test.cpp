// Nearest places from a copy beside those through the octree; fits and cells in lanes beside each
// other and one by one; all instruction sets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <vector>

#include "io/test_directory.h"
#include "octree/neighbours/nearest_kernel.h"
#include "octree/neighbours/place_index.h"
#include "octree/neighbours/surface_cell.h"
#include "octree/neighbours/surface_fits.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

PlaceColumns columnsOf(const std::vector<glm::vec3>& places) {
  PlaceColumns columns;
  for (const glm::vec3& p : places) {
    columns.x.push_back(p.x), columns.y.push_back(p.y), columns.z.push_back(p.z);
  }
  for (std::vector<float>* column : {&columns.x, &columns.y, &columns.z}) {
    column->resize(places.size() + PlaceColumns::kPadding, std::numeric_limits<float>::quiet_NaN());
  }
  return columns;
}

TEST(NearestKernel, FindsAndRanksAsOneByOne) {
  TestRandom random(5);
  for (const std::size_t count : {1, 15, 16, 17, 100}) {
    std::vector<glm::vec3> places;
    for (std::size_t i = 0; i < count; ++i) places.push_back(random.point());
    const PlaceColumns columns = columnsOf(places);
    const glm::vec3 at = random.point();
    for (const float most_sq : {0.f, 0.1f, kInfinity}) {
      std::vector<std::uint32_t> expected;
      for (std::size_t i = 0; i < count; ++i) {
        const glm::vec3 d = places[i] - at;
        if (glm::dot(d, d) <= most_sq) expected.push_back(std::uint32_t(i));
      }
      for (const NearestKernel& kernel : nearestKernels()) {
        std::vector<std::uint32_t> found(count + PlaceColumns::kPadding);
        std::vector<float> squares(count + PlaceColumns::kPadding);
        const std::size_t size =
            kernel.placesWithin(columns, &at.x, most_sq, found.data(), squares.data());
        found.resize(size);
        EXPECT_EQ(found, expected);
        std::vector<std::int32_t> ranks(count + PlaceColumns::kPadding);
        kernel.rank(squares.data(), size, ranks.data());
        for (std::size_t i = 0; i < size; ++i) {
          EXPECT_EQ(ranks[i], std::count_if(squares.begin(), squares.begin() + std::ptrdiff_t(size),
                                            [&](float other) { return other < squares[i]; }));
        }
      }
    }
  }
}

TEST(NearestKernel, FindsBoxes) {
  TestRandom random(6);
  std::vector<glm::vec3> low, high;
  for (int i = 0; i < 37; ++i) {
    low.push_back(random.point());
    high.push_back(low.back() + 0.1f * random.point());
  }
  const BoxColumns boxes{columnsOf(low), columnsOf(high)};
  const glm::vec3 from(0.4f), to(0.5f);
  for (const float most : {0.f, 0.05f, 0.2f, 5.f}) {
    std::vector<std::uint32_t> expected;
    for (std::size_t i = 0; i < low.size(); ++i) {
      const glm::vec3 gap = glm::max(glm::max(low[i] - to, from - high[i]), glm::vec3(0));
      if (glm::dot(gap, gap) <= most * most) expected.push_back(std::uint32_t(i));
    }
    for (const NearestKernel& kernel : nearestKernels()) {
      std::vector<std::uint32_t> found(low.size() + PlaceColumns::kPadding);
      found.resize(kernel.boxesWithin(boxes, &from.x, &to.x, most * most, found.data()));
      EXPECT_EQ(found, expected);
      EXPECT_EQ(kernel.isAnyBoxWithin(boxes, &from.x, &to.x, most * most), !expected.empty());
    }
  }
}

class PlaceIndexTest : public DirectoryTest {
 protected:
  // Compares the nearest of all surfels, from a copy and through the octree.
  void compare(const std::vector<Surfel>& cloud) {
    writeCloud(path("cloud.ply"), cloud);
    IndexOptions options;
    options.full_precision = true;
    Progress quiet;
    ASSERT_TRUE(indexClouds({path("cloud.ply")}, path("scene.sft"), options, quiet).ok());
    auto file = SceneFile::open(path("scene.sft"));
    ASSERT_TRUE(file.ok());
    const auto memory = PagedOctree::planMemory(*file, PagedOctree::unlimitedCacheBytes(*file), 2);
    ASSERT_TRUE(memory.ok());
    const auto octree = PagedOctree::create(std::move(*file), *memory);
    ASSERT_TRUE(octree.ok());
    PagedOctree::Reader reader(**octree), other(**octree);
    const std::vector<Surfel> surfels = surfelsOf(**octree);
    PlaceIndex index;
    for (const std::size_t count : {std::size_t{10}, std::size_t{24}}) {
      std::size_t visited = 0;
      const Status status = index.serve(
          surfels, [](std::size_t i) { return i % 3 != 1; }, count, reader,
          [&](std::span<const std::size_t> group, std::span<NearestPlaces> found) -> Status {
            for (std::size_t i = 0; i < group.size(); ++i) {
              expectSame(surfels[group[i]].position, count, found[i], other);
            }
            NearestPlaces wider;
            const glm::vec3& first = surfels[group[0]].position;
            SURFEIT_RETURN_IF_ERROR(index.find(first, 2 * count, reader, wider));
            expectSame(first, 2 * count, wider, other);
            visited += group.size();
            return {};
          });
      EXPECT_TRUE(status.ok());
      EXPECT_EQ(visited, surfels.size() - (surfels.size() + 1) / 3);
    }
  }

 private:
  static std::vector<Surfel> surfelsOf(PagedOctree& octree) {
    std::vector<Surfel> surfels;
    for (std::uint32_t page = 0; page < octree.file().surfelPageCount(); ++page) {
      SceneFile::Scratch scratch;
      std::vector<Surfel> some(octree.file().header().surfel_group_capacity);
      const Result<std::uint32_t> count = octree.file().decodeSurfels(page, scratch, some);
      EXPECT_TRUE(count.ok());
      surfels.insert(surfels.end(), some.begin(), some.begin() + *count);
    }
    return surfels;
  }
  static void expectSame(const glm::vec3& position, std::size_t count, const NearestPlaces& found,
                         PagedOctree::Reader& reader) {
    NearestPlaces expected;
    ASSERT_TRUE(findPlaces(position, count, reader, expected).ok());
    ASSERT_EQ(found.neighbours.size(), expected.neighbours.size());
    EXPECT_EQ(found.reach, expected.reach);
    EXPECT_EQ(found.coincident, expected.coincident);
    EXPECT_EQ(found.own_normal, expected.own_normal);
    for (std::size_t i = 0; i < found.neighbours.size(); ++i) {
      EXPECT_EQ(found.neighbours[i].offset, expected.neighbours[i].offset);
      EXPECT_EQ(found.neighbours[i].normal, expected.neighbours[i].normal);
      EXPECT_EQ(found.neighbours[i].id, expected.neighbours[i].id);
    }
  }
};

TEST_F(PlaceIndexTest, FindsWhatTheOctreeDoes) { compare(sphereCloud(3000)); }
TEST_F(PlaceIndexTest, FindsWhatTheOctreeDoesAllAround) { compare(randomCloud(2000)); }
// Many are as far away as others
TEST_F(PlaceIndexTest, FindsWhatTheOctreeDoesOnAGrid) { compare(planeCloud(50, 1)); }
TEST_F(PlaceIndexTest, FindsWhatTheOctreeDoesWhereSurfelsRepeat) {
  std::vector<Surfel> cloud = sphereCloud(1000);
  const std::vector<Surfel> once = cloud;
  for (int i = 0; i < 3; ++i) cloud.insert(cloud.end(), once.begin(), once.begin() + 500);
  compare(cloud);
}
TEST_F(PlaceIndexTest, FindsWhatTheOctreeDoesBesideAStray) {
  std::vector<Surfel> cloud = planeCloud(40, 1);
  cloud.push_back(cloud.front());
  cloud.back().position = glm::vec3(1e6f);
  compare(cloud);
}

// Places around the origin on a bent and rough sheet, the nearest first.
std::vector<Neighbour> sheet(std::size_t count, float bend, float noise, TestRandom& random) {
  std::vector<Neighbour> neighbours(count);
  for (Neighbour& n : neighbours) {
    const float u = random.between(-1, 1), v = random.between(-1, 1);
    n.offset = {u, 0.8f * v + 0.6f * bend * u * u, noise * random.between(-1, 1) - 0.6f * v};
  }
  std::sort(neighbours.begin(), neighbours.end(), isBefore);
  return neighbours;
}

struct Lanes {
  std::vector<std::vector<Neighbour>> neighbours;
  std::vector<CellPlace> places;

  explicit Lanes(std::size_t count) {
    TestRandom random(8);
    for (std::size_t i = 0; i < count; ++i) {
      const float noise = i % 3 == 0 ? 0.f : 0.1f * float(i % 3);
      neighbours.push_back(sheet(12 + i % 12, 0.3f * float(i % 4), noise, random));
    }
    for (const std::vector<Neighbour>& some : neighbours) {
      places.push_back({some, glm::length(some.back().offset), glm::vec3(0)});
    }
  }
};

TEST(SurfaceFits, AreTheSameForAllInstructionSets) {
  const Lanes given(SurfaceFitLanes::kLanes);
  const auto fitted = [&](const SurfaceFitKernel& kernel) {
    auto lanes = std::make_unique<SurfaceFitLanes>();
    std::memset(static_cast<void*>(lanes.get()), 0, sizeof(SurfaceFitLanes));
    lanes->most_neighbours = 24;
    lanes->with_quadrics = true;
    for (std::size_t lane = 0; lane < given.places.size(); ++lane) {
      const std::span<const Neighbour> neighbours = given.places[lane].neighbours;
      lanes->count[lane] = float(neighbours.size());
      lanes->unit[lane] = given.places[lane].reach;
      for (std::size_t i = 0; i < neighbours.size(); ++i) {
        lanes->x[i][lane] = neighbours[i].offset.x;
        lanes->y[i][lane] = neighbours[i].offset.y;
        lanes->z[i][lane] = neighbours[i].offset.z;
      }
    }
    kernel.fit(*lanes);
    kernel.measure(*lanes);
    return lanes;
  };
  const auto first = fitted(surfaceFitKernels()[0]);
  for (const SurfaceFitKernel& kernel : surfaceFitKernels()) {
    const auto other = fitted(kernel);
    EXPECT_EQ(std::memcmp(first.get(), other.get(), sizeof(SurfaceFitLanes)), 0);
  }
}

TEST(SurfaceFits, DoNotDependOnTheOtherLanes) {
  const Lanes given(SurfaceFitLanes::kLanes);
  SurfaceCells all, one;
  all.fit(given.places, true);
  all.measure();
  for (std::size_t lane = 0; lane < given.places.size(); ++lane) {
    one.fit({&given.places[lane], 1}, true);
    one.measure();
    EXPECT_EQ(all.planeOf(lane).normal, one.planeOf(0).normal);
    EXPECT_EQ(all.planeOf(lane).thickness, one.planeOf(0).thickness);
    EXPECT_EQ(all.cellOf(lane).area, one.cellOf(0).area);
    EXPECT_EQ(all.cellOf(lane).radius, one.cellOf(0).radius);
  }
}

TEST(SurfaceFits, FollowABentSheet) {
  TestRandom random(9);
  std::vector<Neighbour> neighbours(24);
  for (Neighbour& n : neighbours) {
    // On one side alone, where the surface goes up as it bends
    const float u = random.between(0, 1), v = random.between(-1, 1);
    n.offset = {u, v, 0.2f * u * u - 0.1f * u * v};
  }
  std::sort(neighbours.begin(), neighbours.end(), isBefore);
  const CellPlace place{neighbours, glm::length(neighbours.back().offset), glm::vec3(0)};
  SurfaceCells cells;
  cells.fit({&place, 1}, true);
  EXPECT_GT(std::abs(cells.planeOf(0).normal.z), 0.9999f);
  cells.fit({&place, 1}, false);
  EXPECT_LT(std::abs(cells.planeOf(0).normal.z), 0.999f);
}

TEST(SurfaceCells, MeasuredTogetherAreThoseCutOneByOne) {
  const Lanes given(SurfaceFitLanes::kLanes);
  SurfaceCells together, alone;
  together.fit(given.places, false);
  together.measure();
  alone.fit(given.places, false);
  std::size_t settled = 0, long_cells = 0;
  for (std::size_t lane = 0; lane < given.places.size(); ++lane) {
    const SurfaceCell expected = alone.cellOf(lane), found = together.cellOf(lane);
    settled += expected.is_settled ? 1 : 0;
    EXPECT_EQ(found.is_settled, expected.is_settled);
    EXPECT_NEAR(found.area, expected.area, 1e-5f * expected.area);
    EXPECT_NEAR(found.radius, expected.radius, 1e-5f * expected.radius);
    EXPECT_LT(glm::length(found.middle - expected.middle), 1e-4f * expected.radius);
    // Either way round
    const glm::vec3 a = found.long_side, b = expected.long_side;
    EXPECT_LT(std::min(glm::length(a - b), glm::length(a + b)), 1e-3f * expected.radius);
    long_cells += glm::length(b) > 0 ? 1 : 0;
  }
  EXPECT_GT(long_cells, 0u);
  EXPECT_GT(settled, given.places.size() / 4);
}

// Neighbours on a lattice of rows: the place's cell is a rectangle.
std::vector<Neighbour> latticeAround(const glm::vec3& along, const glm::vec3& across) {
  std::vector<Neighbour> neighbours;
  for (int i = -9; i <= 9; ++i) {
    for (int j = -2; j <= 2; ++j) {
      if (i != 0 || j != 0) neighbours.push_back({float(i) * along + float(j) * across, {}, 0});
    }
  }
  std::sort(neighbours.begin(), neighbours.end(), isBefore);
  return neighbours;
}

TEST(SurfaceCells, OfRowsAreRectangles) {
  const glm::vec3 along = glm::normalize(glm::vec3(1, 2, 0)), across(-along.y, along.x, 0);
  const auto sideOf = [](std::vector<Neighbour> neighbours, bool together) {
    const CellPlace place{neighbours, glm::length(neighbours.back().offset), glm::vec3(0)};
    SurfaceCells cells;
    cells.fit({&place, 1}, false);
    if (together) cells.measure();
    return cells.cellOf(0).long_side;
  };
  for (const bool together : {false, true}) {
    for (const float rows : {2.6f, 4.f, 9.f}) {
      const glm::vec3 side = sideOf(latticeAround(along, rows * across), together);
      EXPECT_NEAR(std::abs(glm::dot(side, across)), rows, 1e-3f * rows);
      EXPECT_NEAR(glm::dot(side, along), 0, 1e-3f * rows);
    }
    EXPECT_EQ(sideOf(latticeAround(along, 1.5f * across), together), glm::vec3(0));
    // Places that share a cell
    std::vector<Neighbour> shared = latticeAround(along, 4.f * across);
    shared.insert(shared.begin(), {1e-6f * along, {}, 0});
    EXPECT_EQ(sideOf(shared, together), glm::vec3(0));
  }
}

// A pair: its cells are halves of one, beside their places.
TEST(SurfaceCells, HaveAMiddleBesideTheirPlace) {
  const glm::vec3 along = glm::normalize(glm::vec3(1, 2, 0)), across(-along.y, along.x, 0);
  for (const bool together : {false, true}) {
    for (const float apart : {0.02f, 0.5f}) {
      std::vector<Neighbour> pair = latticeAround(along, across);
      pair.push_back({apart * along, {}, 0});
      std::sort(pair.begin(), pair.end(), isBefore);
      const CellPlace place{pair, glm::length(pair.back().offset), glm::vec3(0)};
      SurfaceCells cells;
      cells.fit({&place, 1}, false);
      if (together) cells.measure();
      const SurfaceCell cell = cells.cellOf(0);
      // From -1/2 to the line half-way to the other one
      const float width = 0.5f + 0.5f * apart, to_middle = 0.25f - 0.25f * apart;
      EXPECT_NEAR(cell.area, width, 1e-4f);
      EXPECT_LT(glm::length(cell.middle + to_middle * along), 1e-4f) << apart;
      const float moment = (width * width + 1) / 12 + to_middle * to_middle;
      EXPECT_NEAR(cell.radius, std::sqrt(2 * moment), 1e-4f);
    }
  }
}

// A place with two others of its sheet, `height` over a denser one that faces as it does.
std::vector<Neighbour> aboveDenserSheet(float height, TestRandom& random) {
  std::vector<Neighbour> neighbours = {{{1, .2f, 0}, {0, 0, 1}, 1},
                                       {{-.3f, 1.1f, 0}, {0, 0, 1}, 2}};
  for (std::uint64_t i = 0; i < 40; ++i) {
    const glm::vec3 place(random.between(-1, 1), random.between(-1, 1), -height);
    neighbours.push_back({place, {0, 0, 1}, 3 + i});
  }
  std::sort(neighbours.begin(), neighbours.end(), isBefore);
  return neighbours;
}

TEST(SurfaceCells, BoundsAreVisitedThatHoldWhatWouldCut) {
  TestRandom random(12);
  std::size_t wanted = 0, left_out = 0;
  for (const float height : {0.f, .4f, .6f}) {
    const std::vector<Neighbour> neighbours = aboveDenserSheet(height, random);
    const CellPlace place = {neighbours, 1.5f, {0, 0, 1}};
    SurfaceCells cells;
    cells.fit({&place, 1}, false);
    cells.cellOf(0);
    for (int i = 0; i < 20000; ++i) {
      Neighbour other;
      const float away = random.between(0, 5);
      other.offset = away * glm::normalize(random.direction() * glm::vec3(1, 1, .5f));
      other.normal =
          glm::normalize(glm::vec3(0, 0, 1) + random.between(0, 1.2f) * random.direction());
      PlaceBounds bounds;
      bounds.radius = random.between(0, 1) * random.between(0, 2);
      bounds.centre = other.offset + bounds.radius * random.unit() * random.direction();
      bounds.normal = glm::normalize(other.normal + random.between(0, 1) * random.direction());
      bounds.normal_cosine = glm::dot(bounds.normal, other.normal);
      const bool may_cut = cells.mayCut(bounds);
      left_out += may_cut ? 0 : 1;
      if (!cells.wouldCut(other)) continue;
      ++wanted;
      EXPECT_TRUE(may_cut) << "height " << height << ", try " << i;
    }
  }
  EXPECT_GT(wanted, 1000u);
  EXPECT_GT(left_out, 10000u);
}

// What lies past half the way to the other sheet is not the place's own, however far beside it.
TEST(SurfaceCells, BoundsBeyondHalfTheGapAreLeftOut) {
  TestRandom random(13);
  const std::vector<Neighbour> neighbours = aboveDenserSheet(.6f, random);
  const CellPlace place = {neighbours, 1.5f, {0, 0, 1}};
  SurfaceCells cells;
  cells.fit({&place, 1}, false);
  cells.cellOf(0);
  EXPECT_TRUE(cells.mayCut({{2, -2, -.2f}, .05f, {0, 0, 1}, 1}));
  EXPECT_FALSE(cells.mayCut({{2, -2, -.4f}, .05f, {0, 0, 1}, 1}));
  EXPECT_TRUE(cells.mayCut({{2, -2, -.4f}, .15f, {0, 0, 1}, 1}));
}

// Two scans of one surface, or a place that comes twice: one has the side, not both
TEST(SurfaceCells, NeighboursAtOnePlaceCutOnce) {
  std::vector<Neighbour> neighbours;
  for (int i = 0; i < 12; ++i) {
    const float angle = float(i % 6) * 1.0471976f;
    neighbours.push_back({{std::cos(angle), std::sin(angle), 0}, glm::vec3(0), 0});
  }
  neighbours.push_back({{8, 0, 0}, glm::vec3(0), 0});
  const CellPlace place{neighbours, 8, glm::vec3(0)};
  SurfaceCells cells;
  cells.fit({&place, 1}, false);
  cells.measure();
  const SurfaceCell cell = cells.cellOf(0);
  EXPECT_TRUE(cell.is_settled);
  EXPECT_NEAR(cell.area, std::sqrt(3.f) / 2, 1e-4f);
}

}  // namespace
}  // namespace surfeit
