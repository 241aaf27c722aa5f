#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "gather/cut/cut.h"

namespace surfeit {
namespace {

// With normals farther apart than this (cosine of the angle to their mean), hardly anything lies
// below all horizons.
constexpr float kLeastConeCosine = 0.1f;

// Lengths are rounded; what is a bound must stay one.
constexpr float kRoundingFactor = 1.00001f;
constexpr float kAngleSlack = 1e-3f;  // acos of what is nearly 1

// Pixels at the edge of a cone count in part, so somewhat farther out things matter, too.
constexpr float kSquareReach = 1.15f;

}  // namespace

PacketView viewPacket(std::span<const LocalReceiver> receivers) {
  PacketView view;
  glm::vec3 position_sum(0), normal_sum(0);
  view.has_horizon = true;
  for (const LocalReceiver& receiver : receivers) {
    position_sum += receiver.position;
    normal_sum += receiver.normal;
    if (receiver.isSpherical()) view.has_horizon = false;
  }
  // One receiver is its own centre exactly
  view.centre =
      receivers.size() == 1 ? receivers[0].position : position_sum * (1 / float(receivers.size()));
  const float normal_length = glm::length(normal_sum);
  view.has_horizon = view.has_horizon && normal_length > 0;
  if (view.has_horizon) {
    view.axis = receivers.size() == 1 ? receivers[0].normal : normal_sum / normal_length;
  }

  float radius_sq = 0, lift = 0, cosine = 1;
  for (const LocalReceiver& receiver : receivers) {
    const glm::vec3 to_centre = view.centre - receiver.position;
    radius_sq = std::max(radius_sq, glm::dot(to_centre, to_centre));
    lift = std::max(lift, glm::dot(to_centre, receiver.normal));
    cosine = std::min(cosine, glm::dot(view.axis, receiver.normal));
  }
  view.radius = std::sqrt(radius_sq) * kRoundingFactor;
  view.lift = lift * kRoundingFactor;
  view.has_horizon = view.has_horizon && cosine > kLeastConeCosine;
  view.cone_cosine = std::min(1.f, cosine);
  view.cone_sine = std::sqrt(std::max(0.f, 1 - cosine * cosine));
  return view;
}

PacketView viewPacket(std::span<const LocalReceiver> receivers, const GatherRules& rules) {
  PacketView view = viewPacket(receivers);
  if (!rules.hasCone()) return view;
  glm::vec3 sum(0);
  for (const LocalReceiver& receiver : receivers) {
    if (receiver.isSpherical()) return view;
    sum += lobeAxis(receiver, rules);
  }
  const float length = glm::length(sum);
  if (!(length > 0)) return view;
  view.lobe_axis = sum / length;
  float spread = 0;
  for (const LocalReceiver& receiver : receivers) {
    const float cosine = glm::dot(view.lobe_axis, lobeAxis(receiver, rules));
    spread = std::max(spread, std::acos(std::clamp(cosine, -1.f, 1.f)));
  }
  const float slope = std::tan(std::min(rules.weights.cone_angle, 1.5f));
  const float angle = std::atan(kSquareReach * slope) + spread + kAngleSlack;
  view.has_cone = angle < kPi / 2;
  view.lobe_cosine = std::cos(angle);
  view.lobe_sine = std::sin(angle);
  return view;
}

}  // namespace surfeit
