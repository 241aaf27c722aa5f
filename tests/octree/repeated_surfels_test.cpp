// Clouds that overlap: surfels that repeat others are told, or left out.
#include "octree/neighbours/repeated_surfels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// Sorted surfels in batches of a size.
class PiecewiseStream : public SortedSurfelStream {
 public:
  PiecewiseStream(std::vector<Surfel> surfels, std::size_t batch) : batch_(batch) {
    for (const Surfel& surfel : surfels) {
      tickets_.push_back({curveKey(surfel.position, RootCube{}), tickets_.size()});
    }
    std::vector<Ticket> scratch(tickets_.size());
    sortAlongCurve(tickets_, scratch, surfels);
    surfels_ = std::move(surfels);
  }

  Result<std::shared_ptr<const SortedBatch>> next() override {
    const std::size_t count = std::min(batch_, tickets_.size() - at_);
    if (count == 0) return std::shared_ptr<const SortedBatch>();
    const auto batch = std::make_shared<SortedBatch>();
    batch->resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      // Backwards: tickets tell the order
      const Ticket& ticket = tickets_[at_ + i];
      batch->surfels[count - 1 - i] = surfels_[ticket.index];
      batch->tickets[i] = {ticket.key, count - 1 - i};
    }
    at_ += count;
    return std::shared_ptr<const SortedBatch>(batch);
  }

 private:
  std::size_t batch_, at_ = 0;
  std::vector<Ticket> tickets_;
  std::vector<Surfel> surfels_;
};

// The x coordinates and areas of what passes.
std::vector<std::pair<float, float>> passed(const std::vector<Surfel>& surfels, std::size_t batch,
                                            Repeats repeats, std::uint64_t* repeated = nullptr) {
  PiecewiseStream stream(surfels, batch);
  RepeatFilter filter(stream, repeats);
  std::vector<std::pair<float, float>> found;
  for (;;) {
    const auto got = filter.next();
    EXPECT_TRUE(got.ok());
    if (!got.ok() || *got == nullptr) break;
    EXPECT_FALSE((*got)->tickets.empty());
    for (const Ticket& ticket : (*got)->tickets) {
      const Surfel& surfel = (*got)->surfels[ticket.index];
      EXPECT_EQ(ticket.key, curveKey(surfel.position, RootCube{}));
      found.emplace_back(surfel.position.x, surfel.area);
    }
  }
  if (repeated != nullptr) *repeated = filter.repeated();
  return found;
}

Surfel diskAt(const glm::vec3& position, const glm::vec3& normal = {0, 0, 1}) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.radius = surfel.area = 1;
  return surfel;
}

TEST(RepeatFilter, BatchesDoNotShow) {
  TestRandom random(5);
  std::vector<Surfel> surfels;
  for (int i = 0; i < 300; ++i) {
    // Some places often, others once; some places of one key
    Surfel surfel = diskAt(random.point());
    const std::uint32_t copies = i % 10 == 0 ? 40 : 1 + random.bits() % 3;
    for (std::uint32_t copy = 0; copy < copies; ++copy) {
      surfel.radiosity.x = random.unit();
      surfels.push_back(surfel);
    }
    if (i % 3 == 0) surfels.push_back(diskAt(surfel.position + glm::vec3(1e-8f, 0, 0)));
  }
  std::vector<glm::vec3> places;
  for (const Surfel& surfel : surfels) {
    if (std::find(places.begin(), places.end(), surfel.position) == places.end()) {
      places.push_back(surfel.position);
    }
  }
  const auto expected = passed(surfels, surfels.size(), Repeats::kThin);
  EXPECT_EQ(expected.size(), places.size());
  for (const std::size_t batch : {1, 2, 3, 7, 39, 100}) {
    std::uint64_t repeated = 0;
    EXPECT_EQ(passed(surfels, batch, Repeats::kThin, &repeated), expected) << batch;
    EXPECT_EQ(repeated, surfels.size() - expected.size());
    EXPECT_EQ(passed(surfels, batch, Repeats::kKeep, &repeated).size(), surfels.size());
    EXPECT_EQ(repeated, surfels.size() - expected.size());
  }
}

TEST(RepeatFilter, PiecesOfOnePlaceStay) {
  const glm::vec3 place(0.5f);
  std::vector<Surfel> surfels = {diskAt(place), diskAt(place, {0, 0, -1}), diskAt(place, {1, 0, 0}),
                                 diskAt(place, {0.6f, 0, 0.8f}), diskAt(place)};
  surfels.back().group = 3;
  std::uint64_t repeated = 0;
  EXPECT_EQ(passed(surfels, 2, Repeats::kThin, &repeated).size(), 4u);
  EXPECT_EQ(repeated, 1u);
  // Spheres are pieces of their own, and one is enough
  Surfel sphere = diskAt(place, {0, 0, 0});
  sphere.flags = kSurfelSphere;
  surfels.insert(surfels.end(), 5, sphere);
  EXPECT_EQ(passed(surfels, 2, Repeats::kThin).size(), 5u);
}

TEST(RepeatFilter, EitherNormalOfTheTwoSidedWillDo) {
  Surfel a = diskAt({}, {0, 0, 1}), b = diskAt({}, {0, 0.6f, -0.8f});
  EXPECT_FALSE(isSamePiece(a, b));
  a.flags = kSurfelTwoSided;
  EXPECT_FALSE(isSamePiece(a, b));
  b.flags = kSurfelTwoSided;
  EXPECT_TRUE(isSamePiece(a, b));
}

class RepeatedSurfelsTest : public SceneTest {
 protected:
  static IndexOptions options(Repeats repeats) {
    IndexOptions options;
    options.repeats = repeats;
    options.full_precision = true;
    options.threads = 1;
    return options;
  }

  static double areaOf(const ReadScene& scene) {
    double sum = 0;
    for (const Surfel& surfel : scene.surfels) sum += double(surfel.area);
    return sum;
  }

  // A plane of 60 x 60 in two tiles, which share ten columns.
  void writeTiles(const CloudChannels& channels = kAllChannels) {
    plane_ = planeCloud(60, 1);
    std::vector<Surfel> left, right;
    for (const Surfel& surfel : plane_) {
      if (surfel.position.x < 35) left.push_back(surfel);
      if (surfel.position.x >= 25) right.push_back(surfel);
    }
    writeCloud(path("left.ply"), left, channels);
    writeCloud(path("right.ply"), right, channels);
    writeCloud(path("whole.ply"), plane_, channels);
  }

  IndexStats indexTiles(const std::string& output, const IndexOptions& options,
                        std::vector<std::string> names = {"left.ply", "right.ply"}) {
    progress_.notes.clear();
    for (std::string& name : names) name = path(name);
    return indexFiles(names, path(output), options);
  }

  double areaOfFile(const std::string& name) const {
    const Result<ReadScene> scene = readScene(path(name));
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_THAT(findingsOf(path(name)), IsEmpty());
    return scene.ok() ? areaOf(*scene) : 0;
  }

  std::vector<Surfel> plane_;
};

TEST_F(RepeatedSurfelsTest, ThinTilesAreTheWholeCloud) {
  writeTiles();
  indexTiles("whole.sft", options(Repeats::kThin), {"whole.ply"});
  const double area = areaOfFile("whole.sft");
  const IndexStats thin = indexTiles("thin.sft", options(Repeats::kThin));
  EXPECT_EQ(thin.surfels, 3600u);
  EXPECT_EQ(thin.repeated_surfels, 600u);
  EXPECT_THAT(progress_.notes, IsEmpty());
  EXPECT_EQ(areaOfFile("thin.sft"), area);
  // The order of the inputs does not show
  indexTiles("turned.sft", options(Repeats::kThin), {"right.ply", "left.ply"});
  EXPECT_EQ(contents("thin.sft"), contents("turned.sft"));

  const IndexStats kept = indexTiles("kept.sft", options(Repeats::kKeep));
  EXPECT_EQ(kept.surfels, 4200u);
  EXPECT_EQ(kept.repeated_surfels, 600u);
  EXPECT_THAT(progress_.notes, ElementsAre(HasSubstr("600 surfels repeat another at its place")));
  EXPECT_THAT(progress_.notes[0], HasSubstr("--overlap thin"));
  EXPECT_NEAR(areaOfFile("kept.sft"), area * 4200 / 3600, 1e-6 * area);
}

// Which surfel of a place stays follows from what the surfels are.
TEST_F(RepeatedSurfelsTest, UnequalRepeatsDoNotDependOnTheOrder) {
  writeTiles();
  std::vector<Surfel> other = plane_;
  for (Surfel& surfel : other) {
    surfel.radiosity = {0.5f, 0, 0};
    if (surfel.position.x == 0) surfel.position.x = -0.f;
  }
  writeCloud(path("other.ply"), other);
  const IndexStats stats =
      indexTiles("one.sft", options(Repeats::kThin), {"whole.ply", "other.ply", "left.ply"});
  EXPECT_EQ(stats.surfels, 3600u);
  indexTiles("two.sft", options(Repeats::kThin), {"left.ply", "other.ply", "whole.ply"});
  EXPECT_EQ(contents("one.sft"), contents("two.sft"));
}

// Areas from neighbours are shared at a place: nothing counts twice.
TEST_F(RepeatedSurfelsTest, SizesFromNeighboursAreNotToldButThinned) {
  writeTiles(kPositionsOnly);
  EXPECT_EQ(indexTiles("kept.sft", options(Repeats::kKeep)).repeated_surfels, 0u);
  EXPECT_THAT(progress_.notes, Not(Contains(HasSubstr("repeat"))));
  indexTiles("whole.sft", options(Repeats::kKeep), {"whole.ply"});
  const IndexStats thin = indexTiles("thin.sft", options(Repeats::kThin));
  EXPECT_EQ(thin.repeated_surfels, 600u);
  const double area = areaOfFile("whole.sft");
  EXPECT_NEAR(areaOfFile("thin.sft"), area, 1e-6 * area);
  EXPECT_NEAR(areaOfFile("kept.sft"), area, 0.01 * area);
}

// More of one place, and of one key, than are sorted at once.
TEST_F(RepeatedSurfelsTest, CrowdsThatCrossBucketsAreThinned) {
  std::vector<Surfel> cloud = randomCloud(20000);
  TestRandom random(11);
  for (int i = 0; i < 300000; ++i) {
    Surfel surfel = cloud[i % 2 == 0 ? 5 : 6];
    if (i % 4 == 0) surfel.radiosity.x = random.unit();
    cloud.push_back(surfel);
  }
  writeCloud(path("cloud.ply"), cloud);
  IndexOptions small = options(Repeats::kThin);
  small.memory_bytes = std::uint64_t{64} << 20;
  const IndexStats stats = indexTiles("small.sft", small, {"cloud.ply"});
  EXPECT_EQ(stats.surfels, 20000u);
  EXPECT_EQ(stats.repeated_surfels, 300000u);
  indexTiles("large.sft", options(Repeats::kThin), {"cloud.ply"});
  EXPECT_EQ(contents("small.sft"), contents("large.sft"));
}

}  // namespace
}  // namespace surfeit
