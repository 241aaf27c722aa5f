// A surfel: an oriented disk that stands for a small piece of surface (memo 08-01, section 3.1).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

namespace surfeit {

// Properties of a surfel that is not a one-sided disk.
enum SurfelFlags : std::uint32_t {
  kSurfelSphere = 1u << 0,    // no normal: a sphere that looks the same from everywhere
  kSurfelTwoSided = 1u << 1,  // both sides send and block light (leaves, cloth, hair)
  // Set by the indexer: another sheet that faces alike lies close before it, where its normal
  // points to; and of a two-sided one, on the other side. It is not seen from there.
  kSurfelHiddenFront = 1u << 2,
  kSurfelHiddenBack = 1u << 3,
  // Set by the indexer: a sphere or two-sided, and no tile of a surface, as particles, leaves and
  // hair, which hide each other at random; and of these, nothing lies beside it on its plane, as
  // another piece of the same leaf does.
  kSurfelLoose = 1u << 4,
  kSurfelLone = 1u << 5,
};

// Number of object groups. A surfel belongs to one object group; a gather may see some of them
// alone: single objects or lights. (A surfel group, in contrast, is the contents of a page.)
inline constexpr std::uint32_t kMaxGroups = 64;

// A set of object groups has a bit for each.
inline constexpr std::uint64_t kAllGroups = ~std::uint64_t{0};
constexpr std::uint64_t groupBit(std::uint32_t group) { return std::uint64_t{1} << group; }

// Of a code: in steps of 1/65535.
inline constexpr std::uint16_t kMostTransparency = 65534;
constexpr float opacityOf(std::uint16_t transparency) {
  return 1 - float(transparency) * (1.f / 65535);
}
// The nearest code of an opacity from 0 to 1; of 0 that of the least.
constexpr std::uint16_t transparencyOf(double opacity) {
  const double code = (1 - opacity) * 65535 + 0.5;
  return code >= kMostTransparency ? kMostTransparency : static_cast<std::uint16_t>(code);
}

// Where colors are let through differently: the codes of green and blue less that of red, modulo
// 65536. Zero where all are let through alike.
using Tint = std::array<std::uint16_t, 2>;
constexpr bool isTinted(const Tint& tint) { return (tint[0] | tint[1]) != 0; }
// The code of a color (0 red, 1 green, 2 blue), from that of red.
constexpr std::uint16_t transparencyOf(std::uint16_t red, const Tint& tint, int color) {
  return color == 0 ? red : static_cast<std::uint16_t>(red + tint[std::size_t(color - 1)]);
}
constexpr Tint tintOf(std::uint16_t red, std::uint16_t green, std::uint16_t blue) {
  return {static_cast<std::uint16_t>(green - red), static_cast<std::uint16_t>(blue - red)};
}

// Plain data, 68 bytes without padding, so that a surfel can be stored and compared as bytes.
struct Surfel {
  glm::vec3 position{0};    // world units
  float radius = 0;         // > 0; the disk holds the piece of surface, so disks leave no gaps
  glm::vec3 normal{0};      // unit length; zero when kSurfelSphere is set
  float area = 0;           // > 0; exact area of the piece; for a sphere, its cross-section
  glm::vec3 radiosity{0};   // radiant exitance, scene-linear rgb, >= 0
  std::uint16_t flags = 0;  // SurfelFlags
  std::uint16_t transparency = 0;  // 1 - opacity in red, in 1/65535; 0: opaque
  glm::vec3 albedo{0};             // diffuse reflectance, scene-linear rgb, for further bounces
  std::uint8_t group = 0;          // object group, 0 to kMaxGroups - 1; 0 in clouds without groups
  // Codes (core/long_side.h): length over width of a rectangle, and the direction of its longer
  // side. Without a direction (0) it is a disk, and the former is how many surfels share its piece.
  std::uint8_t elongation = 0;
  std::uint16_t long_side = 0;
  Tint tint{};  // of the transparency

  bool isSphere() const { return (flags & kSurfelSphere) != 0; }
  bool isTwoSided() const { return (flags & kSurfelTwoSided) != 0; }
  bool isLoose() const { return (flags & kSurfelLoose) != 0; }
  bool isLone() const { return (flags & kSurfelLone) != 0; }
  bool isTinted() const { return surfeit::isTinted(tint); }
  // In some color.
  bool isTranslucent() const { return transparency != 0 || isTinted(); }
  // How much of its area covers what lies behind in a color, and sends its radiosity: above 0, up
  // to 1.
  float opacity(int color = 0) const {
    return opacityOf(transparencyOf(transparency, tint, color));
  }
  void setOpacity(double red, double green, double blue) {
    transparency = transparencyOf(red);
    tint = tintOf(transparency, transparencyOf(green), transparencyOf(blue));
  }
};
static_assert(sizeof(Surfel) == 68);

// The optional channels that a cloud has; the rules of docs/format.md fill in the others.
struct CloudChannels {
  bool normal = false;
  bool radius = false;
  bool area = false;
  bool radiosity = false;
  bool albedo = false;
  bool two_sided = false;
  bool group = false;
  bool long_side = false;
  bool opacity = false;
  bool tint = false;  // an opacity for each color; then there is an opacity
};

}  // namespace surfeit
