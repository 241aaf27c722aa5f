#include "tools/sample_options.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tools/channel_options.h"
#include "tools/number_checks.h"
#include "tools/number_list.h"

namespace surfeit {
namespace {

template <std::size_t N>
glm::vec3 vectorAt(const std::array<double, N>& numbers, std::size_t i) {
  return {float(numbers[i]), float(numbers[i + 1]), float(numbers[i + 2])};
}

template <std::size_t N>
glm::dvec3 placeAt(const std::array<double, N>& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

// Light cannot be taken away, and a surface reflects no more than it gets.
glm::vec3 colorAt(const std::string& option, const glm::vec3& color, float max) {
  for (int i = 0; i < 3; ++i) {
    if (color[i] >= 0 && color[i] <= max) continue;
    throw CLI::ValidationError(
        option, fmt::format("color {} {} {}: expected values {}", color.x, color.y, color.z,
                            max == 1 ? "from 0 to 1" : "of 0 or more"));
  }
  return color;
}

// A light option that may be given several times; each value has N numbers.
// `names`: of these lights, where they may have some; else null.
template <std::size_t N, typename Add>
void addLightOption(CLI::App& app, const std::string& name, const std::string& expected,
                    const std::string& description, std::vector<std::string>* names, Add add) {
  const auto parse = [name, expected, names, add](const std::vector<std::string>& values) {
    for (const std::string& value : values) {
      const std::size_t equals = names != nullptr ? value.find('=') : value.npos;
      const std::string numbers = equals == value.npos ? value : value.substr(equals + 1);
      add(parseNumberList<N>(name, numbers, "\"" + expected + "\""));
      if (names == nullptr) continue;
      names->push_back(equals == value.npos ? std::string() : value.substr(0, equals));
    }
    return true;
  };
  app.add_option(name, parse, description)
      ->type_name("\"" + expected + "\"")
      ->type_size(1)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group("Light");
}

constexpr float kNoLimit = 3e38f;

// Parses a reflectance into `target`.
std::function<void(const std::string&)> reflectance(const std::string& name, glm::vec3& target) {
  return [name, &target](const std::string& value) {
    target = colorAt(name, vectorAt(parseNumberList<3>(name, value, "\"r g b\""), 0), 1);
  };
}

void addFalloffOptions(CLI::App& app, Lights& lights) {
  app.add_option("--falloff", lights.falloff,
                 "Light of points and rectangles falls off as 1 / distance ^ FALLOFF: 2 is "
                 "physical, 1 reaches farther, 0 does not fall off")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 8.0))
      ->group("Light");
  app.add_option("--falloff-distance", lights.falloff_distance,
                 "Distance at which all falloffs give the same light, scene units")
      ->capture_default_str()
      ->check(kPositiveNumber)
      ->group("Light");
}

}  // namespace

void addLampOptions(CLI::App& app, Lights& lights, LightNames* names) {
  addLightOption<6>(
      app, "--light-point", "x y z r g b", "Point light: position, intensity in W/sr; repeatable",
      names != nullptr ? &names->points : nullptr, [&lights](const std::array<double, 6>& n) {
        lights.points.push_back({placeAt(n), colorAt("--light-point", vectorAt(n, 3), kNoLimit)});
      });
  addLightOption<6>(
      app, "--light-directional", "dx dy dz r g b",
      "Directional light: direction it travels in, irradiance facing it; repeatable",
      names != nullptr ? &names->directionals : nullptr, [&lights](const std::array<double, 6>& n) {
        lights.directionals.push_back(
            {vectorAt(n, 0), colorAt("--light-directional", vectorAt(n, 3), kNoLimit)});
      });
  addLightOption<12>(
      app, "--light-area", "cx cy cz ux uy uz vx vy vz r g b",
      "Rectangle light: centre, half edges u and v, radiance; emits towards u x v; repeatable",
      names != nullptr ? &names->areas : nullptr, [&lights](const std::array<double, 12>& n) {
        lights.areas.push_back({placeAt(n), vectorAt(n, 3), vectorAt(n, 6),
                                colorAt("--light-area", vectorAt(n, 9), kNoLimit)});
      });
  app.add_option("--light-samples", lights.samples,
                 "Shadow rays per rectangle light, and for all emissive triangles")
      ->capture_default_str()
      ->check(CLI::Range(1, 65536))
      ->group("Light");
  addFalloffOptions(app, lights);
}

void addGroundOptions(CLI::App& app, GroundPlane& ground) {
  app.add_flag("--ground-plane", ground.enabled, "Add a square below the meshes")->group("Ground");
  app.add_option("--ground-size", ground.size,
                 "Edge of the ground, as a multiple of the scene's diagonal")
      ->capture_default_str()
      ->check(kPositiveNumber)
      ->group("Ground");
  app.add_option_function<std::string>("--ground-albedo",
                                       reflectance("--ground-albedo", ground.albedo),
                                       "Reflectance of the ground [\"0.5 0.5 0.5\"]")
      ->type_name("\"r g b\"")
      ->group("Ground");
}

void addSurroundingsOptions(CLI::App& app, Surroundings& surroundings) {
  addLampOptions(app, surroundings.lights);
  app.add_flag("--emission", surroundings.lights.with_emission,
               "Surfels of emissive surfaces carry the emission, too; a gather then counts their "
               "light twice, because it is already in the direct light of other surfels")
      ->group("Light");

  app.add_option_function<std::string>("--albedo",
                                       reflectance("--albedo", surroundings.default_albedo),
                                       "Reflectance of meshes without colors and materials "
                                       "[\"0.5 0.5 0.5\"]")
      ->type_name("\"r g b\"");

  CurveOptions& curves = surroundings.curves;
  app.add_option(
         "--curve-width", curves.width,
         "Diameter of hair (.hair), curves (.bgeo) and the lines of OBJ files, scene units; "
         "without it that of the file, and lines of OBJ files are left out")
      ->type_name("W")
      ->check(kPositiveNumber.description(""))
      ->group("Hair and curves");
  app.add_option("--strands", curves.strands,
                 "At most so many strands of each file, wider by as much as keeps their total area")
      ->type_name("N")
      ->check(kPositiveNumber.description(""))
      ->group("Hair and curves");

  addGroundOptions(app, surroundings.ground);
  GroundPlane& ground = surroundings.ground;
  app.add_option_function<std::string>(
         "--up", [&ground](const std::string& axis) { ground.up = UpAxis(axis[0] - 'x'); },
         "Axis that points up: x, y or z; the cloud states it [y]")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->type_name("AXIS");
}

void addSampleOptions(CLI::App& app, SampleArguments& arguments) {
  app.add_option(
         "MESH", arguments.meshes,
         "Triangle meshes: PLY, or OBJ with MTL; hair: .hair (cyHair), curves of Houdini (.bgeo)")
      ->required();
  addCloudOutputOption(app, arguments.output, "Cloud to write");
  CLI::Option* const count =
      app.add_option("--count", arguments.options.count,
                     "Number of surfels, such as 500k, distributed by area; long thin triangles "
                     "add some")
          ->capture_default_str()
          ->transform(kUnitCount);
  CLI::Option* const spacing =
      app.add_option("--spacing", arguments.options.spacing,
                     "Distance between surfels in scene units, instead of a count")
          ->check(kPositiveNumber)
          ->excludes(count);
  const std::vector<CLI::Option*> cameras = addDensityOptions(app, arguments.cameras);
  addCameraCropOption(app, arguments.cameras);
  for (CLI::Option* const camera : cameras) camera->excludes(count)->excludes(spacing);
  CLI::Option* const photons =
      app.add_option("--photons", arguments.photons,
                     "Instead of surfels, trace this many photons from the lights and write where "
                     "they arrive, for surfeit radiance")
          ->transform(kUnitCount)
          ->excludes(count)
          ->excludes(spacing);
  for (CLI::Option* const camera : cameras) camera->excludes(photons);
  app.add_option_function<std::string>(
         "--group-by",
         [&arguments](const std::string& word) {
           arguments.options.groups = word == "file"     ? SampleGroups::kFile
                                      : word == "object" ? SampleGroups::kObject
                                                         : SampleGroups::kMaterial;
         },
         "Object groups with names, for --subset NAME: by file, by object or group of OBJ (o, g), "
         "or by material (usemtl); other meshes by file")
      ->type_name("file|object|material")
      ->check(CLI::IsMember({"file", "object", "material"}).description(""))
      ->excludes(photons);
  app.add_flag("--two-sided", arguments.options.is_two_sided,
               "Both sides of the meshes send and block light: leaves, cloth, hair")
      ->excludes(photons);
  app.add_option("--seed", arguments.photon_seed,
                 "Seed of the photons: another seed gives other photons of the same lights")
      ->needs(photons);
  app.add_option("--caustic-photons", arguments.caustic_output,
                 "Photons that come from a light over mirrors or through glass alone go to this "
                 "cloud instead: the map of caustics")
      ->type_name("FILE")
      ->needs(photons);
  addSurroundingsOptions(app, arguments.options.surroundings);
}

}  // namespace surfeit
