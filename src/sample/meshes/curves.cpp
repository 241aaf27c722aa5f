#include "sample/meshes/curves.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "core/resident_limit.h"
#include "core/split_mix.h"

namespace surfeit {
namespace {

constexpr double kRibbonWidth = std::numbers::pi / 2;  // over that of a round strand

bool isFinite(const CurvePoint& point) {
  const glm::dvec3 sum = point.position + double(point.width) * glm::dvec3(1);
  return std::isfinite(sum.x) && std::isfinite(sum.y) && std::isfinite(sum.z);
}

Status checkPoints(const std::string& path, std::uint64_t strand,
                   std::span<const CurvePoint> points) {
  for (const CurvePoint& point : points) {
    if (isFinite(point) && point.width >= 0) continue;
    return Status::corruption(fmt::format(
        "{}: strand {}: found a point ({}, {}, {}) of width {:g}, expected {}", path, strand,
        point.position.x, point.position.y, point.position.z, point.width,
        isFinite(point) ? "a width of 0 or more (--curve-width gives one)" : "finite values"));
  }
  return {};
}

// A unit vector across a unit vector, at that angle about it.
glm::dvec3 acrossAt(const glm::dvec3& along, double angle) {
  const glm::dvec3 axis = std::abs(along.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(along, axis)), v = glm::cross(along, u);
  return std::cos(angle) * u + std::sin(angle) * v;
}

// The vector after the turn that brings one unit vector to the other by the shortest way (Wang et
// al. 2008 call repeated use of it a rotation minimizing frame).
glm::dvec3 turned(const glm::dvec3& vector, const glm::dvec3& from, const glm::dvec3& to) {
  const glm::dvec3 rest = vector - glm::dot(vector, to) * to;
  const glm::dvec3 axis = glm::cross(from, to);
  const double cosine = glm::dot(from, to);
  if (cosine < -0.999) return glm::length(rest) > 1e-6 ? glm::normalize(rest) : acrossAt(to, 0);
  return glm::normalize(cosine * vector + glm::cross(axis, vector) +
                        glm::dot(axis, vector) / (1 + cosine) * axis);
}

}  // namespace

double curveArea(std::span<const CurvePoint> points) {
  double area = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    area += 0.5 * (points[i - 1].width + points[i].width) *
            glm::distance(points[i - 1].position, points[i].position);
  }
  return area;
}

StrandChoice::StrandChoice(std::uint64_t count, std::uint64_t kept)
    : count_(count), kept_(kept == 0 || kept > count ? count : kept) {}

bool StrandChoice::keeps(std::uint64_t strand) const {
  if (keepsAll()) return true;
  // Run r holds the strands from ceil(r count / kept) on; both numbers are below 2^32
  const std::uint64_t run = strand * kept_ / count_;
  const auto begin = [&](std::uint64_t r) { return (r * count_ + kept_ - 1) / kept_; };
  const std::uint64_t first = begin(run), end = begin(run + 1);
  return strand == first + splitMix(run) % (end - first);
}

Status CurveRibbons::add(std::span<const CurvePoint> points, std::uint64_t strand, double growth) {
  points_.clear();
  SURFEIT_RETURN_IF_ERROR(checkPoints(path_, strand, points));
  for (const CurvePoint& point : points) {
    if (points_.empty() || points_.back().position != point.position) points_.push_back(point);
  }
  if (points_.size() < 2) {
    ++pointlike_;
    return {};
  }

  Mesh& mesh = builder_.mesh;
  const auto directionFrom = [&](std::size_t i) {
    return glm::normalize(points_[i + 1].position - points_[i].position);
  };
  const double angle = 2 * std::numbers::pi * std::ldexp(double(splitMix(strand) >> 11), -53);
  glm::dvec3 along = directionFrom(0), side = acrossAt(along, angle);
  const std::uint64_t first = builder_.position.size();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    // Corners stand across the mean of both directions
    glm::dvec3 at_corner = side;
    if (i > 0 && i + 1 < points_.size()) {
      const glm::dvec3 next = directionFrom(i);
      const glm::dvec3 next_side = turned(side, along, next);
      const glm::dvec3 sum = side + next_side;
      if (glm::length(sum) > 1e-6) at_corner = glm::normalize(sum);
      along = next;
      side = next_side;
    }
    const double half = 0.5 * kRibbonWidth * growth * points_[i].width;
    builder_.position.push_back(points_[i].position - half * at_corner);
    builder_.position.push_back(points_[i].position + half * at_corner);
    if (has_colors_) mesh.color.insert(mesh.color.end(), 2, points_[i].color);
  }
  for (std::uint64_t corner = first; corner + 3 < builder_.position.size(); corner += 2) {
    const std::array<std::uint64_t, 4> quad{corner, corner + 1, corner + 3, corner + 2};
    SURFEIT_RETURN_IF_ERROR(builder_.addFace(quad, material_, 0, path_, strand));
  }
  return {};
}

Status addStrands(const std::string& path, std::uint64_t count, const CurveOptions& options,
                  const std::function<Status(const StrandVisit& visit)>& for_each,
                  MeshBuilder& builder, Progress& progress) {
  const StrandChoice choice(count, options.strands);

  // Growth of the strands that stand for others, so that the sum of areas stays; this looks at all
  double growth = 1, area = 0, kept_area = 0;
  const auto measure = [&](std::uint64_t strand, std::span<const CurvePoint> points) -> Status {
    SURFEIT_RETURN_IF_ERROR(checkPoints(path, strand, points));
    const double own = curveArea(points);
    area += own;
    if (choice.keeps(strand)) kept_area += own;
    return {};
  };
  SURFEIT_RETURN_IF_ERROR(for_each(measure));
  if (!(area > 0) || !std::isfinite(area)) {
    return Status::corruption(fmt::format(
        "{}: found strands of an area of {:g}, expected a finite one above 0: a thickness "
        "(--curve-width gives one)",
        path, area));
  }
  if (!choice.keepsAll()) {
    if (!(kept_area > 0)) {
      return Status::corruption(fmt::format("{}: none of {} strands kept has a length: keep more",
                                            path, choice.keptCount()));
    }
    growth = area / kept_area;
    progress.inform(fmt::format("{}: {} of {} strands stand for all, {:.3g} times as wide", path,
                                choice.keptCount(), count, growth));
  }

  Mesh& mesh = builder.mesh;
  mesh.color.resize(builder.position.size(), glm::vec3(1));
  Material material;
  material.albedo = glm::vec3(1);  // times the color of its points
  material.is_two_sided = true;
  mesh.materials.push_back(material);
  CurveRibbons ribbons(builder, std::uint32_t(mesh.materials.size() - 1), true, path);
  const auto add = [&](std::uint64_t strand, std::span<const CurvePoint> points) -> Status {
    if (!choice.keeps(strand)) return {};
    if (strand % 4096 == 0) {
      const double part = double(strand + 1) / double(count);
      SURFEIT_RETURN_IF_ERROR(checkResidentBytes(path, 0, part, kHeldTimes));
    }
    return ribbons.add(points, strand, growth);
  };
  SURFEIT_RETURN_IF_ERROR(for_each(add));
  if (ribbons.pointlike() > 0) {
    progress.note(fmt::format("{}: {} strands without length skipped", path, ribbons.pointlike()));
  }
  return {};
}

}  // namespace surfeit
