#include "surfels/generated/scene_surfaces.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/square_strata.h"

namespace surfeit {
namespace {

constexpr int kPatchesPerLot = 3;  // to a side
constexpr int kPatchesPerSide = kLotsPerSide * kPatchesPerLot;
constexpr double kPatchExtent = kWorldExtent / kPatchesPerSide;

// Keys that keep the random numbers of different things apart.
enum RandomKey : std::uint64_t { kHeightKey = 1, kLotKey = 1 << 10 };

// Random numbers of one thing, in sequence. Draw one a statement, or in braces, where the order in
// which they are drawn is fixed; not twice in a call or a sum.
class RandomSequence {
 public:
  RandomSequence(std::uint64_t seed, std::uint64_t key) : key_(hashOf(seed, key)) {}
  double next() { return double(hashOf(key_, ++number_) >> 11) * 0x1p-53; }  // in [0, 1)
  double next(double begin, double end) { return begin + (end - begin) * next(); }

 private:
  std::uint64_t key_;
  std::uint64_t number_ = 0;
};

// A wave of the hills: random heights -1..1 on a lattice, joined smoothly.
struct HeightWave {
  double amplitude, wavelength;  // m
};

constexpr HeightWave kHills[] = {{110, 410}, {38, 160}, {10, 60}, {2.5, 25}};
constexpr HeightWave kGentleHills[] = {{14, 420}, {2.5, 130}};

double latticeHeight(std::uint64_t key, int column, int row) {
  const std::uint64_t hash = hashOf(key, (std::uint64_t(row) << 32) + std::uint64_t(column));
  return double(hash >> 11) * 0x1p-52 - 1;
}

double waveHeight(const HeightWave& wave, std::uint64_t key, double x, double y) {
  const double fx = x / wave.wavelength, fy = y / wave.wavelength;
  const int column = int(fx), row = int(fy);
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double u = ease(fx - column), v = ease(fy - row);
  const auto mix = [](double a, double b, double t) { return a + t * (b - a); };
  return wave.amplitude *
         mix(mix(latticeHeight(key, column, row), latticeHeight(key, column + 1, row), u),
             mix(latticeHeight(key, column, row + 1), latticeHeight(key, column + 1, row + 1), u),
             v);
}

// The ground: heights at the corners of square patches, bilinear between them.
class Ground {
 public:
  Ground(SceneKind kind, std::uint64_t seed) {
    corners_.reserve((kPatchesPerSide + 1) * (kPatchesPerSide + 1));
    for (int row = 0; row <= kPatchesPerSide; ++row) {
      for (int column = 0; column <= kPatchesPerSide; ++column) {
        const double x = column * kPatchExtent, y = row * kPatchExtent;
        double height = 0;
        std::uint64_t key = kHeightKey;
        const auto addWave = [&](const HeightWave& wave) {
          height += waveHeight(wave, hashOf(seed, key++), x, y);
        };
        if (kind == SceneKind::kTerrain) {
          for (const HeightWave& wave : kHills) addWave(wave);
        } else {
          for (const HeightWave& wave : kGentleHills) addWave(wave);
        }
        corners_.push_back(height);
      }
    }
  }

  double corner(int column, int row) const {
    return corners_[std::size_t(row) * (kPatchesPerSide + 1) + std::size_t(column)];
  }

  double height(double x, double y) const {
    const int column = std::clamp(int(x / kPatchExtent), 0, kPatchesPerSide - 1);
    const int row = std::clamp(int(y / kPatchExtent), 0, kPatchesPerSide - 1);
    const double u = x / kPatchExtent - column, v = y / kPatchExtent - row;
    return (1 - v) * ((1 - u) * corner(column, row) + u * corner(column + 1, row)) +
           v * ((1 - u) * corner(column, row + 1) + u * corner(column + 1, row + 1));
  }

 private:
  std::vector<double> corners_;
};

// Area of a bilinear surface, by the midpoints of 16 x 16 parts.
double bilinearArea(const Surface& surface) {
  constexpr int kParts = 16;
  double area = 0;
  for (int i = 0; i < kParts * kParts; ++i) {
    const double u = (i % kParts + 0.5) / kParts;
    const double v = (double(i / kParts) + 0.5) / kParts;
    const glm::dvec3 along_u = glm::dvec3(surface.edge_u) + v * glm::dvec3(surface.edge_w);
    const glm::dvec3 along_v = glm::dvec3(surface.edge_v) + u * glm::dvec3(surface.edge_w);
    area += glm::length(glm::cross(along_u, along_v));
  }
  return area / (kParts * kParts);
}

// Adds the surfaces of objects to a list. One thread at a time.
class SceneMaker {
 public:
  SceneMaker(SceneKind kind, std::uint64_t seed, std::vector<Surface>& surfaces)
      : kind_(kind), seed_(seed), ground_(kind, seed), surfaces_(surfaces) {}

  void addLot(int column, int row) {
    addGround(column, row);
    if (kind_ == SceneKind::kTerrain) return;

    // What stands here; the middle of the city is denser and higher
    RandomSequence random(seed_, kLotKey + std::uint64_t(row * kLotsPerSide + column));
    const double x = (column + 0.5) * kLotExtent, y = (row + 0.5) * kLotExtent;
    const double dx = x / kWorldExtent - 0.5, dy = y / kWorldExtent - 0.5;
    const double centrality = std::max(0.0, 1 - 2 * std::sqrt(dx * dx + dy * dy));
    const double choice = random.next();
    if (choice < 0.55 + 0.3 * centrality) {
      addBuilding(x, y, centrality, random);
    } else if (choice < 0.88) {
      addPark(x, y, random);
    } else {
      addSphereSquare(x, y, random);
    }
  }

 private:
  void addGround(int column, int row) {
    const glm::vec3 grass(0.17f, 0.26f, 0.09f);
    for (int patch_row = 0; patch_row < kPatchesPerLot; ++patch_row) {
      for (int patch_column = 0; patch_column < kPatchesPerLot; ++patch_column) {
        const int c = column * kPatchesPerLot + patch_column, r = row * kPatchesPerLot + patch_row;
        const double height = ground_.corner(c, r);
        const double rise_u = ground_.corner(c + 1, r) - height;
        const double rise_v = ground_.corner(c, r + 1) - height;
        const double twist = ground_.corner(c + 1, r + 1) - height - rise_u - rise_v;
        Surface surface;
        surface.origin = glm::vec3(c * kPatchExtent, r * kPatchExtent, height);
        surface.edge_u = glm::vec3(kPatchExtent, 0, rise_u);
        surface.edge_v = glm::vec3(0, kPatchExtent, rise_v);
        surface.edge_w = glm::vec3(0, 0, twist);
        surface.albedo = grass;
        surface.material =
            kind_ == SceneKind::kTerrain ? SurfaceMaterial::kHills : SurfaceMaterial::kStreets;
        addBilinear(surface);
      }
    }
  }

  void addBilinear(Surface surface) {
    surface.area = float(bilinearArea(surface));
    surfaces_.push_back(surface);
  }

  // Four walls and a roof; no floor. Walls face outwards.
  void addBox(const glm::vec3& corner, const glm::vec3& size, const glm::vec3& albedo,
              SurfaceMaterial wall_material, bool has_roof) {
    const glm::vec3 x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z);
    struct Wall {
      glm::vec3 origin, edge;
      float width;
    };
    const Wall walls[] = {{corner, x, size.x},
                          {corner + x, y, size.y},
                          {corner + x + y, -x, size.x},
                          {corner + y, -y, size.y}};
    constexpr float kWindowPitch = 3.2f;
    for (const Wall& wall : walls) {
      Surface surface;
      surface.origin = wall.origin;
      surface.edge_u = wall.edge;
      surface.edge_v = z;
      surface.albedo = albedo;
      surface.material = wall_material;
      surface.tiles_u = std::uint16_t(std::max(1.0f, wall.width / kWindowPitch));
      surface.tiles_v = std::uint16_t(std::max(1.0f, size.z / kWindowPitch));
      addBilinear(surface);
    }
    if (!has_roof) return;
    Surface roof;
    roof.origin = corner + z;
    roof.edge_u = x;
    roof.edge_v = y;
    roof.albedo = 0.6f * albedo + glm::vec3(0.08f);
    addBilinear(roof);
  }

  void addSphere(const glm::vec3& centre, float radius, const glm::vec3& albedo) {
    for (const float side : {1.0f, -1.0f}) {
      Surface surface;
      surface.shape = SurfaceShape::kHemisphere;
      surface.origin = centre;
      surface.edge_u = {radius, 0, 0};
      surface.edge_v = {0, side * radius, 0};
      surface.edge_w = {0, 0, side * radius};
      surface.albedo = albedo;
      surface.area = 2 * 3.14159265f * radius * radius;
      surfaces_.push_back(surface);
    }
  }

  void addTree(double x, double y, RandomSequence& random) {
    const double height = ground_.height(x, y);
    const float trunk_height = float(random.next(3, 5)), trunk_width = 0.45f;
    const float crown_radius = float(random.next(1.8, 3.4));
    addBox(glm::vec3(x - 0.5 * double(trunk_width), y - 0.5 * double(trunk_width), height - 0.3),
           {trunk_width, trunk_width, trunk_height + 0.3f}, {0.21f, 0.14f, 0.09f},
           SurfaceMaterial::kPlain, false);
    Surface crown;
    crown.shape = SurfaceShape::kCrown;
    const float crown_height = crown_radius * float(random.next(0.9, 1.5));
    crown.origin = glm::vec3(x, y, height) + glm::vec3(0, 0, trunk_height + 0.7f * crown_height);
    crown.edge_u = {crown_radius, 0, 0};
    crown.edge_v = {0, crown_radius, 0};
    crown.edge_w = {0, 0, crown_height};
    crown.albedo = glm::vec3{random.next(0.10, 0.24), random.next(0.26, 0.40), 0.07};
    crown.leaf_radius = 0.09f;
    crown.leaves = std::uint32_t(random.next(2000, 4000));
    crown.area = float(crown.leaves) * 3.14159265f * crown.leaf_radius * crown.leaf_radius;
    surfaces_.push_back(crown);
  }

  glm::vec3 wallAlbedo(RandomSequence& random) {
    constexpr float kWalls[][3] = {{0.62f, 0.58f, 0.50f}, {0.52f, 0.25f, 0.17f},
                                   {0.45f, 0.47f, 0.50f}, {0.70f, 0.66f, 0.60f},
                                   {0.58f, 0.44f, 0.28f}, {0.33f, 0.38f, 0.44f}};
    const float(&wall)[3] = kWalls[std::size_t(random.next() * double(std::size(kWalls)))];
    return glm::vec3(wall[0], wall[1], wall[2]) * float(random.next(0.85, 1.15));
  }

  void addBuilding(double x, double y, double centrality, RandomSequence& random) {
    // Down to the lowest corner of the ground
    const double width = random.next(11, 16), depth = random.next(11, 16);
    const double left = x - 0.5 * width, front = y - 0.5 * depth;
    const double base =
        std::min(std::min(ground_.height(left, front), ground_.height(left + width, front)),
                 std::min(ground_.height(left, front + depth),
                          ground_.height(left + width, front + depth))) -
        0.5;
    const double low_height = random.next(6, 18);
    const double height = low_height + 95 * centrality * centrality * random.next(0.2, 1);
    const glm::vec3 albedo = wallAlbedo(random);
    addBox(glm::vec3(left, front, base), glm::vec3(width, depth, height), albedo,
           SurfaceMaterial::kFacade, true);

    // A smaller storey, or a dome, on some roofs
    const double roof = base + height, top = random.next();
    if (top < 0.35) {
      addBox(glm::vec3(left + 0.2 * width, front + 0.25 * depth, roof),
             glm::vec3(0.6 * width, 0.5 * depth, random.next(2.5, 0.3 * height + 3)), 0.9f * albedo,
             SurfaceMaterial::kFacade, true);
    } else if (top < 0.42) {
      addSphere(glm::vec3(x, y, roof), float(0.35 * std::min(width, depth)), {0.3f, 0.52f, 0.45f});
    }

    // Trees along the street
    const int trees = int(random.next(0, 3.99));
    for (int i = 0; i < trees; ++i) addTree(x + (i - 1) * 7, y - 0.36 * kLotExtent, random);
  }

  void addPark(double x, double y, RandomSequence& random) {
    for (int i = 0; i < 9; ++i) {
      if (random.next() < 0.2) continue;
      const double tree_x = x + (i % 3 - 1) * 6 + random.next(-2, 2);
      const double tree_y = y + (double(i / 3) - 1) * 6 + random.next(-2, 2);
      addTree(tree_x, tree_y, random);
    }
  }

  void addSphereSquare(double x, double y, RandomSequence& random) {
    const double radius = random.next(2.5, 6.5);
    const glm::vec3 albedo{random.next(0.2, 0.8), random.next(0.2, 0.7), random.next(0.2, 0.7)};
    addSphere(glm::vec3(x, y, ground_.height(x, y) + 0.9 * radius), float(radius), albedo);
    for (int i = 0; i < 4; ++i) {
      addTree(x + (i % 2 == 0 ? -8 : 8), y + (i / 2 == 0 ? -8 : 8), random);
    }
  }

  SceneKind kind_;
  std::uint64_t seed_;
  Ground ground_;
  std::vector<Surface>& surfaces_;
};

// A cube of haze: along a line through it, a hundredth of the view is lost a metre.
Surface haze() {
  constexpr float kEdge = float(kWorldExtent);
  Surface surface;
  surface.shape = SurfaceShape::kHaze;
  surface.edge_u = {kEdge, 0, 0};
  surface.edge_v = {0, kEdge, 0};
  surface.edge_w = {0, 0, kEdge};
  surface.albedo = glm::vec3(0.7f, 0.72f, 0.75f);
  surface.area = 0.01f * kEdge * kEdge * kEdge;
  return surface;
}

}  // namespace

std::vector<Surface> makeSceneSurfaces(SceneKind kind, std::uint64_t seed) {
  std::vector<Surface> surfaces;
  if (kind == SceneKind::kVolume) {
    surfaces.push_back(haze());
    return surfaces;
  }
  SceneMaker maker(kind, mixBits(seed + 1), surfaces);
  for (int row = 0; row < kLotsPerSide; ++row) {
    for (int i = 0; i < kLotsPerSide; ++i) {
      maker.addLot(row % 2 == 0 ? i : kLotsPerSide - 1 - i, row);
    }
  }
  return surfaces;
}

}  // namespace surfeit
