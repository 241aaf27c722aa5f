#include "bounce/glossy_bounce.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <string>

#include "core/luminance.h"
#include "core/spherical_harmonics.h"
#include "gather/rules/gather_rules.h"

namespace surfeit {
namespace {

constexpr float kShY1 = 0.488602512f;  // the harmonics of band 1 are this times y, z and x

}  // namespace

Status checkGlossy(const std::vector<GroupGloss>& glossy) {
  std::uint64_t seen = 0;
  for (const GroupGloss& of_group : glossy) {
    const std::string name = fmt::format("gloss of group {}", of_group.group);
    if (of_group.group >= kMaxGroups) {
      return Status::invalidArgument(
          fmt::format("{}, expected groups from 0 to {}", name, kMaxGroups - 1));
    }
    if ((seen & groupBit(of_group.group)) != 0) {
      return Status::invalidArgument(name + ": found two, expected one");
    }
    seen |= groupBit(of_group.group);
    if (!(of_group.share >= 0 && of_group.share <= 1)) {
      return Status::invalidArgument(
          fmt::format("{}: share is {}, expected 0 to 1", name, of_group.share));
    }
    if (!(of_group.roughness >= kLeastGloss && of_group.roughness <= 1)) {
      return Status::invalidArgument(fmt::format("{}: roughness is {}, expected {} to 1", name,
                                                 of_group.roughness, kLeastGloss));
    }
  }
  return {};
}

// Over a lobe of cos^n the mean of the cosine is (n + 1) / (n + 2).
GlossOfGroup glossByGroup(const std::vector<GroupGloss>& glossy) {
  GlossOfGroup result{};
  for (const GroupGloss& of_group : glossy) {
    const float exponent = lobeExponent(of_group.roughness);
    result[of_group.group] = {of_group.share, (exponent + 1) / (exponent + 2)};
  }
  return result;
}

float lobeNodeAngle(const std::vector<GroupGloss>& glossy) {
  float least = std::numeric_limits<float>::infinity();
  for (const GroupGloss& of_group : glossy) {
    if (of_group.share > 0) least = std::min(least, of_group.roughness);
  }
  return kPi / 4 * least * least;
}

// Band 0 holds the integral of the light, and band 1 that of the light times the direction.
ArrivingLight arrivingLight(const std::array<glm::vec3, 9>& radiance_sh) {
  const auto band = [&](std::size_t i) { return luminance(radiance_sh[i]); };
  return {band(0) / kShY00, glm::vec3(band(3), band(1), band(2)) / kShY1};
}

// The mean direction of what arrives, mirrored, is that of what a mirror sends. Each of its
// directions spreads into a lobe about it, whose mean is that direction times the mean cosine: so
// the mean of all shrinks by that.
Lobe mirrorLobe(const Gloss& gloss, const ArrivingLight& light, const glm::vec3& normal,
                const glm::vec3& sent, const glm::vec3& radiosity) {
  if (!(light.around > 0)) return {};
  glm::vec3 from = light.towards / light.around;
  if (const float length = glm::length(from); length > 1) from /= length;
  const glm::vec3 mirrored = 2 * glm::dot(from, normal) * normal - from;
  glm::vec3 shares(0);
  for (int c = 0; c < 3; ++c) {
    if (radiosity[c] > 0) shares[c] = gloss.share * std::min(1.f, sent[c] / radiosity[c]);
  }
  return Lobe::encode(shares, gloss.mean_cosine * mirrored);
}

}  // namespace surfeit
