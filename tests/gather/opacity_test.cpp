// What is translucent covers its opacity, sends as much of its light, and shows the rest of what
// lies behind: against the product of what panes let through, and against Beer and Lambert.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "gather/test_clouds.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/progress.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

Table emptyTranslucent() {
  Table table;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius", "area", "opacity",
                           "radiosity_r", "radiosity_g", "radiosity_b"}) {
    table.addProperty(name);
  }
  return table;
}

// A pane of side 100 at height z, that faces down, of side * side surfels.
void addPane(double z, double opacity, double light, int side, Table& table) {
  const double step = 100.0 / side;
  for (int i = 0; i < side * side; ++i) {
    const double x = (i % side + 0.5) * step - 50, y = (i / side + 0.5) * step - 50;
    table.rows.push_back(
        {x, y, z, 0, 0, -1, step * std::sqrt(0.5), step * step, opacity, light, light / 2, 0});
  }
}

constexpr std::size_t kOpacity = 8;  // its column

// Of side 20, of surfels a tenth as far apart.
void addFinePane(double z, double opacity, double light, Table& table) {
  Table pane = emptyTranslucent();
  addPane(5 * z, opacity, light, 200, pane);
  for (std::vector<double>& row : pane.rows) {
    for (const std::size_t length : {0, 1, 2, 6}) row[length] /= 5;
    row[7] /= 25;
    table.rows.push_back(row);
  }
}

// The shares of cosine-weighted directions from the ground that meet two fine panes at these
// heights. What meets the second meets the first as well, where that is lower.
struct SeenPanes {
  double first = 0, second = 0;
};
SeenPanes seenFinePanes(double first, double second) {
  // From the middle of a square of side 2 a at height h: (4 / pi) x / sqrt(1 + x^2) atan(x / sqrt(1
  // + x^2)) with x = a / h
  const auto seen = [](double height) {
    const double x = 10 / height, root = std::sqrt(1 + x * x);
    return 4 / 3.14159265 * x / root * std::atan(x / root);
  };
  return {seen(first), seen(second)};
}

class Opacity : public testing::Test {
 protected:
  struct Means {
    double occlusion = 0, red = 0, green = 0;
  };
  Means gather(const Table& cloud, const GatherOptions& options) {
    makeScene(cloud, directory_.file("scene.sft"));
    writeTable(receivers_, directory_.file("receivers.ply"));
    const auto stats = gatherCloud(directory_.file("scene.sft"), directory_.file("receivers.ply"),
                                   directory_.file("result.ply"), options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const Table result = readTable(directory_.file("result.ply"));
    const auto mean = [&](const char* name) {
      double sum = 0;
      for (const double value : result.column(name)) sum += value;
      return sum / double(result.rows.size());
    };
    return {mean("occlusion"), mean("irradiance_r"), mean("irradiance_g")};
  }
  static GatherOptions bleeding(float max_solid_angle = 0.1f) {
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.threads = 1;
    options.quality.max_solid_angle = max_solid_angle;
    return options;
  }
  // On the ground below the middle of panes, facing up.
  static Table ground(int count) {
    Table table;
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) table.addProperty(name);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(-1, 1);
    for (int i = 0; i < count; ++i) {
      table.rows.push_back({place(random), place(random), 0, 0, 0, 1});
    }
    return table;
  }

  TestDirectory directory_;
  Progress progress_;
  Table receivers_ = ground(24);
};

// Of the hemisphere a pane of side 100 at height 1 covers all but a thousandth.
TEST_F(Opacity, APaneCoversItsOpacityHoweverItIsDrawn) {
  for (const double opacity : {0.05, 0.3, 0.7, 0.95}) {
    for (const double height : {1.0, 3.0}) {
      for (const float max_solid_angle : {0.f, 0.1f}) {
        Table cloud = emptyTranslucent();
        addPane(height, opacity, 2, 200, cloud);
        const double whole = height == 1 ? 1 : .9962;
        const Means found = gather(cloud, bleeding(max_solid_angle));
        const double error = .004;
        EXPECT_NEAR(found.occlusion, opacity * whole, error * opacity)
            << opacity << " at " << height << ", " << max_solid_angle << " sr";
        EXPECT_NEAR(found.red, 2 * opacity * whole, 2 * error * opacity);
        EXPECT_NEAR(found.green, opacity * whole, error * opacity);
      }
    }
  }
}

TEST_F(Opacity, PanesBehindEachOtherMultiply) {
  Table cloud = emptyTranslucent();
  addPane(1, .3, 1, 200, cloud);
  addPane(2.5, .5, 2, 200, cloud);
  // Towards the horizon nodes hold both, and know the mean of their opacities
  for (const bool has_nodes : {false, true}) {
    const Means found = gather(cloud, bleeding(has_nodes ? .1f : 0));
    EXPECT_NEAR(found.occlusion, 1 - .7 * .5, has_nodes ? .015 : .005);
    EXPECT_NEAR(found.red, .3 * 1 + .7 * .5 * 2, has_nodes ? .03 : .015);
  }
}

// As far apart as large nodes are wide, or half as far.
TEST_F(Opacity, PanesInNodesThatAreOpenedMultiply) {
  for (const double second : {4., 4.5, 5.}) {
    const SeenPanes seen = seenFinePanes(3, second);
    Table cloud = emptyTranslucent();
    addFinePane(3, .3, 1, cloud);
    addFinePane(second, .6, 1, cloud);
    for (const float max_solid_angle : {0.f, 0.03f, 0.1f}) {
      const Means found = gather(cloud, bleeding(max_solid_angle));
      const double covered = seen.first * .3 + seen.second * .7 * .6;
      EXPECT_NEAR(found.occlusion, covered, .025) << second << ' ' << max_solid_angle;
      EXPECT_NEAR(found.red, covered, .025) << second << ' ' << max_solid_angle;
    }
  }
}

// Nodes hold both panes, for these are closer to each other than nodes are wide: as two facets if
// they differ, and as two layers of one if not, which sends the mean of their light.
TEST_F(Opacity, PanesInOneNodeMultiply) {
  struct Pair {
    double first, second;
  };
  const SeenPanes seen = seenFinePanes(3, 3.4);
  for (const Pair& pair : {Pair{.5, .1}, {.1, .5}, {.3, .6}, {.4, .4}}) {
    Table cloud = emptyTranslucent();
    addFinePane(3, pair.first, 1, cloud);
    addFinePane(3.4, pair.second, 2, cloud);
    const double behind = seen.second * (1 - pair.first) * pair.second;
    const double covered = seen.first * pair.first + behind;
    const double light = seen.first * pair.first + behind * 2;
    for (const float max_solid_angle : {0.f, 0.03f, 0.1f}) {
      const Means found = gather(cloud, bleeding(max_solid_angle));
      EXPECT_NEAR(found.occlusion, covered, .011) << pair.first << ' ' << max_solid_angle;
      const bool is_one_facet = max_solid_angle > 0 && pair.first == pair.second;
      EXPECT_NEAR(found.red, light, is_one_facet ? .07 : .015) << pair.first << max_solid_angle;
    }
  }
}

// Side by side they add up: a pane whose surfels are of one opacity or another by chance.
TEST_F(Opacity, APaneOfMixedOpacitiesCoversTheirMean) {
  const double seen = seenFinePanes(3, 4).first;
  for (const bool has_two : {false, true}) {
    Table cloud = emptyTranslucent();
    addFinePane(3, .5, 1, cloud);
    std::mt19937 random(3);
    double mean = 0;
    for (std::vector<double>& row : cloud.rows) {
      const double any = double(random() % 1000) / 1000;
      row[kOpacity] = has_two ? (any < .5 ? .05 : .9) : .05 + .85 * any;
      mean += row[kOpacity] / double(cloud.rows.size());
    }
    for (const float max_solid_angle : {0.f, 0.1f}) {
      const Means found = gather(cloud, bleeding(max_solid_angle));
      EXPECT_NEAR(found.occlusion, mean * seen, .03) << max_solid_angle;
      EXPECT_NEAR(found.red, mean * seen, .03) << max_solid_angle;
    }
  }
}

TEST_F(Opacity, AWallShowsThroughAPane) {
  // Close enough for one node to hold both, too
  for (const double between : {1., .5, .25}) {
    Table cloud = emptyTranslucent();
    addPane(1.1, .3, 0, 200, cloud);
    addPane(1.1 + between, 1, 2, 200, cloud);
    const Means found = gather(cloud, bleeding());
    EXPECT_GT(found.occlusion, .985) << between;
    EXPECT_NEAR(found.red, .7 * 2, .025) << between;
  }
}

// Less than a hundredth shines through.
TEST_F(Opacity, AWallHidesWhatIsBehindIt) {
  Table cloud = emptyTranslucent();
  addPane(1, 1, 1, 200, cloud);
  addPane(2, .5, 20, 200, cloud);
  const Means found = gather(cloud, bleeding());
  EXPECT_NEAR(found.red, 1, .01 * (.5 * 20));
}

// Panes anywhere, of any size, turned any way, against rays that meet them.
TEST_F(Opacity, RandomPanesLetThroughWhatRaysSay) {
  struct Pane {
    glm::dvec3 middle, u, v;
    double opacity;
  };
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(0, 1), both(-1, 1);
  const auto direction = [&] {
    glm::dvec3 d;
    do d = {both(random), both(random), both(random)};
    while (glm::length(d) > 1 || glm::length(d) < .1);
    return glm::normalize(d);
  };
  double worst = 0;
  for (int scene = 0; scene < 12; ++scene) {
    const double scale = std::pow(10., 4 * both(random));
    const glm::dvec3 origin = 1000 * scale * direction();
    std::vector<Pane> panes;
    Table cloud = emptyTranslucent();
    for (int k = 0; k < 3; ++k) {
      const glm::dvec3 n = direction(), u = glm::normalize(glm::cross(n, direction()));
      const double half = scale * (1 + 2 * unit(random));
      panes.push_back({scale * (3. + k) * direction(), half * u, half * glm::cross(n, u),
                       .1 + .6 * unit(random)});
      constexpr int kSide = 60;
      const double step = 2 * half / kSide;
      for (int i = 0; i < kSide * kSide; ++i) {
        const glm::dvec3 p = panes[k].middle + ((i % kSide + .5) / kSide * 2 - 1) * panes[k].u +
                             ((i / kSide + .5) / kSide * 2 - 1) * panes[k].v + origin;
        const glm::dvec3 facing = glm::dot(n, panes[k].middle) < 0 ? n : -n;
        cloud.rows.push_back({p.x, p.y, p.z, facing.x, facing.y, facing.z, step * std::sqrt(.5),
                              step * step, panes[k].opacity, 1, 1, 1});
      }
    }
    receivers_.rows = {{origin.x, origin.y, origin.z, 0, 0, 0}};
    double truth = 0;
    constexpr int kRays = 100000;
    for (int i = 0; i < kRays; ++i) {
      const glm::dvec3 ray = direction();
      double open = 1;
      for (const Pane& pane : panes) {
        const glm::dvec3 n = glm::cross(pane.u, pane.v);
        const double t = glm::dot(pane.middle, n) / glm::dot(ray, n);
        const glm::dvec3 hit = t * ray - pane.middle;
        const double u = glm::dot(hit, pane.u) / glm::dot(pane.u, pane.u);
        const double v = glm::dot(hit, pane.v) / glm::dot(pane.v, pane.v);
        if (t > 0 && std::abs(u) < 1 && std::abs(v) < 1) open *= 1 - pane.opacity;
      }
      truth += (1 - open) / kRays;
    }
    const Means found = gather(cloud, bleeding());
    worst = std::max(worst, std::abs(found.occlusion - truth));
    EXPECT_NEAR(found.occlusion, truth, .02) << "scene " << scene << ", scale " << scale;
  }
  std::printf("worst of 12 scenes: %.4f\n", worst);
}

// The share of cosine-weighted directions that a ball of this density stops, by chords.
double smokeOcclusion(const glm::dvec3& centre, double radius, double density) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  double sum = 0;
  constexpr int kRays = 400000;
  for (int i = 0; i < kRays; ++i) {
    const double u = unit(random), phi = 6.283185307 * unit(random), s = std::sqrt(u);
    const glm::dvec3 ray(s * std::cos(phi), s * std::sin(phi), std::sqrt(1 - u));
    const double along = glm::dot(ray, centre);
    const double beside_sq = glm::dot(centre, centre) - along * along;
    if (along <= 0 || beside_sq >= radius * radius) continue;
    sum += 1 - std::exp(-density * 2 * std::sqrt(radius * radius - beside_sq));
  }
  return sum / kRays;
}

TEST_F(Opacity, SmokeFollowsBeerAndLambert) {
  constexpr int kDrops = 40000;
  constexpr double kRadius = 5, kDrop = .2, kDensity = .2;  // optical depth 2 through the middle
  const double volume = 4 / 3. * 3.14159265 * kRadius * kRadius * kRadius;
  const double drop_area = 3.14159265 * kDrop * kDrop;
  const double opacity = kDensity * volume / (kDrops * drop_area);
  Table cloud = emptyTranslucent();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-kRadius, kRadius);
  while (cloud.rows.size() < kDrops) {
    const glm::dvec3 p(place(random), place(random), place(random));
    if (glm::length(p) > kRadius) continue;
    cloud.rows.push_back({p.x, p.y, p.z + 12, 0, 0, 0, kDrop, drop_area, opacity, 1, 1, 1});
  }
  receivers_.rows = {{0, 0, 0, 0, 0, 1}};
  const double truth = smokeOcclusion({0, 0, 12}, kRadius, kDensity);
  for (const float max_solid_angle : {0.f, 0.02f, 0.1f}) {
    const Means found = gather(cloud, bleeding(max_solid_angle));
    EXPECT_NEAR(found.occlusion / truth, 1, .03) << max_solid_angle;
    EXPECT_NEAR(found.red / truth, 1, .03) << max_solid_angle;
  }
}

// As one without the channel, which is of an older version.
TEST_F(Opacity, WhollyOpaqueIsAsWithoutOpacity) {
  Table with = emptyTranslucent(), without;
  addPane(1, 1, 2, 60, with);
  addPane(3, 1, 1, 40, with);
  for (std::size_t i = 0; i < with.properties.size(); ++i) {
    if (with.properties[i].name != "opacity") without.addProperty(with.properties[i].name);
  }
  for (std::vector<double> row : with.rows) {
    row.erase(row.begin() + 8);
    without.rows.push_back(row);
  }
  gather(with, bleeding());
  const std::string bytes = readBytes(directory_.file("result.ply"));
  gather(without, bleeding());
  EXPECT_EQ(readBytes(directory_.file("result.ply")), bytes);
}

TEST_F(Opacity, BouncesKeepIt) {
  Table cloud = emptyTranslucent();
  for (const char* name : {"albedo_r", "albedo_g", "albedo_b"}) cloud.addProperty(name);
  addPane(1, .3, 1, 100, cloud);
  addPane(2, 1, 2, 100, cloud);
  for (auto& row : cloud.rows) row.insert(row.end(), 3, .5);
  makeScene(cloud, directory_.file("in.sft"));
  BounceOptions options;
  options.threads = 1;
  const auto stats =
      bounceScene(directory_.file("in.sft"), directory_.file("out.sft"), options, progress_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  const auto report = verifyScene(directory_.file("out.sft"), 1, progress_);
  ASSERT_TRUE(report.ok()) << report.status().message();
  EXPECT_TRUE(report->findings.empty());
}

// With the way out, which works.
TEST_F(Opacity, WhatIsNotUsedIsTold) {
  class ToldNotes : public Progress {
   public:
    void note(const std::string& message) override { text += message; }
    std::string text;
  };
  Table tints = emptyTranslucent(), covered = emptyTranslucent();
  addPane(1, .3, 1, 10, tints);
  addPane(1, .3, 1, 10, covered);
  for (const char* name : {"opacity_r", "opacity_g", "opacity_b"}) tints.addProperty(name);
  for (auto& row : tints.rows) row.insert(row.end(), {.2, .4, .6});
  covered.properties[7].name = "coverage";  // in place of the area
  for (auto& row : covered.rows) row[7] = .5;
  const std::string path = directory_.file("cloud.ply"), scene = directory_.file("scene.sft");
  for (const auto& [cloud, told, way_out] :
       {std::tuple(tints, "opacity is not used beside opacity_r opacity_g opacity_b", "opacity=-"),
        std::tuple(covered, "opacity is not used beside coverage", "coverage=-")}) {
    writeTable(cloud, path);
    ToldNotes notes, silence;
    ASSERT_TRUE(indexClouds({path}, scene, IndexOptions{}, notes).ok());
    EXPECT_NE(notes.text.find(told), std::string::npos) << notes.text;
    EXPECT_NE(notes.text.find(way_out), std::string::npos) << notes.text;
    IndexOptions options;
    options.channels = way_out;
    ASSERT_TRUE(indexClouds({path}, scene, options, silence).ok());
    EXPECT_EQ(silence.text.find(told), std::string::npos) << silence.text;
  }
}

TEST_F(Opacity, WhatIsNoOpacityIsInvalid) {
  Table cloud = emptyTranslucent();
  addPane(1, .3, 1, 20, cloud);
  const double wrong[] = {0, -.5, 1.5};
  for (std::size_t i = 0; i < 3; ++i) cloud.rows[i][8] = wrong[i];
  writeTable(cloud, directory_.file("cloud.ply"));
  const auto stats = indexClouds({directory_.file("cloud.ply")}, directory_.file("scene.sft"),
                                 IndexOptions{}, progress_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->skipped_records, 3u);
}

}  // namespace
}  // namespace surfeit
