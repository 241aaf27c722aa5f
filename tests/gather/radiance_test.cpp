#include "surfeit/radiance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "gather/test_clouds.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

constexpr double kPi64 = 3.14159265358979;

class RecordedNotes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

// Photons at random on surfaces of known irradiance, all of white power and albedo 0.5 unless told.
class PhotonTable {
 public:
  explicit PhotonTable(unsigned seed = 1) : random_(seed) {
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "power_r", "power_g", "power_b",
                             "albedo_r", "albedo_g", "albedo_b"}) {
      table.addProperty(name);
    }
  }

  void add(const glm::vec3& p, const glm::vec3& n, double power) {
    table.rows.push_back(
        {p.x, p.y, p.z, n.x, n.y, n.z, power, 2 * power, 0, albedo.x, albedo.y, albedo.z});
  }
  // The rectangle corner, corner + u, corner + v, u x v: `irradiance` in red.
  void addRectangle(const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v, int count,
                    double irradiance) {
    const glm::vec3 cross = glm::cross(u, v);
    const double power = irradiance * double(glm::length(cross)) / count;
    for (int i = 0; i < count; ++i) {
      const float a = unit(), b = unit();
      add(corner + a * u + b * v, glm::normalize(cross), power);
    }
  }
  void addSphere(const glm::vec3& centre, float radius, int count, double irradiance) {
    const double power = irradiance * 4 * kPi64 * double(radius) * double(radius) / count;
    for (int i = 0; i < count; ++i) {
      const float z = 2 * unit() - 1, phi = 6.28318531f * unit(), r = std::sqrt(1 - z * z);
      const glm::vec3 normal(r * std::cos(phi), r * std::sin(phi), z);
      add(centre + radius * normal, normal, power);
    }
  }
  float unit() { return std::uniform_real_distribution<float>(0, 1)(random_); }

  Table table;
  glm::vec3 albedo{0.5f};

 private:
  std::mt19937 random_;
};

// Mean of a quantity over surfels, weighted by area.
template <typename Value>
double areaMean(const std::vector<Surfel>& surfels, Value value) {
  double sum = 0, area = 0;
  for (const Surfel& surfel : surfels) {
    sum += double(surfel.area) * double(value(surfel));
    area += double(surfel.area);
  }
  return sum / area;
}

double totalArea(const std::vector<Surfel>& surfels) {
  double area = 0;
  for (const Surfel& surfel : surfels) area += double(surfel.area);
  return area;
}

double redOf(const Surfel& surfel) { return double(surfel.radiosity.r); }

class Radiance : public ::testing::Test {
 protected:
  Result<RadianceStats> run(const Table& photons, const RadianceOptions& options = {}) {
    writeTable(photons, directory_.file("photons.ply"));
    return radianceCloud({directory_.file("photons.ply")}, directory_.file("out.ply"), options,
                         notes_);
  }
  std::vector<Surfel> surfelsOf(const Table& photons, const RadianceOptions& options = {}) {
    const Result<RadianceStats> stats = run(photons, options);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (!stats.ok()) return {};
    stats_ = *stats;
    return readSurfels();
  }
  std::vector<Surfel> readSurfels() const {
    auto source = openSurfelSource(directory_.file("out.ply"), /* strict= */ true);
    EXPECT_TRUE(source.ok()) << source.status().message();
    std::vector<Surfel> surfels((*source)->recordCount());
    for (std::size_t got = 0; got < surfels.size();) {
      const Result<std::size_t> count = (*source)->read(std::span(surfels).subspan(got));
      EXPECT_TRUE(count.ok() && *count > 0);
      if (!count.ok() || *count == 0) break;
      got += *count;
    }
    return surfels;
  }
  std::vector<Surfel> where(std::vector<Surfel> surfels, bool (*keep)(const Surfel&)) const {
    std::erase_if(surfels, [keep](const Surfel& surfel) { return !keep(surfel); });
    return surfels;
  }

  TestDirectory directory_;
  RecordedNotes notes_;
  RadianceStats stats_;
};

TEST_F(Radiance, OfUniformFluxIsAlbedoTimesIrradiance) {
  PhotonTable photons;
  photons.albedo = {0.5f, 0.25f, 1};
  photons.addRectangle({0, 0, 0}, {2, 0, 0}, {0, 1, 0}, 40000, 3);
  const std::vector<Surfel> surfels = surfelsOf(photons.table);
  ASSERT_EQ(surfels.size(), 40000u);
  // The mean is good to a part in the root of all photons, one value to a part in that of 100
  EXPECT_NEAR(areaMean(surfels, redOf), 1.5, 0.01 * 1.5);
  EXPECT_NEAR(areaMean(surfels, [](const Surfel& s) { return s.radiosity.g; }), 1.5, 0.01 * 1.5);
  double variance = 0;
  for (const Surfel& surfel : surfels) {
    variance += (redOf(surfel) - 1.5) * (redOf(surfel) - 1.5) / 40000;
    ASSERT_EQ(surfel.radiosity.b, 0);
    ASSERT_EQ(surfel.albedo, photons.albedo);
    ASSERT_EQ(surfel.normal, glm::vec3(0, 0, 1));
  }
  EXPECT_LT(std::sqrt(variance) / 1.5, 0.13);
}

// Half and three quarters of the disks at edges and corners lie beyond the surface: without the
// hull, the mean within the strips would be 0.75 of what it should.
TEST_F(Radiance, EdgesAndCornersAreNoDarker) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 40000, 2);
  const std::vector<Surfel> all = surfelsOf(photons.table);
  const std::vector<Surfel> edges = where(all, [](const Surfel& s) {
    return std::min({s.position.x, s.position.y, 1 - s.position.x, 1 - s.position.y}) < 0.01f;
  });
  ASSERT_GT(edges.size(), 1000u);
  EXPECT_NEAR(areaMean(edges, redOf), 1, 0.05);
  const std::vector<Surfel> corners = where(all, [](const Surfel& s) {
    return std::min(s.position.x, 1 - s.position.x) < 0.03f &&
           std::min(s.position.y, 1 - s.position.y) < 0.03f;
  });
  ASSERT_GT(corners.size(), 100u);
  EXPECT_NEAR(areaMean(corners, redOf), 1, 0.1);
}

TEST_F(Radiance, AreasSumToThatOfTheSurfaces) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {2, 0, 0}, {0, 1, 0}, 30000, 1);
  photons.addSphere({1, 0.5f, 2}, 0.7f, 30000, 1);
  photons.addRectangle({0, 0, 4}, {0.02f, 0, 0}, {0, 3, 0}, 3000,
                       1);  // a strip, thinner than disks
  const std::vector<Surfel> all = surfelsOf(photons.table);
  const auto areaBetween = [&](float low, float high) {
    double area = 0;
    for (const Surfel& surfel : all) {
      if (surfel.position.z >= low && surfel.position.z < high) area += double(surfel.area);
    }
    return area;
  };
  EXPECT_NEAR(areaBetween(-1, 1), 2, 0.02 * 2);
  EXPECT_NEAR(areaBetween(1, 3), 4 * kPi64 * 0.49, 0.02 * 4 * kPi64 * 0.49);
  EXPECT_NEAR(areaBetween(3, 5), 0.06, 0.1 * 0.06);
  EXPECT_NEAR(stats_.area, totalArea(all), 1e-6);
}

// Radiosity times area, summed, is what the photons bring, reflected.
TEST_F(Radiance, FluxIsKept) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 20000, 2);
  photons.addRectangle({1, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2000, 0.2);
  surfelsOf(photons.table);
  EXPECT_NEAR(stats_.power.r, 2.2, 1e-5);
  EXPECT_NEAR(stats_.power.g, 4.4, 1e-5);
  EXPECT_NEAR(stats_.reflected_power.r, 1.1, 0.01);
}

TEST_F(Radiance, DoesNotLeakThroughThinWalls) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 20000, 100);    // a lit front,
  photons.addRectangle({0, 0, -1e-4f}, {0, 1, 0}, {1, 0, 0}, 5000, 1);  // a dark back
  photons.addRectangle({0, 0, -1}, {1, 0, 0}, {0, 0, 1}, 5000, 10);     // a wall that meets it
  const std::vector<Surfel> all = surfelsOf(photons.table);
  for (const Surfel& surfel : all) {
    const double expected = surfel.normal.z > 0.5f ? 50 : surfel.normal.z < -0.5f ? 0.5 : 5;
    ASSERT_NEAR(redOf(surfel) / expected, 1, 0.8);
  }
  EXPECT_NEAR(areaMean(where(all, [](const Surfel& s) { return s.normal.z < -0.5f; }), redOf), 0.5,
              0.01);
}

TEST_F(Radiance, ParallelSheetsKeepApart) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 20000, 100);
  photons.addRectangle({0, 0, 0.05f}, {1, 0, 0}, {0, 1, 0}, 20000,
                       1);  // disks have a radius of .04
  for (const Surfel& surfel : surfelsOf(photons.table)) {
    const double expected = surfel.position.z > 0.01f ? 0.5 : 50;
    ASSERT_NEAR(redOf(surfel) / expected, 1, 0.7);
  }
}

TEST_F(Radiance, LightEndsWhereThePhotonsEnd) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {0.5f, 0, 0}, {0, 1, 0}, 20000, 2);
  const std::vector<Surfel> border =
      where(surfelsOf(photons.table), [](const Surfel& s) { return s.position.x > 0.49f; });
  EXPECT_NEAR(areaMean(border, redOf), 1, 0.05);
}

TEST_F(Radiance, ThreadsMemoryAndOrderDoNotChangeABit) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 10000, 1);
  photons.addSphere({0.5f, 0.5f, 0.4f}, 0.3f, 10000, 2);
  photons.addRectangle({0, 0, 0}, {1e-3f, 0, 0}, {0, 0, 1e-3f}, 50, 2);
  RadianceOptions options;
  options.photons_per_estimate = 50;
  std::string bytes;
  for (const int threads : {1, 2, 5}) {
    for (const std::uint64_t memory : {std::uint64_t{64} << 20, std::uint64_t{1} << 30}) {
      std::shuffle(photons.table.rows.begin(), photons.table.rows.end(), std::mt19937(threads));
      options.threads = threads;
      options.memory_bytes = memory;
      ASSERT_EQ(surfelsOf(photons.table, options).size(), 20050u);
      const std::string now = readBytes(directory_.file("out.ply"));
      EXPECT_TRUE(bytes.empty() || bytes == now) << threads << " threads, " << memory << " bytes";
      bytes = now;
    }
  }
  EXPECT_TRUE(directory_.holdsOnly({"out.ply", "photons.ply"}));
}

// What the search finds in passing must not depend on how photons share walks: one by one, in the
// order of the file, the definition gives the same.
TEST_F(Radiance, AgreesWithBruteForce) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1500, 2);
  photons.addRectangle({0, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1500, 1);
  photons.addSphere({0.5f, 0.5f, 0.5f}, 0.2f, 1000, 1);
  RadianceOptions options;
  options.photons_per_estimate = 8;  // too few for a hull: the plain disk
  for (const Surfel& surfel : surfelsOf(photons.table, options)) {
    struct Found {
      double distance_sq, lateral_sq, power;
    };
    std::vector<Found> found;
    for (const std::vector<double>& row : photons.table.rows) {
      const glm::dvec3 d = glm::dvec3(row[0], row[1], row[2]) - glm::dvec3(surfel.position);
      const glm::dvec3 normal(row[3], row[4], row[5]), own(surfel.normal);
      if (glm::dot(normal, own) < 0.5) continue;
      const double height = glm::dot(d, own);
      const double lateral_sq = glm::dot(d, d) - height * height;
      found.push_back({lateral_sq + 16 * height * height, lateral_sq, row[6]});
    }
    std::nth_element(found.begin(), found.begin() + 8, found.end(),
                     [](const Found& a, const Found& b) { return a.distance_sq < b.distance_sq; });
    double power = 0, radius_sq = found[8].lateral_sq;
    for (std::size_t i = 0; i < 8; ++i) {
      power += found[i].power;
      radius_sq = std::max(radius_sq, found[i].lateral_sq);
    }
    const double area = kPi64 * radius_sq;
    ASSERT_NEAR(redOf(surfel) / (0.5 * power / area), 1, 1e-4);
    ASSERT_NEAR(double(surfel.area) / (area / 8), 1, 1e-4);
  }
}

TEST_F(Radiance, NormalsTurnToTheSideThatThePhotonsCameFrom) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 4000, 1);
  for (const char* name : {"incident_x", "incident_y", "incident_z"}) {
    photons.table.addProperty(name);
  }
  for (std::size_t i = 0; i < photons.table.rows.size(); ++i) {
    for (const double value : {0.3, 0.1, i % 4 == 0 ? 1.0 : -1.0}) {
      photons.table.rows[i].push_back(value);
    }
  }
  const std::vector<Surfel> all = surfelsOf(photons.table);
  const std::vector<Surfel> back = where(all, [](const Surfel& s) { return s.normal.z < 0; });
  EXPECT_EQ(back.size(), 1000u);
  EXPECT_NEAR(areaMean(back, redOf), 0.125, 0.01);
}

TEST_F(Radiance, AlbedoIsMadeUpAndTold) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 4000, 1);
  photons.table.properties.resize(9);
  for (std::vector<double>& row : photons.table.rows) row.resize(9);
  RadianceOptions options;
  options.default_albedo = {0.25f, 0.25f, 0.25f};
  EXPECT_NEAR(areaMean(surfelsOf(photons.table, options), redOf), 0.25, 0.005);
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("photons.ply: no albedo: 0.25 0.25 0.25 is used"));
}

TEST_F(Radiance, FewPhotonsGiveFiniteSurfels) {
  PhotonTable photons;
  photons.add({1, 2, 3}, {0, 0, 1}, 1);
  const auto expectSound = [&](std::size_t count) {
    const std::vector<Surfel> surfels = surfelsOf(photons.table);
    ASSERT_EQ(surfels.size(), count);
    for (const Surfel& surfel : surfels) {
      EXPECT_TRUE(std::isfinite(surfel.radiosity.r) && surfel.radiosity.r > 0);
      EXPECT_TRUE(std::isfinite(surfel.radius) && surfel.radius > 0 && surfel.area > 0);
    }
    EXPECT_EQ(stats_.sparse_surfels, count);
  };
  expectSound(1);
  photons.add({1, 2, 4}, {0, 0, 1}, 1);
  photons.add({1, 3, 4}, {0, 1, 0}, 1);
  expectSound(3);
  for (int i = 0; i < 50; ++i) photons.add({float(i), 0, 0}, {0, 0, 1}, 1);  // in a line
  expectSound(53);
}

// A few photons on a wall, and one astray, beside a bright floor: their disks end where photons
// show that the floor is. (Without that, they have a radius of .12.)
TEST_F(Radiance, DisksOfStrayPhotonsEndAtOtherSurfaces) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 40000, 1);
  const std::vector<float> heights = {0.02f, 0.05f, 0.3f};
  const double power = 1. / 40000;
  for (const float height : heights) photons.add({1, 0.5f, height}, {-1, 0, 0}, power);
  photons.add({0.5f, 0.5f, 0}, {1, 0, 0}, power);
  std::vector<Surfel> strays =
      where(surfelsOf(photons.table), [](const Surfel& s) { return std::abs(s.normal.x) > 0.5f; });
  ASSERT_EQ(strays.size(), 4u);
  EXPECT_EQ(stats_.bounded_surfels, 3u);
  std::sort(strays.begin(), strays.end(),
            [](const Surfel& a, const Surfel& b) { return a.position.z < b.position.z; });
  EXPECT_LT(strays[0].radius, 0.02f);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT(strays[i + 1].radius, heights[i] + 0.01f);
    EXPECT_GT(strays[i + 1].radius, heights[i] - 0.01f);
  }
  EXPECT_GT(strays[3].radius, 0.1f);  // no other surface is near
  // Power stays
  for (const Surfel& stray : strays) {
    EXPECT_NEAR(double(stray.area) * redOf(stray), power / 2, 1e-3 * power);
  }
}

TEST_F(Radiance, ManyPhotonsAtOnePositionDoNoHarm) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 4000, 1);
  for (int i = 0; i < 20000; ++i) photons.add({0.5f, 0.5f, 0}, {0, 0, 1}, 1e-6);
  const std::vector<Surfel> surfels = surfelsOf(photons.table);
  ASSERT_EQ(surfels.size(), 24000u);
  for (const Surfel& surfel : surfels) ASSERT_TRUE(std::isfinite(surfel.radiosity.r));
  EXPECT_NEAR(totalArea(surfels), 1, 0.05);
}

TEST_F(Radiance, InvalidPhotonsAreSkippedAndTold) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2000, 1);
  photons.table.rows[7][3] = photons.table.rows[7][4] = photons.table.rows[7][5] = 0;  // no normal
  photons.table.rows[8][6] = -1;                                                       // power
  photons.table.rows[9][7] = NAN;
  photons.table.rows[10][0] = INFINITY;  // position
  EXPECT_EQ(surfelsOf(photons.table).size(), 1996u);
  EXPECT_EQ(stats_.skipped_photons, 4u);
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("1 record with a normal of zero (first: record 7)"));
  EXPECT_THAT(notes_.notes[0], HasSubstr("2 records with a power that is negative"));
  EXPECT_THAT(notes_.notes[0],
              HasSubstr("1 record with a non-finite value (first: record 10, whose x is inf)"));

  RadianceOptions strict;
  strict.strict = true;
  EXPECT_THAT(run(photons.table, strict).status().message(),
              HasSubstr("photons.ply: record 7: normal is zero"));
  photons.table.rows.erase(photons.table.rows.begin() + 7);
  EXPECT_THAT(run(photons.table, strict).status().message(),
              HasSubstr("record 7: power_r is -1, expected 0 to"));
}

class BadPhotons : public Radiance {
 protected:
  // Refused before anything is written, with this message.
  void expectRefused(const Table& table, StatusCode code, const std::string& message,
                     const RadianceOptions& options = {}) {
    const Status status = run(table, options).status();
    EXPECT_EQ(status.code(), code);
    EXPECT_THAT(status.message(), HasSubstr(message));
    EXPECT_TRUE(directory_.holdsOnly({"photons.ply"}));
  }
  static Table with(std::vector<std::string> names, int rows = 1) {
    Table table;
    for (const std::string& name : names) table.addProperty(name);
    table.rows.assign(std::size_t(rows), std::vector<double>(names.size(), 1));
    return table;
  }
};

TEST_F(BadPhotons, AreRefusedWithFileAndExpectation) {
  const StatusCode bad = StatusCode::kCorruption;
  expectRefused(with({"x", "y", "z", "nx", "ny", "nz"}), bad,
                "photons.ply: element vertex: found no properties power_r, power_g, power_b, "
                "expected the power of every photon");
  expectRefused(
      with({"x", "y", "z", "nx", "ny", "nz", "radiosity_r", "radiosity_g", "radiosity_b"}), bad,
      "this cloud has radiosity already");
  expectRefused(with({"x", "y", "z", "power_r", "power_g", "power_b"}), bad,
                "photons.ply: element vertex: found no properties nx, ny, nz, expected the normal");
  expectRefused(with({"nx", "ny", "nz", "power_r", "power_g", "power_b"}), bad,
                "found no properties x, y, z");
  expectRefused(with({"x", "y", "z", "nx", "ny", "nz", "power_r", "power_b"}), bad,
                "found 2 of the properties power_r, power_g, power_b");
  expectRefused(with({"x", "y", "z", "nx", "ny", "nz", "power_r", "power_g", "power_b"}, 0), bad,
                "photons.ply: element vertex has 0 rows, expected photons");
  Table invalid = with({"x", "y", "z", "nx", "ny", "nz", "power_r", "power_g", "power_b"}, 3);
  for (std::vector<double>& row : invalid.rows) row[6] = -1;
  expectRefused(invalid, bad, "photons.ply: no valid photon in 3 records");
}

TEST_F(BadPhotons, AndBadOptionsLeaveNothing) {
  const Table photons = with({"x", "y", "z", "nx", "ny", "nz", "power_r", "power_g", "power_b"}, 3);
  const StatusCode bad = StatusCode::kInvalidArgument;
  RadianceOptions options;
  options.photons_per_estimate = 0;
  expectRefused(photons, bad, "photons per estimate is 0, expected 1 to 10000", options);
  options = {};
  options.max_radius = NAN;
  expectRefused(photons, bad, "max radius is nan", options);
  options = {};
  options.default_albedo.y = 1.5f;
  expectRefused(photons, bad, "albedo is 1.5, expected 0 to 1", options);
  options = {};
  options.disk_overlap = 0;
  expectRefused(photons, bad, "overlap is 0, expected 1 to 16", options);
  options = {};
  options.memory_bytes = 1 << 20;
  expectRefused(photons, StatusCode::kBudgetTooSmall, "64 MiB is the least", options);

  const std::string path = directory_.file("photons.ply");
  EXPECT_EQ(radianceCloud({path}, path, {}, notes_).status().code(), bad);
  EXPECT_EQ(radianceCloud({}, path, {}, notes_).status().code(), bad);
  EXPECT_EQ(radianceCloud({path + "x"}, path, {}, notes_).status().code(), StatusCode::kIoError);
}

class CancelAtEstimate : public Progress {
 public:
  void beginPhase(std::string_view name, std::uint64_t, std::string_view) override {
    if (name == "estimate") is_cancelled_ = true;
  }
  bool isCancelled() const override { return is_cancelled_; }

 private:
  std::atomic<bool> is_cancelled_ = false;
};

TEST_F(Radiance, CancelledWorkLeavesNothing) {
  PhotonTable photons;
  photons.addRectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2000, 1);
  writeTable(photons.table, directory_.file("photons.ply"));
  CancelAtEstimate progress;
  const Result<RadianceStats> stats = radianceCloud(
      {directory_.file("photons.ply")}, directory_.file("out.ply"), RadianceOptions{}, progress);
  EXPECT_EQ(stats.status().code(), StatusCode::kInterrupted);
  EXPECT_TRUE(directory_.holdsOnly({"photons.ply"}));
}

}  // namespace
}  // namespace surfeit
