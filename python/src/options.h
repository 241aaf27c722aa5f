// Options of calls as Python gives them, a dict of keyword arguments, into the library's structs.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/bake.h"
#include "surfeit/bounce_look.h"
#include "surfeit/camera_density.h"
#include "surfeit/engine.h"
#include "surfeit/gather.h"
#include "surfeit/job.h"
#include "surfeit/normal_estimation.h"
#include "surfeit/up_axis.h"

namespace surfeit::python {

namespace py = pybind11;

// Members are taken by name; None and absent ones leave them as they are.
class Options {
 public:
  explicit Options(const py::dict& given) : left_(py::dict(given.attr("copy")())) {}

  // The value under `name`, which is then used up; None where there is none.
  py::object take(const char* name);

  // Raises TypeError where the value is of another type.
  template <typename T>
  void into(const char* name, T& member) {
    const py::object value = take(name);
    if (value.is_none()) return;
    try {
      member = py::cast<T>(value);
    } catch (const py::cast_error&) {
      refuseType(name, value);
    }
  }

  // One of some words. Raises ValueError for another.
  template <typename T>
  void choose(const char* name, T& member, std::initializer_list<std::pair<const char*, T>> words) {
    const py::object value = take(name);
    if (value.is_none()) return;
    std::string expected;
    for (const auto& [word, choice] : words) {
      if (value.equal(py::str(word))) {
        member = choice;
        return;
      }
      expected += (expected.empty() ? "" : ", ") + std::string(word);
    }
    refuseWord(name, value, expected);
  }

  // Raises TypeError for options that nothing has taken.
  void finish() const;

 private:
  [[noreturn]] static void refuseType(const char* name, const py::object& value);
  [[noreturn]] static void refuseWord(const char* name, const py::object& value,
                                      const std::string& expected);

  py::dict left_;
};

// Three numbers.
void takeVector(Options& options, const char* name, glm::vec3& vector);
void takePlace(Options& options, const char* name, glm::dvec3& place);
void takeUp(Options& options, const char* name, std::optional<UpAxis>& up);
// memory (bytes), threads, strict, temporary_directory.
void takeJob(Options& options, JobOptions& job);
void takeColorRange(Options& options, ColorRange& range);
// channels, part, filter, color_range.
void takeReading(Options& options, ReadOptions& reading);
// quality, then what it sets and the rest of GatherQuality.
void takeQuality(Options& options, GatherQuality& quality);
// groups: "0,2-5"; names are numbers by now.
void takeGroups(Options& options, std::uint64_t& groups);
// mode, outputs, groups, gain (pairs of group and gain), eye, quality and weights.
void takeSettings(Options& options, GatherSettings& settings);
// environment_rotation, environment_intensity, environment_up.
void takePlacement(Options& options, EnvironmentPlacement& placement);
// All of a job on files; `environment` is a path.
void takeGather(Options& options, GatherOptions& gather);
// bounce_gain, bounce_saturation, bounce_tint, bounce_filter: a list of dicts.
void takeLook(Options& options, BounceLook& look);
// group_corrections: a list of dicts.
void takeGroupCorrections(Options& options, std::vector<GroupCorrection>& corrections);
// camera: a list of seven numbers each, the last NaN where `fov` counts; camera_file: a list of
// paths; pixels, max_solid_angle, stereo, size, camera_crop.
void takeDensity(Options& options, CameraDensity& density);
// toward, sensor, trajectory, thin.
void takeEstimation(Options& options, NormalEstimation& estimation);

// `environment`, an array (height, width, 3) of float32, for the engine.
struct EnvironmentArray {
  explicit EnvironmentArray(Options& options);
  const EnvironmentPixels* get() const { return pixels ? &*pixels : nullptr; }
  py::array_t<float> array;
  std::optional<EnvironmentPixels> pixels;
};

}  // namespace surfeit::python
