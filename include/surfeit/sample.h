// Step one of the memo: surfels with direct light, or a photon map, from triangle meshes (memo
// 08-01, section 3.1); and the rays that a raster cube is held to. Needs the component `sample`,
// which links Embree (docs/engine.md).
//
// Meshes are PLY files, OBJ files with their MTL, or hair (.hair, of cyHair; curves of Houdini in
// .bgeo); several are taken as one. Lengths are scene units. Exitance and irradiance are in W/m2,
// radiance in W/(m2 sr), all scene-linear rgb. Calls are independent, so threads may call at once;
// each uses the threads that it is given. Meshes are held whole, some 100 bytes a triangle: nothing
// but limitProcess (surfeit/process.h) bounds that.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/camera_density.h"
#include "surfeit/cube.h"
#include "surfeit/forecast.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// A light at one place.
struct PointLight {
  glm::dvec3 position{0};
  glm::vec3 intensity{0};  // W/sr: E = I cos / d^2
};

// Light from infinitely far away.
struct DirectionalLight {
  glm::vec3 direction{0, -1, 0};  // in which the light travels; any length but zero
  glm::vec3 irradiance{0};        // on a surface that faces it
};

// A rectangle with corners centre +- u +- v that emits on the side of u x v. It is no geometry:
// it neither casts shadows nor is seen.
struct AreaLight {
  glm::dvec3 centre{0};
  glm::vec3 u{0}, v{0};
  glm::vec3 radiance{0};
};

struct Lights {
  std::vector<PointLight> points;
  std::vector<DirectionalLight> directionals;
  std::vector<AreaLight> areas;
  // Light of points and rectangles falls off with distance d as 1 / d^falloff, 0 to 8: E = I cos /
  // d^2 * (d / falloff_distance)^(2 - falloff). 2 is physical; emissive triangles always have it.
  float falloff = 2;
  double falloff_distance = 1;  // scene units, above 0: there all falloffs give the same light
  // Shadow rays per area light, and as many for all emissive triangles together.
  int samples = 16;
  // Do emissive surfaces carry their own emission as radiosity? They light the others either way; a
  // gather from surfels that carry it too would count that light twice.
  bool with_emission = false;

  bool isEmpty() const { return points.empty() && directionals.empty() && areas.empty(); }
};

// A square on the ground below everything else.
struct GroundPlane {
  bool enabled = false;
  UpAxis up = kDefaultUpAxis;
  float size = 2;  // edge length over the diagonal of the bounds
  glm::vec3 albedo{0.5f};
};

// How hair (.hair) and the lines of OBJ files become ribbons with two sides.
struct CurveOptions {
  // Above 0: the diameter of all strands, scene units. 0: that of the file; lines of OBJ files,
  // which have none, are then left out.
  double width = 0;
  // Above 0: of each file no more than so many strands, all wider by as much as keeps the sum of
  // length times width. One is chosen of each run of neighbours in the file.
  std::uint64_t strands = 0;
};

// What stands around the meshes, and how they are read; the sampler and the reference share it.
struct Surroundings {
  glm::vec3 default_albedo{0.5f};  // of meshes without colors and materials
  GroundPlane ground;
  Lights lights;
  CurveOptions curves{};
};

// How surfels get object groups with names (surfeit/group_names.h).
enum class SampleGroups : std::uint8_t {
  kNone,      // the cloud has no groups
  kFile,      // by the file that they come from, without folder and ending
  kObject,    // by the object or group (o, g) of OBJ; other meshes by file
  kMaterial,  // by the material (usemtl) of OBJ
};

struct SampleOptions {
  Surroundings surroundings;
  // Names get the groups 1, 2, ... in the order in which they come; equal names are one group, what
  // has no name is in group 0. At most kMaxGroups - 1 names. Comments of the cloud keep them
  // (docs/files.md), and index gives them to the scene.
  SampleGroups groups = SampleGroups::kNone;
  std::uint64_t count = 1'000'000;  // surfels, in proportion to area; slivers add a few
  double spacing = 0;               // > 0: one surfel per spacing^2 instead of a count
  // With cameras: surfels as large as these ask for, instead of a count or a spacing. Triangles
  // smaller than a surfel are left out by their numbers, and others get their areas: areas add up
  // in the mean. A camera that moves changes few surfels.
  CameraDensity density;
  bool is_two_sided = false;  // both sides send and block light, and pieces have longer sides
  int threads = 0;            // 0: all that the job may use
};

struct SampleStats {
  std::uint64_t triangles = 0;
  std::uint64_t degenerate_faces = 0;
  std::uint64_t surfels = 0;          // written
  std::uint64_t sliver_surfels = 0;   // beyond the count asked for, from cutting slivers
  std::uint64_t clear_surfels = 0;    // not written: nothing of them is there (d, Tr, map_d)
  double area = 0;                    // of the meshes
  double surfel_area = 0;             // of the surfels
  double disk_area = 0;               // sum of pi r^2: over `area`, how often disks overlap
  double spacing = 0;                 // root of the area per surfel
  std::uint64_t temporary_bytes = 0;  // of surfels that waited for the end (LAS, PDB)
  double load_seconds = 0, build_seconds = 0, sample_seconds = 0;
  int threads = 0;
};

// Writes a cloud of the format that its name tells, with normals, radii, areas, albedo, when
// anything emits, radiosity, and of two-sided meshes two_sided and longer sides. The cloud depends
// on meshes and options alone, not on the threads. Memory: the meshes, Embree's hierarchy (less
// than 100 bytes per triangle) and a few batches of surfels, whatever the count. Errors: kIoError,
// kCorruption (bad mesh), kInvalidArgument (options), kInterrupted, kFailed.
SURFEIT_API Result<SampleStats> sampleMeshes(const std::vector<std::string>& meshes,
                                             const std::string& output,
                                             const SampleOptions& options, Progress& progress);

// What sampleMeshes takes, by some of the surfels: of records, surfels. The meshes are loaded, and
// their hierarchy is built. Writes nothing but in a temporary folder. Errors: as sampleMeshes.
SURFEIT_API Result<SampleForecast> forecastSample(const std::vector<std::string>& meshes,
                                                  const std::string& output,
                                                  const SampleOptions& options, Progress& progress);

struct PhotonTracingOptions {
  Surroundings surroundings;
  std::uint64_t photons = 1'000'000;  // sent from all lights together, at least 1
  std::uint64_t seed = 0;             // another seed, other photons of the same light
  // Where photons go that come from a light over mirrors or through glass alone; they are then not
  // in the photon map, and both together are all light. Empty: all are in the photon map.
  std::string caustic_output;
  int threads = 0;  // 0: all that the job may use
};

struct PhotonTracingStats {
  std::uint64_t triangles = 0;
  std::uint64_t degenerate_faces = 0;
  std::uint64_t emitted = 0;
  // One per surface that a photon meets, and two per translucent surface, for its two sides.
  std::uint64_t stored = 0;
  std::uint64_t caustic = 0;          // stored in the map of caustics
  std::uint64_t escaped = 0;          // photons that left the scene in the end
  std::uint64_t lost_at_backs = 0;    // photons that met the back of a surface, which is black
  glm::dvec3 emitted_power{0};        // of all lights
  glm::dvec3 stored_power{0};         // arrives at surfaces, those of later bounces included
  glm::dvec3 caustic_power{0};        // the same of the map of caustics
  std::uint64_t temporary_bytes = 0;  // of photons that waited for the end (LAS, PDB)
  double load_seconds = 0, build_seconds = 0, trace_seconds = 0;
  int threads = 0;
};

// Photon maps: photons sent from the lights and scattered through the meshes, stored wherever they
// meet a diffuse surface (Jensen 1996; app note 6.1). surfeit/radiance.h makes surfels of them.
//
// Writes a photon cloud of the format that the name of the output tells: position, normal of the
// surface, power before reflection, direction that the photon came from, albedo; floats, by the
// names of docs/photons.md. Lights get photons in proportion to power; directional ones fill a disk
// that covers the scene. Russian roulette ends the paths, so that powers stay as large as albedos
// are alike, and no bounce is left out. Materials of MTL that mirror, refract or let light through
// scatter photons that way (docs/photons.md, "Materials"). The cloud depends on meshes,
// surroundings, number and seed alone, not on the threads. Memory: the meshes, Embree's hierarchy
// and a few batches of photons, whatever their number. Errors: as sampleMeshes; kInvalidArgument
// when nothing emits.
SURFEIT_API Result<PhotonTracingStats> tracePhotons(const std::vector<std::string>& meshes,
                                                    const std::string& output,
                                                    const PhotonTracingOptions& options,
                                                    Progress& progress);

// What tracePhotons takes, by some of the photons: of records, photons that are sent. The output
// has the bytes of both maps together. As forecastSample.
SURFEIT_API Result<SampleForecast> forecastPhotons(const std::vector<std::string>& meshes,
                                                   const std::string& output,
                                                   const PhotonTracingOptions& options,
                                                   Progress& progress);

struct TracedCubeOptions {
  int rays = 8;  // along an edge of a pixel, at least 1
  // Surfaces that rays pass through are those whose surfels do not cover.
  GatherSides sides = GatherSides::kFront;
  float max_distance = 1e30f;  // scene units
  int threads = 0;             // that build the hierarchy; 0: all that the job may use
};

// The raster cube of a receiver traced on the true triangles, which are what the gathered `cube` is
// held to. The same receiver, faces and pixels as `cube`, with coverage and depth of rays in a grid
// over each pixel; there is no light, and one layer. Rays begin 1/10000 of the mesh's diagonal
// above the receiver, and those below its horizon do not count; a pixel without others sees
// nothing. depth is that of the nearest hit, occlusion that of the pixels by their weights. Errors:
// as sampleMeshes.
SURFEIT_API Result<CubeImage> traceCube(const CubeImage& cube,
                                        const std::vector<std::string>& meshes,
                                        const TracedCubeOptions& options, Progress& progress);

}  // namespace surfeit
