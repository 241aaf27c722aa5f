// Options of `surfeit sample`; those for what stands around the meshes are shared with the fidelity
// bench.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "surfeit/sample.h"
#include "tools/camera_options.h"

namespace surfeit {

// Names that lights have, by light; empty: none. In the order of Lights.
struct LightNames {
  std::vector<std::string> points, directionals, areas;
};

// Parts of what is below, for commands that take some of it: --light-*; --ground-*. With `names`,
// lights may have one before their numbers: "key=0 2 1  3 3 3".
void addLampOptions(CLI::App& app, Lights& lights, LightNames* names = nullptr);
void addGroundOptions(CLI::App& app, GroundPlane& ground);

// Adds --light-*, --ground-* and --albedo; parsing fills `surroundings`, which must outlive `app`.
// A malformed value is a usage error that names the option and what it expects.
void addSurroundingsOptions(CLI::App& app, Surroundings& surroundings);

// What `surfeit sample` works on.
struct SampleArguments {
  std::vector<std::string> meshes;
  std::string output;
  SampleOptions options;
  DensityArguments cameras;       // of the options' density
  std::uint64_t photons = 0;      // > 0: a photon map instead of surfels
  std::uint64_t photon_seed = 0;  // of PhotonTracingOptions
  std::string caustic_output;     // likewise
  bool is_dry_run = false;
};

// Adds MESH..., -o, --count, --spacing, cameras or --photons, and the options above. Parsing fills
// `arguments`, which must outlive `app`; threads are left to the program's own options.
void addSampleOptions(CLI::App& app, SampleArguments& arguments);

}  // namespace surfeit
