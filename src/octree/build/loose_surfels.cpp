#include "octree/build/loose_surfels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/long_side.h"
#include "core/ribbon.h"
#include "core/symmetric_matrix.h"

namespace surfeit {
namespace {

// Roots of the area of a surfel's piece within which its neighbours are: on a plane, some 19 of its
// size.
constexpr float kReach = 2.5f;
// A rectangle has neighbours within so many of its sides at least: on a plane, all eight around it.
// Cells are smaller than 2.5 lengths of a hair. (With 1.3 two-sided rows 10:1 cover .193, with 1.5
// .200, as one-sided ones do; AO RMSE of hair .0097, .0102.)
constexpr float kLeastReach = 1.5f;
// One disk of so many is asked. It is odd, lest rows of a grid are left out.
constexpr std::size_t kAskedApart = 3;
// Fewer that were asked do not decide.
constexpr std::size_t kFewestVotes = 4;
// Two-sided neighbours lie beside each other if they face alike within 60 degrees and lie within 30
// degrees of each other's plane: of leaves that face anywhere, one in 16 does.
constexpr float kAlike = 0.5f, kOffPlane = 0.5f;
// Within so many roots of the area they may also be beyond a ridge, right-angled or less sharp:
// within 46 degrees of each other's plane.
constexpr float kRidgeReach = 1.25f, kOffRidge = 0.72f;
// A surfel with others beside it in fewer sectors is lone; the three others of a leaf of 2 x 2 are
// in three.
constexpr int kFewestBeside = 3;
// Spheres with fewer neighbours do not touch them: half of a plane has 9.
constexpr std::size_t kFewestAround = 5;
// Spheres around which others fill more of a volume (volumePart) lie in one: three in four of those
// that lie anywhere, one in ten of a plane with noise of .4 spacings.
constexpr float kVolume = 0.5f;

bool mayBeLoose(const Surfel& surfel) { return surfel.isSphere() || surfel.isTwoSided(); }

bool contains(const Bounds3& box, const glm::vec3& p) {
  return p.x >= box.min.x && p.y >= box.min.y && p.z >= box.min.z && p.x <= box.max.x &&
         p.y <= box.max.y && p.z <= box.max.z;
}

// Whether all within `reach` of p lies in it.
bool holdsAround(const Bounds3& box, const glm::vec3& p, float reach) {
  return contains(box, p - glm::vec3(reach)) && contains(box, p + glm::vec3(reach));
}

// Where others lie, measured by the sides of a surfel: a rectangle is as long as wide there, with
// the same area.
class Frame {
 public:
  explicit Frame(const Surfel& surfel)
      : normal_(surfel.normal), ribbon_(Ribbon::of(surfel)), size_(std::sqrt(pieceArea(surfel))) {
    if (!ribbon_.isEmpty()) longer_ = ribbon_.length / size_;
  }

  float size() const { return size_; }
  // Within which its neighbours are, here and in the world.
  float reach() const { return size_ * std::clamp(kReach / longer_, kLeastReach, kReach); }
  float worldReach() const { return longer_ * reach(); }
  glm::vec3 toFrame(const glm::vec3& offset) const { return stretched(offset, 1 / longer_); }
  glm::vec3 toWorld(const glm::vec3& offset) const { return stretched(offset, longer_); }
  // In the surfel's plane; half a sector beside the longer side, in which others of a strand lie.
  glm::vec3 axis() const {
    constexpr float kCos = 0.98078528f, kSin = 0.19509032f;
    if (!ribbon_.isEmpty()) return kCos * ribbon_.along - kSin * ribbon_.across;
    return glm::normalize(
        glm::cross(normal_, std::abs(normal_.x) < 0.5f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0)));
  }

 private:
  glm::vec3 stretched(const glm::vec3& offset, float along) const {
    if (ribbon_.isEmpty()) return offset;
    return offset + (along - 1) * glm::dot(offset, ribbon_.along) * ribbon_.along +
           (1 / along - 1) * glm::dot(offset, ribbon_.across) * ribbon_.across;
  }

  glm::vec3 normal_;
  Ribbon ribbon_;
  float size_, longer_ = 1;
};

// Directions on a plane, in 16 sectors.
class Sectors {
 public:
  Sectors(const glm::vec3& normal, const glm::vec3& axis)
      : u_(axis), v_(glm::cross(normal, axis)) {}

  void add(const glm::vec3& offset) {
    constexpr float kTanEighth = 0.41421356f;  // of 22.5 degrees
    const float a = glm::dot(offset, u_), b = glm::dot(offset, v_);
    const unsigned quadrant = b >= 0 ? (a >= 0 ? 0 : 1) : (a < 0 ? 2 : 3);
    const float size_a = std::abs(a), size_b = std::abs(b);
    const float x = quadrant % 2 == 0 ? size_a : size_b, y = quadrant % 2 == 0 ? size_b : size_a;
    const unsigned within = y <= x ? (y > kTanEighth * x ? 1 : 0) : (x > kTanEighth * y ? 2 : 3);
    filled_ |= 1u << (4 * quadrant + within);
  }
  glm::vec3 direction(float turns) const {
    const float angle = turns * 6.2831853f;
    return std::cos(angle) * u_ + std::sin(angle) * v_;
  }
  int count() const { return std::popcount(filled_); }
  // No gap of six, 135 degrees: at a straight edge it is 180, of which neighbours along the edge
  // may take two sectors.
  bool areAround() const {
    const unsigned empty = ~filled_ & 0xFFFFu, twice = empty | empty << 16;
    const unsigned two = twice & twice >> 1;
    return (two & two >> 2 & two >> 4) == 0;
  }

 private:
  glm::vec3 u_, v_;
  unsigned filled_ = 0;
};

}  // namespace

bool LooseSurfels::look(std::span<const Surfel> cell, const Bounds3& cube, const Bounds3& all) {
  if (std::none_of(cell.begin(), cell.end(), mayBeLoose)) return false;
  votes_.assign(cell.size(), Vote::kNone);
  all_ = {};
  Bounds3 known = cube;
  for (int axis = 0; axis < 3; ++axis) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    if (cube.min[axis] <= all.min[axis]) known.min[axis] = -kInfinity;
    if (cube.max[axis] >= all.max[axis]) known.max[axis] = kInfinity;
  }
  ask(cell, true, known);
  ask(cell, false, known);
  return true;
}

void LooseSurfels::ask(std::span<const Surfel> cell, bool spheres, const Bounds3& known) {
  places_.clear();
  for (std::size_t i = 0; i < cell.size(); ++i) {
    const Surfel& surfel = cell[i];
    if (spheres ? surfel.isSphere() : surfel.isTwoSided() && !surfel.isSphere()) {
      places_.push_back({surfel.position, std::uint32_t(i)});
    }
  }
  if (places_.empty()) return;
  std::sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) {
    return a.position.x != b.position.x ? a.position.x < b.position.x : a.surfel < b.surfel;
  });
  for (const Place& place : places_) {
    if (!spheres && place.surfel % kAskedApart != 0) continue;
    Vote& vote = votes_[place.surfel];
    const float reach = kReach * std::sqrt(cell[place.surfel].area);
    vote = spheres ? voteOfSphere(place, reach, known) : voteOfDisk(cell, place, known);
    all_[spheres].add(vote);
  }
}

template <typename Visit>
void LooseSurfels::visitAround(const Place& place, float reach, const Visit& visit) const {
  const auto first =
      std::lower_bound(places_.begin(), places_.end(), place.position.x - reach,
                       [](const Place& other, float least) { return other.position.x < least; });
  for (auto other = first; other != places_.end(); ++other) {
    const glm::vec3 offset = other->position - place.position;
    if (offset.x > reach) break;
    if (glm::dot(offset, offset) <= reach * reach && other->surfel != place.surfel) {
      visit(offset, *other);
    }
  }
}

// At the border of the cell a part of a plane is a plane, and of a volume a volume.
LooseSurfels::Vote LooseSurfels::voteOfSphere(const Place& place, float reach,
                                              const Bounds3& known) const {
  std::size_t count = 1;  // itself
  glm::vec3 sum(0);
  SymmetricMatrix squares{};
  auto& [xx, yy, zz, xy, xz, yz] = squares.entries;  // no loop: this is where the time goes
  visitAround(place, reach, [&](const glm::vec3& d, const Place&) {
    ++count;
    sum += d;
    xx += d.x * d.x, yy += d.y * d.y, zz += d.z * d.z;
    xy += d.x * d.y, xz += d.x * d.z, yz += d.y * d.z;
  });
  if (count <= kFewestAround) {
    return holdsAround(known, place.position, reach) ? Vote::kLone : Vote::kNone;
  }
  for (std::size_t i = 0; i < squares.entries.size(); ++i) {
    squares.entries[i] -=
        sum[SymmetricMatrix::kRow[i]] * sum[SymmetricMatrix::kColumn[i]] / float(count);
  }
  return volumePart(squares) > kVolume ? Vote::kLone : Vote::kTile;
}

// A disk inside of a sheet has others all around on its plane. One at the edge has not, as most of
// a leaf of a few surfels.
LooseSurfels::Vote LooseSurfels::voteOfDisk(std::span<const Surfel> cell, const Place& place,
                                            const Bounds3& known) const {
  const glm::vec3& normal = cell[place.surfel].normal;
  const Frame frame(cell[place.surfel]);
  Sectors around(normal, frame.axis()), beside = around;
  const float reach = frame.reach(), ridge = kRidgeReach * frame.size(), far = frame.worldReach();
  const bool is_inside = holdsAround(known, place.position, far);  // mostly: no direction needed
  for (int i = 0; i < 8 && !is_inside; ++i) {
    const glm::vec3 offset = frame.toWorld(reach * around.direction(float(i) / 8));
    if (!contains(known, place.position + offset)) return Vote::kNone;
  }
  visitAround(place, far, [&](const glm::vec3& in_world, const Place& other) {
    const glm::vec3& facing = cell[other.surfel].normal;
    const glm::vec3 offset = frame.toFrame(in_world);
    const float distance = glm::length(offset);
    if (distance > reach) return;
    const float off_plane =
        std::max(std::abs(glm::dot(offset, normal)), std::abs(glm::dot(offset, facing)));
    const bool is_beside =
        std::abs(glm::dot(normal, facing)) > kAlike && off_plane < kOffPlane * distance;
    if (is_beside) beside.add(offset);
    if (is_beside || (distance < ridge && off_plane < kOffRidge * distance)) {
      around.add(offset);
    }
  });
  if (around.areAround()) return Vote::kTile;
  return beside.count() < kFewestBeside ? Vote::kLone : Vote::kPiece;
}

LooseSurfels::Votes LooseSurfels::votesAround(std::span<const Surfel> part) const {
  Bounds3 box;
  float reach = 0;
  for (const Surfel& surfel : part) {
    if (!surfel.isTwoSided() || surfel.isSphere()) continue;
    box.add(surfel.position);
    reach = std::max(reach, Frame(surfel).worldReach());
  }
  Votes votes;
  if (reach == 0) return votes;
  box.min -= glm::vec3(reach);
  box.max += glm::vec3(reach);
  auto place =
      std::lower_bound(places_.begin(), places_.end(), box.min.x,
                       [](const Place& other, float least) { return other.position.x < least; });
  for (; place != places_.end() && place->position.x <= box.max.x; ++place) {
    if (contains(box, place->position)) votes.add(votes_[place->surfel]);
  }
  return votes;
}

void LooseSurfels::mark(std::size_t begin, std::span<Surfel> part) const {
  std::array<Votes, 2> votes = {votesAround(part), {}};
  for (std::size_t i = 0; i < part.size(); ++i) {
    if (part[i].isSphere()) votes[1].add(votes_[begin + i]);
  }
  for (std::size_t kind = 0; kind < 2; ++kind) {
    if (votes[kind].count() < kFewestVotes) votes[kind] = all_[kind];
  }
  for (std::size_t i = 0; i < part.size(); ++i) {
    Surfel& surfel = part[i];
    const Vote own = votes_[begin + i];
    const bool knows = surfel.isSphere() && own != Vote::kNone;
    const Vote vote = knows ? own : votes[surfel.isSphere()].most();
    if (!mayBeLoose(surfel) || vote == Vote::kTile) continue;
    surfel.flags |= kSurfelLoose;
    if (vote == Vote::kLone) surfel.flags |= kSurfelLone;
  }
}

}  // namespace surfeit
