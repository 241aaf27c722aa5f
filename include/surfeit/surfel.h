// A surfel: an oriented disk that stands for a small piece of surface (memo 08-01, section 3.1).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

namespace surfeit {

// What a surfel is beyond a one-sided disk.
enum SurfelFlags : std::uint32_t {
  kSurfelSphere = 1u << 0,    // no normal: a sphere that looks the same from everywhere
  kSurfelTwoSided = 1u << 1,  // both sides send and block light (leaves, cloth, hair)
};

// A surfel belongs to one of so many groups: objects or lights that a gather may look at alone.
// (A surfel group, in contrast, is what a page of the file holds.)
inline constexpr std::uint32_t kMaxGroups = 64;

// Sets of groups have a bit for each.
inline constexpr std::uint64_t kAllGroups = ~std::uint64_t{0};
constexpr std::uint64_t groupBit(std::uint32_t group) { return std::uint64_t{1} << group; }

// Plain data, 64 bytes without padding, so that a surfel can be spilled and compared as bytes.
struct Surfel {
  glm::vec3 position{0};    // world units
  float radius = 0;         // > 0; circumscribes the micropolygon, so that disks leave no gaps
  glm::vec3 normal{0};      // unit length; zero when kSurfelSphere is set
  float area = 0;           // > 0; exact area of the micropolygon; of a sphere: its cross-section
  glm::vec3 radiosity{0};   // radiant exitance, scene-linear rgb, >= 0
  std::uint32_t flags = 0;  // SurfelFlags
  glm::vec3 albedo{0};      // diffuse reflectance, scene-linear rgb, for further bounces
  std::uint8_t group = 0;   // 0 to kMaxGroups - 1; 0 in clouds without groups
  // Of the micropolygon, as codes (core/long_side.h): how much longer than wide it is, and where
  // its longer side points; 0: not known. Two-sided surfels that have one are drawn so.
  std::uint8_t elongation = 0;
  std::uint16_t long_side = 0;

  bool isSphere() const { return (flags & kSurfelSphere) != 0; }
  bool isTwoSided() const { return (flags & kSurfelTwoSided) != 0; }
};
static_assert(sizeof(Surfel) == 64);

// Which optional data a cloud came with, as opposed to filled in by the rules of docs/format.md.
struct CloudChannels {
  bool normal = false;
  bool radius = false;
  bool area = false;
  bool radiosity = false;
  bool albedo = false;
  bool two_sided = false;
  bool group = false;
  bool long_side = false;
};

}  // namespace surfeit
