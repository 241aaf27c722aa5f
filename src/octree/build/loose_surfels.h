// Spheres and two-sided surfels are tiles of a surface, as of a scanned wall or of cloth, or loose:
// particles, leaves and hair, which lie before and behind each other anywhere. What lies around
// them tells.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Neighbours are looked for in cells of up to so many surfels, and cells of up to so many decide.
inline constexpr std::size_t kLooseCell = 1024, kLoosePart = 64;

// What the surfels of a cell tell of themselves; then its parts are marked.
class LooseSurfels {
 public:
  // Asks the spheres and some disks of the cell `cube`. Of what lies outside, nothing is known, but
  // that nothing lies outside `all`. False: it has only one-sided disks.
  bool look(std::span<const Surfel> cell, const Bounds3& cube, const Bounds3& all);
  // Sets kSurfelLoose and kSurfelLone of the spheres and two-sided surfels of a part of the cell:
  // spheres know by themselves. Of others, and of spheres at the border, most of those that were
  // asked tell: of the part, and of disks those within their neighbours' reach of it, lest a part
  // with the edge of a sheet alone is loose; where these are too few, of the cell. `begin`: number
  // of the part's first surfel in the cell.
  void mark(std::size_t begin, std::span<Surfel> part) const;

 private:
  enum class Vote : std::uint8_t { kNone, kTile, kPiece, kLone };
  struct Place {
    glm::vec3 position;
    std::uint32_t surfel;
  };
  struct Votes {
    std::size_t tiles = 0, pieces = 0, lone = 0;
    void add(Vote vote) {
      tiles += vote == Vote::kTile;
      pieces += vote == Vote::kPiece;
      lone += vote == Vote::kLone;
    }
    std::size_t count() const { return tiles + pieces + lone; }
    Vote most() const {
      if (pieces + lone <= tiles) return Vote::kTile;
      return lone > pieces ? Vote::kLone : Vote::kPiece;
    }
  };

  void ask(std::span<const Surfel> cell, bool spheres, const Bounds3& known);
  Vote voteOfSphere(const Place& place, float reach, const Bounds3& known) const;
  Vote voteOfDisk(std::span<const Surfel> cell, const Place& place, const Bounds3& known) const;
  // Of the disks of a part and of those around it.
  Votes votesAround(std::span<const Surfel> part) const;
  template <typename Visit>
  void visitAround(const Place& place, float reach, const Visit& visit) const;

  std::vector<Vote> votes_;
  std::vector<Place> places_;  // of one kind, along x
  std::array<Votes, 2> all_;   // of disks, of spheres
};

}  // namespace surfeit
