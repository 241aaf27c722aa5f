#include "batch/bounce_look.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <string>

#include "core/luminance.h"
#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

constexpr float kMostFactor = 1e6f;
constexpr std::size_t kMostFilters = 1000;
// Angles that are pi as a float may lie above it.
constexpr float kMostAngle = kPi + 1e-3f;

Status checkFactor(const std::string& of, const char* what, float found) {
  if (found >= 0 && found <= kMostFactor) return {};  // no NaN does
  return Status::invalidArgument(
      fmt::format("{}: {} is {}, expected 0 to {:g}", of, what, found, kMostFactor));
}

Status checkCorrection(const std::string& of, const ColorCorrection& correction) {
  SURFEIT_RETURN_IF_ERROR(checkFactor(of, "gain", correction.gain));
  SURFEIT_RETURN_IF_ERROR(checkFactor(of, "saturation", correction.saturation));
  SURFEIT_RETURN_IF_ERROR(checkFactor(of, "tint, red", correction.tint.r));
  SURFEIT_RETURN_IF_ERROR(checkFactor(of, "tint, green", correction.tint.g));
  return checkFactor(of, "tint, blue", correction.tint.b);
}

Status checkFilter(const std::string& of, const BounceFilter& filter) {
  SURFEIT_RETURN_IF_ERROR(checkCorrection(of, filter.correction));
  const auto refuse = [&of](const std::string& what) {
    return Status::invalidArgument(fmt::format("{}: {}", of, what));
  };
  // A sum is finite only when all its terms are
  if (!std::isfinite(filter.centre.x + filter.centre.y + filter.centre.z)) {
    return refuse("the centre is not finite");
  }
  const float direction = filter.direction.x + filter.direction.y + filter.direction.z;
  if (!std::isfinite(direction)) return refuse("the direction is not finite");
  if (!(filter.inner_radius >= 0 && filter.outer_radius >= filter.inner_radius)) {
    return refuse(fmt::format("radii are {} and {}, expected 0 or more, the outer one not smaller",
                              filter.inner_radius, filter.outer_radius));
  }
  // From an infinite inner radius nothing falls; to an infinite outer one nothing would ever
  if (std::isinf(filter.outer_radius) && !std::isinf(filter.inner_radius)) {
    return refuse("the outer radius is infinite and the inner one is not");
  }
  if (!(filter.inner_angle >= 0 && filter.outer_angle >= filter.inner_angle &&
        filter.outer_angle <= kMostAngle)) {
    return refuse(
        fmt::format("angles are {} and {} radians, expected 0 to pi, the outer one not smaller",
                    filter.inner_angle, filter.outer_angle));
  }
  return {};
}

// 1 up to `inner`, 0 from `outer` on.
float fall(float x, float inner, float outer) {
  if (!(x > inner)) return 1;
  if (!(x < outer)) return 0;
  const float t = (outer - x) / (outer - inner);
  return t * t * (3 - 2 * t);
}

float angleWeight(const BounceFilter& filter, const glm::vec3& normal) {
  const float cosine =
      glm::dot(normal, filter.direction) / (glm::length(normal) * glm::length(filter.direction));
  return fall(std::acos(std::clamp(cosine, -1.f, 1.f)), filter.inner_angle, filter.outer_angle);
}

}  // namespace

Status checkLook(const BounceLook& look) {
  SURFEIT_RETURN_IF_ERROR(checkCorrection("bounce light", look.correction));
  if (look.filters.size() > kMostFilters) {
    return Status::invalidArgument(fmt::format("{} filters of bounce light, expected at most {}",
                                               look.filters.size(), kMostFilters));
  }
  for (std::size_t i = 0; i < look.filters.size(); ++i) {
    SURFEIT_RETURN_IF_ERROR(
        checkFilter(fmt::format("filter {} of bounce light", i + 1), look.filters[i]));
  }
  return {};
}

Status checkGroupCorrections(const std::vector<GroupCorrection>& corrections) {
  std::uint64_t seen = 0;
  for (const GroupCorrection& of_group : corrections) {
    if (of_group.group >= kMaxGroups) {
      return Status::invalidArgument(fmt::format(
          "correction of group {}, expected groups from 0 to {}", of_group.group, kMaxGroups - 1));
    }
    const std::string name = fmt::format("correction of group {}", of_group.group);
    if ((seen & groupBit(of_group.group)) != 0) {
      return Status::invalidArgument(name + ": found two, expected one");
    }
    seen |= groupBit(of_group.group);
    SURFEIT_RETURN_IF_ERROR(checkCorrection(name, of_group.correction));
  }
  return {};
}

BounceLook countedFrom(BounceLook look, const glm::dvec3& origin) {
  for (BounceFilter& filter : look.filters) filter.centre -= origin;
  return look;
}

glm::vec3 corrected(const ColorCorrection& correction, const glm::vec3& light) {
  glm::vec3 result = light;
  if (correction.saturation != 1) {
    const glm::vec3 grey(luminance(light));
    result = glm::max(grey + correction.saturation * (light - grey), glm::vec3(0));
  }
  return correction.gain * correction.tint * result;
}

float filterWeight(const BounceFilter& filter, const glm::vec3& position, const glm::vec3& normal,
                   bool has_two_sides) {
  float weight = 1;
  if (!std::isinf(filter.inner_radius)) {
    const double distance = glm::distance(glm::dvec3(position), filter.centre);
    weight = fall(float(distance), filter.inner_radius, filter.outer_radius);
  }
  if (weight == 0 || filter.direction == glm::vec3(0)) return weight;
  if (normal == glm::vec3(0)) return 0;
  float of_angle = angleWeight(filter, normal);
  if (has_two_sides) of_angle = 0.5f * (of_angle + angleWeight(filter, -normal));
  return weight * of_angle;
}

glm::vec3 lookedAt(const BounceLook& look, glm::vec3 light, const glm::vec3& position,
                   const glm::vec3& normal, bool has_two_sides) {
  light = corrected(look.correction, light);
  for (const BounceFilter& filter : look.filters) {
    const float weight = filterWeight(filter, position, normal, has_two_sides);
    if (weight > 0) light = glm::mix(light, corrected(filter.correction, light), weight);
  }
  return light;
}

CorrectionOfGroup byGroup(const std::vector<GroupCorrection>& corrections) {
  CorrectionOfGroup result{};
  for (const GroupCorrection& of_group : corrections) {
    result[of_group.group] = of_group.correction;
  }
  return result;
}

std::string identityOf(const BounceLook& look, const std::vector<GroupCorrection>& of_groups) {
  std::vector<double> values;
  const auto add = [&values](const glm::dvec3& v) { values.insert(values.end(), {v.x, v.y, v.z}); };
  const auto add_correction = [&](const ColorCorrection& correction) {
    values.insert(values.end(), {correction.gain, correction.saturation});
    add(correction.tint);
  };
  add_correction(look.correction);
  for (const BounceFilter& filter : look.filters) {
    add_correction(filter.correction);
    add(filter.centre), add(filter.direction);
    values.insert(values.end(), {filter.inner_radius, filter.outer_radius, filter.inner_angle,
                                 filter.outer_angle});
  }
  values.push_back(double(look.filters.size()));
  for (const GroupCorrection& of_group : of_groups) {
    values.push_back(of_group.group);
    add_correction(of_group.correction);
  }
  return fmt::format("{:016x}", XXH3_64bits(values.data(), values.size() * sizeof(double)));
}

}  // namespace surfeit
