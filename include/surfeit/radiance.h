// Computes the radiosity at the photons of a photon map, from the density of their neighbours:
// surfels for final gathering (memo 08-01, section 7.2; app note 6.2).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// `memory_bytes`: at least 64 MiB.
struct RadianceOptions : JobOptions, ReadOptions {
  // Photons per estimate, 1 to 10000: the photon itself and its nearest neighbours. More photons
  // give less noise and more blur (app note 6.3).
  std::uint32_t photons_per_estimate = 100;
  // Photons farther away do not count, scene units. 0: 16 times the median radius of an estimate.
  float max_radius = 0;
  glm::vec3 default_albedo{0.5f};  // reflectance of photons without albedo, 0 to 1
  // Disk area over surfel area, 1 to 16. Photons lie at random, so their disks must overlap more
  // than disks cut from a mesh to leave no gaps: e^-overlap of the surface stays uncovered.
  float disk_overlap = 7;
};

struct RadianceStats {
  std::uint64_t photons = 0;  // records of the inputs
  std::uint64_t skipped_photons = 0;
  std::uint64_t surfels = 0;          // written
  std::uint64_t sparse_surfels = 0;   // surfels with too few photons within the max radius
  std::uint64_t bounded_surfels = 0;  // of these, with a disk that photons of other surfaces bound
  double area = 0;                    // sum of the surfel areas: about the area of lit surfaces
  glm::dvec3 power{0};                // of all photons: arrives at the surfaces
  glm::dvec3 reflected_power{0};      // sum of radiosity times area: leaves the surfaces
  double mean_radius = 0;             // of the estimates
  double max_radius = 0;              // as given or found
  std::uint64_t temporary_bytes = 0;  // most bytes of temporary files at any time
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::vector<std::pair<std::string, double>> phase_seconds;
};

// Writes a cloud of surfels with normal, radius, area, radiosity and albedo from the photons of all
// inputs (docs/photons.md has the properties), ordered along the Hilbert curve. The name of
// `result_path` tells the format. The radiosity is the reflected light, without emission. The
// result depends only on the photons and on the members of RadianceOptions itself, bit for bit, and
// not on the order of the photons. Errors: as indexClouds; kCorruption, before work starts, when an
// input has no photons, no normals or no powers.
SURFEIT_API Result<RadianceStats> radianceCloud(const std::vector<std::string>& photon_paths,
                                                const std::string& result_path,
                                                const RadianceOptions& options, Progress& progress);

}  // namespace surfeit
