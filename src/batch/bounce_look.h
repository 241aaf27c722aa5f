// The look of bounce light (surfeit/bounce_look.h) at what is lit.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/bounce_look.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// kInvalidArgument names the value that is out of range.
Status checkLook(const BounceLook& look);
Status checkGroupCorrections(const std::vector<GroupCorrection>& corrections);

// The same look, its places counted from an origin.
BounceLook countedFrom(BounceLook look, const glm::dvec3& origin);

glm::vec3 corrected(const ColorCorrection& correction, const glm::vec3& light);

// Part of its correction that a filter has there, 0 to 1. `normal`: unit, or zero where there is
// none; the position is counted as the filter's centre is.
float filterWeight(const BounceFilter& filter, const glm::vec3& position, const glm::vec3& normal,
                   bool has_two_sides);

// The bounce light that arrives there, by the look.
glm::vec3 lookedAt(const BounceLook& look, glm::vec3 light, const glm::vec3& position,
                   const glm::vec3& normal, bool has_two_sides);

// The corrections of all groups, by number.
using CorrectionOfGroup = std::array<ColorCorrection, kMaxGroups>;
CorrectionOfGroup byGroup(const std::vector<GroupCorrection>& corrections);

// A word that differs where looks or corrections do, for identities and provenances.
std::string identityOf(const BounceLook& look, const std::vector<GroupCorrection>& of_groups = {});

}  // namespace surfeit
