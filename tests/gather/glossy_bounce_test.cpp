// Glossy bounces: a lamp above a shiny floor beside a wall, against integrals of the Phong lobe
// over lamp and floor; energy in a closed room; nodes against the surfels below them; and what a
// scene without lobes keeps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gather/rules/lobe_light.h"
#include "gather/test_clouds.h"
#include "octree/indexed_surfels.h"
#include "octree/read/paged_octree.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/engine.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

constexpr CloudChannels kGlossyChannels = {
    .normal = true, .radius = true, .area = true, .radiosity = true, .albedo = true, .group = true};
constexpr std::uint32_t kWallGroup = 0, kFloorGroup = 1, kLampGroup = 2;
constexpr float kLampLight = 100, kLampSide = .25f;
const glm::vec3 kLampPlace(1, 0, 1);
const glm::vec3 kFloorAlbedo(.8f, .4f, .2f);

// Side * side surfels of a square about a middle, spanned by two sides.
void addSquare(const glm::vec3& middle, const glm::vec3& u, const glm::vec3& v, int side,
               const Surfel& like, std::vector<Surfel>& cloud) {
  for (int i = 0; i < side * side; ++i) {
    const float a = (float(i % side) + .5f) / float(side) - .5f;
    const float b = (float(i / side) + .5f) / float(side) - .5f;
    Surfel& surfel = cloud.emplace_back(like);
    surfel.position = middle + a * u + b * v;
    surfel.normal = glm::normalize(glm::cross(u, v));
    surfel.area = glm::length(glm::cross(u, v)) / float(side * side);
    surfel.radius = std::sqrt(surfel.area / 2);
  }
}

// A floor at z = 0, a black wall at x = 0, and a lamp that faces down.
std::vector<Surfel> hall(int floor_side = 60) {
  std::vector<Surfel> cloud;
  Surfel floor, wall, lamp;
  floor.group = kFloorGroup;
  floor.albedo = kFloorAlbedo;
  wall.group = kWallGroup;
  lamp.group = kLampGroup;
  lamp.radiosity = glm::vec3(kLampLight);
  addSquare({1.5f, 0, 0}, {3, 0, 0}, {0, 3, 0}, floor_side, floor, cloud);
  addSquare({0, 0, 1.5f}, {0, 3, 0}, {0, 0, 3}, 30, wall, cloud);
  addSquare(kLampPlace, {0, kLampSide, 0}, {kLampSide, 0, 0}, 6, lamp, cloud);
  return cloud;
}

// Of the floor in hall(), by sums over floor and lamp: the light that arrives is sent in a lobe
// cos^n about the mirror direction, of which all flux is kept.
class PhongFloor {
 public:
  explicit PhongFloor(double roughness) : exponent_(2 / (roughness * roughness) - 2) {
    for (int i = 0; i <= kTable; ++i) flux_[std::size_t(i)] = fluxOfLobe(double(i) / kTable);
  }

  // Of white light and an albedo of 1, on the wall, which faces along x.
  double irradianceAt(const glm::dvec3& place) const {
    constexpr int kFloorSteps = 60, kLampSteps = 3;
    const double cell = 3. / kFloorSteps, lamp_cell = double(kLampSide) / kLampSteps;
    double sum = 0;
    for (int i = 0; i < kFloorSteps * kFloorSteps; ++i) {
      const glm::dvec3 at((i % kFloorSteps + .5) * cell, (i / kFloorSteps + .5) * cell - 1.5, 0);
      const glm::dvec3 way = place - at;
      const double distance = glm::length(way);
      const glm::dvec3 out = way / distance;
      const double form = out.z * -out.x * cell * cell / (distance * distance);
      double radiance = 0;
      for (int k = 0; k < kLampSteps * kLampSteps; ++k) {
        const glm::dvec3 lamp = glm::dvec3(kLampPlace) +
                                lamp_cell * glm::dvec3(k % kLampSteps - kLampSteps / 2. + .5,
                                                       k / kLampSteps - kLampSteps / 2. + .5, 0);
        radiance += radianceFrom(at, lamp, out) * lamp_cell * lamp_cell;
      }
      sum += radiance * form;
    }
    return sum;
  }

 private:
  static constexpr int kTable = 64;

  // Per area of the lamp.
  double radianceFrom(const glm::dvec3& at, const glm::dvec3& lamp, const glm::dvec3& out) const {
    const glm::dvec3 way = lamp - at;
    const double square = glm::dot(way, way), cosine = way.z / std::sqrt(square);
    const double irradiance = double(kLampLight) / 3.14159265358979 * cosine * cosine / square;
    const glm::dvec3 mirrored = glm::dvec3(-way.x, -way.y, way.z) / std::sqrt(square);
    const double along = glm::dot(mirrored, out);
    if (along <= 0) return 0;
    const double place = cosine * kTable;
    const auto i = std::min<std::size_t>(std::size_t(place), kTable - 1);
    const double flux = flux_[i] + (place - double(i)) * (flux_[i + 1] - flux_[i]);
    return irradiance * std::pow(along, exponent_) / flux;
  }

  // The integral of cos^n times the cosine above a surface, of a lobe whose axis has this cosine.
  double fluxOfLobe(double axis_cosine) const {
    const glm::dvec3 axis(std::sqrt(1 - axis_cosine * axis_cosine), 0, axis_cosine);
    constexpr int kSteps = 150;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double z = (i + .5) / kSteps, s = std::sqrt(1 - z * z);
      for (int k = 0; k < kSteps; ++k) {
        const double phi = 2 * 3.14159265358979 * (k + .5) / kSteps;
        const double along = glm::dot(axis, {s * std::cos(phi), s * std::sin(phi), z});
        if (along > 0) sum += z * std::pow(along, exponent_);
      }
    }
    return sum * 2 * 3.14159265358979 / (kSteps * kSteps);
  }

  const double exponent_;
  std::array<double, kTable + 1> flux_{};
};

class GlossyBounce : public testing::Test {
 protected:
  std::string index(const std::vector<Surfel>& cloud, const std::string& name) {
    const std::string path = directory_.file(name);
    indexSurfels(cloud, path, kGlossyChannels, false);
    return path;
  }

  static BounceOptions optionsFor(float share, float roughness, int bounces = 1) {
    BounceOptions options;
    options.bounces = bounces;
    options.threads = 1;
    options.memory_bytes = 256 << 20;
    options.glossy = {{kFloorGroup, share, roughness}};
    return options;
  }

  std::string bounce(const std::string& scene, const std::string& name,
                     const BounceOptions& options) {
    const auto stats = bounceScene(scene, directory_.file(name), options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return directory_.file(name);
  }

  // Irradiance at places of the wall, farther from the floor than it has details.
  std::vector<glm::dvec3> gather(const std::string& scene, const glm::mat3& turn = glm::mat3(1),
                                 float max_solid_angle = .01f) {
    Table table;
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) table.addProperty(name);
    const glm::dvec3 normal(turn * glm::vec3(1, 0, 0));
    for (const glm::dvec3& place : places()) {
      const glm::dvec3 at = glm::dmat3(turn) * place;
      table.rows.push_back({at.x, at.y, at.z, normal.x, normal.y, normal.z});
    }
    writeTable(table, directory_.file("wall.ply"));
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.threads = 1;
    options.quality.max_solid_angle = max_solid_angle;
    const auto stats = gatherCloud(scene, directory_.file("wall.ply"),
                                   directory_.file("result.ply"), options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const Table result = readTable(directory_.file("result.ply"));
    const auto r = result.column("irradiance_r"), g = result.column("irradiance_g"),
               b = result.column("irradiance_b");
    std::vector<glm::dvec3> irradiance;
    for (std::size_t i = 0; i < r.size(); ++i) irradiance.emplace_back(r[i], g[i], b[i]);
    return irradiance;
  }

  static std::vector<glm::dvec3> places() {
    std::vector<glm::dvec3> places;
    for (int i = 0; i < 32; ++i) {
      places.emplace_back(0, i % 2 == 0 ? 0 : .4, .25 + 1.45 * double(i / 2) / 15);
    }
    return places;
  }

  // What the bounce adds.
  std::vector<double> added(const std::vector<glm::dvec3>& after,
                            const std::vector<glm::dvec3>& before, int channel = 0) {
    std::vector<double> added;
    for (std::size_t i = 0; i < after.size(); ++i) {
      added.push_back(after[i][channel] - before[i][channel]);
    }
    return added;
  }

  // The greatest difference over the greatest value.
  static double error(const std::vector<double>& found, const std::vector<double>& truth) {
    double most = 0, peak = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      most = std::max(most, std::abs(found[i] - truth[i]));
      peak = std::max(peak, truth[i]);
    }
    return most / peak;
  }

  TestDirectory directory_;
  Progress progress_;
};

TEST_F(GlossyBounce, AShinyFloorLightsAWallAsItsPhongLobeDoes) {
  const std::string scene = index(hall(), "hall.sft");
  const std::vector<glm::dvec3> before = gather(scene);
  const std::vector<double> even =
      added(gather(bounce(scene, "even.sft", optionsFor(0, .5f))), before);
  for (const float roughness : {.5f, .3f, .2f}) {
    const PhongFloor floor(double{roughness});
    std::vector<double> truth;
    for (const glm::dvec3& place : places()) {
      truth.push_back(double(kFloorAlbedo.r) * floor.irradianceAt(place));
    }
    const std::vector<glm::dvec3> after =
        gather(bounce(scene, "shiny.sft", optionsFor(1, roughness)));
    const double found = error(added(after, before), truth), by_even = error(even, truth);
    std::printf("roughness %.1f: error %.3f of the peak, sent evenly %.3f\n", double(roughness),
                found, by_even);
    EXPECT_LT(found, .09) << roughness;
    EXPECT_GT(by_even, .12) << roughness;
    // A color by itself
    const std::vector<double> red = added(after, before, 0), blue = added(after, before, 2);
    for (std::size_t i = 0; i < red.size(); ++i) {
      EXPECT_NEAR(blue[i], red[i] * double(kFloorAlbedo.b / kFloorAlbedo.r), .02 * red[i] + .01);
    }
  }
}

TEST_F(GlossyBounce, ASharedPartIsSentInTheLobe) {
  const std::string scene = index(hall(), "hall.sft");
  const std::vector<glm::dvec3> before = gather(scene);
  const auto lit = [&](float share) {
    return added(gather(bounce(scene, "part.sft", optionsFor(share, .3f))), before);
  };
  const std::vector<double> none = lit(0), half = lit(.5f), all = lit(1);
  std::vector<double> mixed;
  for (std::size_t i = 0; i < all.size(); ++i) mixed.push_back((none[i] + all[i]) / 2);
  EXPECT_LT(error(half, mixed), .01);
}

TEST_F(GlossyBounce, TurnedScenesAreLitTheSame) {
  const glm::mat3 turn(glm::rotate(glm::mat4(1), .8f, glm::normalize(glm::vec3(1, 2, -1))));
  std::vector<Surfel> cloud = hall();
  const std::string scene = index(cloud, "hall.sft");
  for (Surfel& surfel : cloud) {
    surfel.position = turn * surfel.position;
    surfel.normal = turn * surfel.normal;
  }
  const std::string turned = index(cloud, "turned.sft");
  const BounceOptions options = optionsFor(1, .3f);
  const std::vector<double> truth =
      added(gather(bounce(scene, "shiny.sft", options)), gather(scene));
  const std::vector<double> found =
      added(gather(bounce(turned, "shiny_turned.sft", options), turn), gather(turned, turn));
  const double most = error(found, truth);
  std::printf("turned: differs by %.3f of the peak\n", most);
  EXPECT_LT(most, .08);
}

TEST_F(GlossyBounce, NodesLightAsTheirSurfelsDo) {
  const std::string scene = index(hall(), "hall.sft");
  const std::string shiny = bounce(scene, "shiny.sft", optionsFor(1, .3f));
  const auto lit = [&](float max_solid_angle) {
    return added(gather(shiny, glm::mat3(1), max_solid_angle),
                 gather(scene, glm::mat3(1), max_solid_angle));
  };
  // What bounce tells to use, and a fourth of it
  const double most = error(lit(.07f), lit(0)), finer = error(lit(.018f), lit(0));
  std::printf("nodes against surfels: %.3f of the peak, %.3f with smaller nodes\n", most, finer);
  EXPECT_LT(most, .08);
  EXPECT_LT(finer, .015);
}

TEST_F(GlossyBounce, ScatteredReceiversAreLitAsTheyAreAlone) {
  const std::string scene = index(hall(), "hall.sft");
  const std::string shiny = bounce(scene, "shiny.sft", optionsFor(1, .3f));
  auto engine = Engine::create({.memory_bytes = 256 << 20, .threads = 1, .lobes = true});
  ASSERT_TRUE(engine.ok()) << engine.status().message();
  const auto opened = engine->open(shiny), dark = engine->open(scene);
  ASSERT_TRUE(opened.ok() && dark.ok()) << opened.status().message();
  GatherSettings settings;
  settings.mode = GatherMode::kBleeding;
  settings.quality.max_solid_angle = .01f;
  std::vector<double> alone;
  for (const glm::dvec3& place : places()) {
    const Receiver receiver = {.position = place, .normal = {1, 0, 0}};
    double light[2];
    for (int i = 0; i < 2; ++i) {
      auto gatherer = engine->gatherer(i == 0 ? *opened : *dark, settings);
      ASSERT_TRUE(gatherer.ok()) << gatherer.status().message();
      GatherResult result;
      ASSERT_TRUE(gatherer->gather(&receiver, 1, &result).ok());
      light[i] = double(result.irradiance.r);
    }
    alone.push_back(light[0] - light[1]);
  }
  const double most = error(added(gather(shiny), gather(scene)), alone);
  std::printf("together against alone: %.3f of the peak\n", most);
  EXPECT_LT(most, .02);
}

TEST_F(GlossyBounce, AnEngineWithoutRoomForLobesRefusesThem) {
  const std::string shiny = bounce(index(hall(20), "hall.sft"), "shiny.sft", optionsFor(1, .3f));
  auto engine = Engine::create({.memory_bytes = 256 << 20, .threads = 1});
  ASSERT_TRUE(engine.ok());
  const Status status = engine->open(shiny).status();
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("EngineOptions::lobes"));
}

// All light of a closed room lands on it again, wherever lobes send it.
TEST_F(GlossyBounce, AClosedRoomLosesAndGainsNoLight) {
  std::vector<Surfel> cloud;
  Surfel wall;
  wall.albedo = glm::vec3(.7f);
  wall.group = kFloorGroup;
  const glm::vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2);
  for (const auto& [u, v] : {std::pair(x, y), std::pair(y, z), std::pair(z, x)}) {
    const glm::vec3 out = glm::normalize(glm::cross(u, v));
    addSquare(-out, u, v, 24, wall, cloud);
    addSquare(out, v, u, 24, wall, cloud);
  }
  for (Surfel& surfel : cloud) {
    if (glm::distance(surfel.position, {.2f, .3f, 1}) < .4f) surfel.radiosity = glm::vec3(5);
  }
  const std::string scene = index(cloud, "room.sft");
  const auto power = [&](float share, int bounces) {
    double sum = 0;
    for (const Surfel& surfel :
         surfelsOf(bounce(scene, "lit.sft", optionsFor(share, .3f, bounces)))) {
      sum += double(surfel.area * surfel.radiosity.g);
    }
    return sum;
  };
  // What is sent in all directions together is that of an even floor after the first bounce
  EXPECT_NEAR(power(1, 1) / power(0, 1), 1, 1e-6);
  for (const int bounces : {2, 4}) {
    const double ratio = power(1, bounces) / power(0, bounces);
    std::printf("closed room, %d bounces: %.4f of the light\n", bounces, ratio);
    EXPECT_NEAR(ratio, 1, .02);
  }
}

// What lies below a flat piece, by a walk of the tree.
struct BelowPiece {
  glm::dvec3 lobe{0}, mean{0};
  double weight = 0;
};

TEST_F(GlossyBounce, FlatNodesHoldTheSumsOfTheLobesBelow) {
  const std::string shiny = bounce(index(hall(), "hall.sft"), "shiny.sft", optionsFor(.9f, .2f));
  Result<SceneFile> file = SceneFile::open(shiny);
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(file->header().format_version, 4u);
  const auto memory = PagedOctree::planMemory(*file, PagedOctree::unlimitedCacheBytes(*file), 1);
  const auto octree = PagedOctree::create(std::move(*file), *memory);
  PagedOctree::Reader reader(**octree);
  const glm::dvec3 luminance(.2126, .7152, .0722);
  std::size_t compared = 0;
  const std::function<BelowPiece(const NodeRange&)> walk = [&](const NodeRange& range) {
    BelowPiece all;
    const auto siblings = reader.nodes(range);
    std::vector<Node> nodes(siblings->begin(), siblings->end());
    std::vector<NodeLobes> lobes;
    for (const Node& node : *siblings) lobes.push_back(*reader.lobesOf(node));
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Node& node = nodes[i];
      BelowPiece below;
      if (!node.isLeaf()) {
        below = walk(childrenOf(node));
      } else {
        EXPECT_TRUE(reader
                        .visitLeaf(node,
                                   [&](std::span<const Surfel> run) {
                                     const std::span<const Lobe> of_run = reader.lobesOf(run);
                                     for (std::size_t k = 0; k < run.size(); ++k) {
                                       const glm::dvec3 lobe = double(run[k].area) *
                                                               glm::dvec3(run[k].radiosity) *
                                                               glm::dvec3(of_run[k].shares());
                                       below.lobe += lobe;
                                       below.weight += glm::dot(lobe, luminance);
                                       below.mean += glm::dot(lobe, luminance) *
                                                     glm::dvec3(of_run[k].meanDirection());
                                     }
                                   })
                        .ok());
      }
      all.lobe += below.lobe;
      all.mean += below.mean;
      all.weight += below.weight;
      if (!node.isFlat() || below.weight == 0) continue;
      ++compared;
      const glm::dvec3 found =
          double(node.area) * glm::dvec3(node.radiosity) * glm::dvec3(lobes[i][0].shares());
      EXPECT_NEAR(found.r, below.lobe.r, .01 * below.lobe.r);
      EXPECT_NEAR(found.b, below.lobe.b, .01 * below.lobe.b);
      const glm::dvec3 mean = below.mean / below.weight;
      EXPECT_LT(glm::distance(glm::dvec3(lobes[i][0].meanDirection()), mean), 2e-4);
    }
    return all;
  };
  walk(kRootRange);
  EXPECT_GT(compared, 150u);
}

TEST_F(GlossyBounce, ScenesWithoutLobesKeepTheirBytes) {
  const std::string scene = index(hall(30), "hall.sft");
  BounceOptions options = optionsFor(0, .3f, 2);
  const std::string even = bounce(scene, "even.sft", options);
  options.glossy.clear();
  const std::string plain = bounce(scene, "plain.sft", options);
  EXPECT_EQ(readBytes(even), readBytes(plain));
  const auto version = [](const std::string& path) {
    const Result<SceneFile> file = SceneFile::open(path);
    return file.ok() ? file->header().format_version : 0;
  };
  EXPECT_EQ(version(plain), 2u);
  options = optionsFor(1, .3f, 2);
  const std::string shiny = bounce(scene, "shiny.sft", options);
  EXPECT_EQ(version(shiny), 4u);
  const auto info = readSceneInfo(shiny);
  EXPECT_TRUE(info->has_lobes);
  EXPECT_THAT(info->provenance, HasSubstr("\"glossy\""));
  const auto report = verifyScene(shiny, 1, progress_);
  ASSERT_TRUE(report.ok());
  EXPECT_THAT(report->findings, testing::IsEmpty());
  // Threads decide about nothing
  options.threads = 3;
  EXPECT_EQ(readBytes(bounce(scene, "threads.sft", options)), readBytes(shiny));
}

TEST_F(GlossyBounce, SparedBouncesAreNearTheWholeOnes) {
  const std::string scene = index(hall(), "hall.sft");
  BounceOptions options = optionsFor(1, .3f);
  const std::vector<double> whole =
      added(gather(bounce(scene, "whole.sft", options)), gather(scene));
  options.surfels_per_receiver = 8;
  options.spare_last = true;
  const std::vector<double> spared =
      added(gather(bounce(scene, "spared.sft", options)), gather(scene));
  const double most = error(spared, whole);
  std::printf("spared: differs by %.3f of the peak\n", most);
  EXPECT_LT(most, .08);
}

TEST_F(GlossyBounce, WhatCannotBeIsRefused) {
  const std::string scene = index(hall(20), "hall.sft");
  const auto refusal = [&](std::vector<GroupGloss> glossy) {
    BounceOptions options = optionsFor(1, .3f);
    options.glossy = std::move(glossy);
    const Status status =
        bounceScene(scene, directory_.file("none.sft"), options, progress_).status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    return status.message();
  };
  EXPECT_THAT(refusal({{kFloorGroup, 1.5f, .3f}}), HasSubstr("share is 1.5, expected 0 to 1"));
  EXPECT_THAT(refusal({{kFloorGroup, 1, .01f}}), HasSubstr("roughness is 0.01"));
  EXPECT_THAT(refusal({{64, 1, .3f}}), HasSubstr("expected groups from 0 to 63"));
  EXPECT_THAT(refusal({{kFloorGroup, 1, .3f}, {kFloorGroup, .5f, .3f}}), HasSubstr("found two"));
}

}  // namespace
}  // namespace surfeit
