// Cameras that decide how densely surfels lie (course notes 2010, "Point Generation"). Surfels in
// view are as large as pixels, by solid angle: which way a surface faces does not matter. What is
// out of view is as much coarser as the cut of a gather would take it together: seen from the
// nearest place in view, a surfel has the largest solid angle of a node. Nothing is left out
// because something hides it or no light reaches it. sampleMeshes (surfeit/sample.h) cuts meshes
// that way, convertClouds (surfeit/convert.h) thins clouds that way.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/status.h"

namespace surfeit {

// A camera in perspective, in scene units. Its view is a pyramid without end.
struct DensityCamera {
  glm::dvec3 eye{0};
  glm::dvec3 look_at{0};         // not the eye
  std::optional<glm::dvec3> up;  // absent: the up axis of the scene
  double fov_degrees = 35;       // vertical field of view, 1..170
};

// Pixels x0 <= x < x1, y0 <= y < y1 of a picture; the first row is at the top.
struct PixelWindow {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  bool isEmpty() const { return x0 >= x1 || y0 >= y1; }
};

// Plain data. Where several cameras look at a place, the one that asks for the smallest surfels
// decides.
struct CameraDensity {
  std::vector<DensityCamera> cameras;  // empty: no density by cameras
  int width = 1280, height = 960;      // pixels of all cameras
  // In view is this part of the pictures alone, which lies in them; absent: all of them.
  std::optional<PixelWindow> crop;
  // Edge of a surfel in view, in pixels: its solid angle is that many times that many pixels of the
  // middle of the picture. 0.01 to 10,000; 1 to 1.5 is usual (1.5 gives half as many surfels).
  double pixels = 1;
  // Largest solid angle of a surfel out of view from the nearest place in view, steradians, above 0
  // and at most 1. GatherQuality::max_solid_angle is the same measure of nodes.
  double max_solid_angle = 0.03;
  // Above 0: every camera is two eyes, that far apart along its horizontal, which look in parallel;
  // scene units.
  double stereo = 0;
};

// Cameras of a text: a camera a line, "eye look-at", six numbers, or seven with the field of view
// in degrees; spaces or commas between them. Blank lines and lines that begin with # are skipped.
// `fov_degrees` is for lines with six numbers. At most 100,000 cameras. Errors: kIoError;
// kCorruption, naming file and line.
SURFEIT_API Result<std::vector<DensityCamera>> readDensityCameras(const std::string& path,
                                                                  double fov_degrees);

}  // namespace surfeit
