// Geometry of the scenes that the gather benches share, as triangles and spheres, and its surfels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "sample/meshes/mesh.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct TrueSphere {
  glm::vec3 centre{0};
  float radius = 0;
  std::uint32_t material = 0;  // of SceneGeometry::mesh
};

// What rays are traced against, and what surfels are made from. The truth is the spheres and the
// first `exact_triangles` triangles; the rest of the triangles are the spheres once more,
// tessellated, for ray tracers of triangles.
struct SceneGeometry {
  Mesh mesh;  // positions and triangles, counter-clockwise seen from the front
  std::vector<TrueSphere> spheres;
  std::size_t exact_triangles = 0;
  bool is_two_sided = false;   // both sides cover and send light; else the front alone
  float ray_offset = 0;        // how far above its receiver a ray begins, scene units
  float color_wavelength = 0;  // of the radiosity, scene units; 0: materials' emission
  std::uint64_t surfels = 0;   // default
};

// Numbers by chance, the same on every machine.
class SceneRandom {
 public:
  explicit SceneRandom(std::uint64_t seed) : engine_(seed) {}
  double next() { return double(engine_() >> 11) * 0x1p-53; }  // in [0, 1)
  double next(double begin, double end) { return begin + (end - begin) * next(); }
  glm::vec3 nextColor() {
    const double red = next(), green = next(), blue = next();
    return {red, green, blue};
  }

 private:
  std::mt19937_64 engine_;
};

// The radiosity of a place on the geometry: the emission of its material, or where a wavelength is
// given, three waves along the axes. Nothing is lit and nothing casts shadows, so that errors of
// colour are those of the gather and not of edges that no surfel can have.
glm::vec3 radiosityAt(const SceneGeometry& geometry, std::uint32_t material,
                      const glm::vec3& position);

// Takes surfels as they are made; stops at the first error.
using SurfelSink = std::function<Status(std::span<const Surfel>)>;

// A 10 x 10 ground of tiles and 500 spheres that do not overlap, 150 on the ground and 350 up to a
// height of 4, each tile and sphere of a random colour. Surfels are uniform by area: a jittered
// hexagonal lattice on the ground, Fibonacci lattices on the spheres, disks of twice their area.
SceneGeometry makeSpheres();
Status sendSpheresSurfels(const SceneGeometry& geometry, std::uint64_t count,
                          const SurfelSink& sink);

// The generated city (surfels/generated/scene_surfaces.h) without its trees, whose leaves are disks
// themselves and have no triangles: ground, buildings, domes and spheres. Surfels are those of the
// generator.
SceneGeometry makeCity();
Status sendCitySurfels(const SceneGeometry& geometry, std::uint64_t count, const SurfelSink& sink);

// A 10 x 10 ground with 40 crowns of trees over it, balls of two-sided leaves that face anywhere:
// 64,000 or so, each of about .065 by .037. Surfels are those of the sampler of meshes.
SceneGeometry makeLeaves();

// Scenes that no number of the gather was chosen by.
bool isUnseenScene(const std::string& name);
SceneGeometry makeUnseenScene(const std::string& name);

// Bunny and lion on a ground, Sponza, hair; unseen ones, too: from files in `data`. kIoError where
// one is missing.
bool isMeshScene(const std::string& name);
std::string meshSceneFile(const std::string& name, const std::string& data);
Result<SceneGeometry> loadMeshScene(const std::string& name, const std::string& data,
                                    Progress& progress);
// Through the sampler of meshes, by files whose names begin with `path`. Slivers give more surfels
// than asked for.
Status sendMeshSurfels(const SceneGeometry& geometry, std::uint64_t count, const std::string& path,
                       int threads, const SurfelSink& sink);

// Appends a sphere of 2 n^2 triangles or so, each pair about as high as wide at its equator.
void appendSphere(const TrueSphere& sphere, int around, Mesh& mesh);
// Appends `columns` by `rows` cells of two triangles, corners given by corner(u, v) with u and v in
// 0..1; the front is where u turns to v counter-clockwise.
void appendGrid(int columns, int rows, const std::function<glm::vec3(double, double)>& corner,
                std::uint32_t material, Mesh& mesh);

}  // namespace surfeit
