#include "random/random_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "core/long_side.h"
#include "random/random_shapes.h"
#include "random/surface_sampler.h"

namespace surfeit {
namespace {

constexpr int kFewestSurfels = 500, kMostSurfels = 30'000;
constexpr int kFewestReceivers = 32, kMostReceivers = 96;
constexpr float kContact = .05f;  // receivers this near to planes of others, in radii, are left out

constexpr double kBorder = .02;  // cells

constexpr int kMostTries = 1000;  // to put receivers on surfaces

// Where the units of the shapes go: scaled, turned, moved.
struct Setting {
  double scale = 1;
  glm::dvec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, origin{0};

  glm::dvec3 turned(const glm::dvec3& v) const { return v.x * x + v.y * y + v.z * z; }
  glm::vec3 direction(const glm::dvec3& v) const { return glm::vec3(turned(v)); }
  glm::vec3 position(const glm::dvec3& v) const { return glm::vec3(scale * turned(v) + origin); }
};

Setting randomSetting(RandomNumbers& random, std::string& text) {
  Setting setting;
  setting.scale = random.chance(.3) ? 1 : random.logBetween(1e-3, 1e5);
  const bool is_turned = random.chance(.6), is_moved = random.chance(.3);
  if (is_turned) {
    const ShapeFrame frame = anyFrame({}, random);
    setting.x = frame.x, setting.y = frame.y, setting.z = frame.z;
  }
  if (is_moved) {
    const double distance = random.logBetween(1, 30);
    setting.origin = setting.scale * distance * random.direction();
  }
  text = fmt::format("scale {:.3g}, {}, origin {:.3g} {:.3g} {:.3g}", setting.scale,
                     is_turned ? "turned" : "upright", setting.origin.x, setting.origin.y,
                     setting.origin.z);
  return setting;
}

// An ingredient with its surfels, and where receivers may be put on it.
struct Part {
  Shape shape;
  SamplingLook look;
  std::vector<CellGrid> grids;  // of the patches
};

class SceneMaker {
 public:
  SceneMaker(std::uint64_t seed, const RandomSampling& sampling)
      : random_(seed), sampling_(sampling) {
    scene_.seed = seed;
    RandomNumbers random = random_.fork(1);
    setting_ = randomSetting(random, scene_.setting);
  }

  RandomScene make() {
    chooseParts();
    for (std::size_t i = 0; i < parts_.size(); ++i) addPart(std::uint8_t(i));
    addReceivers();
    scene_.extent = float(2 * setting_.scale);
    return std::move(scene_);
  }

 private:
  void chooseParts();
  ShapePlace choosePlace(int kind, RandomNumbers& random) const;
  void makeGrids(int surfels, RandomNumbers& random, Part& part) const;
  void addPart(std::uint8_t number);
  void addSurfels(const std::vector<SampledSurfel>& sampled, std::uint8_t number, bool are_spheres);
  void addTruth(const CellGrid& grid, bool is_flat, bool is_two_sided, std::uint8_t number);
  void addTriangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, bool is_two_sided,
                   std::uint8_t number);

  void addReceivers();
  bool isInContact(const glm::vec3& position, int number) const;
  void addSurfaceReceivers(int number, RandomNumbers& random);
  void addReceiver(const SurfaceSite& site, const char* place, int number);
  void addFreeReceiver(bool is_spherical, RandomNumbers& random);

  RandomNumbers random_;
  RandomSampling sampling_;
  Setting setting_;
  std::vector<Part> parts_;
  std::vector<int> wanted_;  // surfels of each part
  bool has_ground_ = false;
  RandomScene scene_;
};

ShapePlace SceneMaker::choosePlace(int kind, RandomNumbers& random) const {
  const bool is_ground = isGroundKind(kind);
  ShapePlace place;
  place.size = is_ground ? random.logBetween(.7, 3) : random.logBetween(.08, 1.2);
  glm::dvec3 foot;
  for (int axis = 0; axis < 3; ++axis) foot[axis] = random.between(-1, 1);
  const bool stands = has_ground_ && random.chance(.6), is_tilted = random.chance(.35);
  if (is_ground) foot *= .3;
  // Sheets lie over the ground, not in it; solids may stand on it
  if (stands) foot.z = isSolidKind(kind) && random.chance(.6) ? 0 : random.logBetween(.001, .1);
  if (is_ground && !has_ground_) foot = {};
  place.frame = !stands && is_tilted ? anyFrame(foot, random) : uprightFrame(foot, random);
  return place;
}

// About so many cells in all, divided by area and density.
void SceneMaker::makeGrids(int surfels, RandomNumbers& random, Part& part) const {
  double area = 0;
  for (const ShapePatch& patch : part.shape.patches) {
    area += patch.length_u * patch.length_v * patch.density;
  }
  const bool has_long_cells = random.chance(.15);
  const double aspect = has_long_cells ? random.logBetween(.25, 4) : 1;
  for (const ShapePatch& patch : part.shape.patches) {
    const double share = patch.length_u * patch.length_v * patch.density / area;
    const double count = std::max(1.0, sampling_.density * surfels * share);
    const double columns = std::sqrt(count * patch.length_u / patch.length_v * aspect);
    const int whole = std::max(1, int(std::lround(std::min(columns, count))));
    const int rows = std::max(1, int(std::lround(count / whole)));
    const int least = patch.is_flat ? 1 : 4;
    part.grids.emplace_back(patch, std::max(whole, least), std::max(rows, least));
  }
}

void SceneMaker::chooseParts() {
  RandomNumbers random = random_.fork(2);
  const int count = random.intBetween(1, kMostIngredients);
  const double total = random.logBetween(kFewestSurfels, kMostSurfels);
  std::vector<double> shares;
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    shares.push_back(random.logBetween(1, 30));
    sum += shares.back();
  }
  const bool begins_with_ground = random.chance(.6), mixes_sides = random.chance(.6);
  for (int i = 0; i < count; ++i) {
    RandomNumbers own = random_.fork(std::uint64_t(100 + i));
    int kind;
    do {
      kind = own.below(shapeKindCount());
    } while (i == 0 && begins_with_ground && !isGroundKind(kind));
    wanted_.push_back(std::max(20, int(total * shares[std::size_t(i)] / sum)));
    ShapePlace place = choosePlace(kind, own);
    place.surfels = wanted_.back();
    Part& part = parts_.emplace_back();
    part.shape = makeShape(kind, place, own);
    if (part.shape.is_light) wanted_.back() = std::min(wanted_.back(), 200);
    part.look = randomLook(part.shape.may_be_two_sided && mixes_sides, own);
    if (sampling_.without_noise) part.look.position_noise = part.look.normal_noise = 0;
    if (part.shape.is_light) part.look.color *= own.logBetween(10, 1000), part.look.waves = {};
    makeGrids(wanted_.back(), own, part);
    has_ground_ |= isGroundKind(kind) && i == 0;
  }
}

void SceneMaker::addPart(std::uint8_t number) {
  RandomNumbers random = random_.fork(std::uint64_t(200 + number));
  const Part& part = parts_[number];
  const std::size_t before = scene_.surfels.size();
  for (std::size_t i = 0; i < part.grids.size(); ++i) {
    const ShapePatch& patch = part.shape.patches[i];
    SamplingLook look = part.look;
    look.is_two_sided |= patch.always_two_sided;
    if (patch.grading > 1) look.is_scattered = false;  // cells are not alike
    std::vector<SampledSurfel> sampled;
    sampleGrid(part.grids[i], look, random, sampled);
    addSurfels(sampled, number, false);
    addTruth(part.grids[i], patch.is_flat, look.is_two_sided, number);
  }
  std::vector<SampledSurfel> sampled;
  for (const ShapeLeaf& leaf : part.shape.leaves) {
    sampleLeaf(leaf, part.look, sampled);
    const glm::dvec3 corner = leaf.middle - leaf.half_u - leaf.half_v;
    const glm::dvec3 u = 2. * leaf.half_u, v = 2. * leaf.half_v;
    addTriangle(corner, corner + u, corner + u + v, true, number);
    addTriangle(corner, corner + u + v, corner + v, true, number);
  }
  addSurfels(sampled, number, false);
  sampled.clear();
  for (const ShapePoint& point : part.shape.points) {
    samplePoint(point, part.look, sampled);
    scene_.spheres.push_back(
        {setting_.position(point.middle), float(setting_.scale * point.radius), number});
  }
  addSurfels(sampled, number, true);

  const std::size_t surfels = scene_.surfels.size() - before;
  const std::size_t pieces = std::max<std::size_t>(1, part.shape.patches.size());
  scene_.ingredients.push_back({fmt::format("{}, {} surfels in {} pieces{}", part.shape.name,
                                            surfels, pieces, part.look.describe()),
                                surfels, part.shape.leaves.empty() && part.shape.points.empty()});
}

void SceneMaker::addSurfels(const std::vector<SampledSurfel>& sampled, std::uint8_t number,
                            bool are_spheres) {
  const double scale = setting_.scale;
  for (const SampledSurfel& one : sampled) {
    Surfel surfel;
    surfel.position = setting_.position(one.position);
    surfel.radius = float(scale * one.radius);
    surfel.area = float(scale * scale * one.area);
    surfel.normal = setting_.direction(one.normal);
    surfel.radiosity = glm::vec3(one.radiosity);
    surfel.albedo = glm::vec3(.5f);
    surfel.group = number;
    if (are_spheres) surfel.flags |= kSurfelSphere;
    if (one.is_two_sided) surfel.flags |= kSurfelTwoSided;
    if (one.long_side != glm::dvec3(0)) {
      setLongSide(glm::vec3(scale * setting_.turned(one.long_side)), surfel);
    }
    // Cells that have shrunk to nothing are no surface
    if (!(surfel.area > 0) || !(surfel.radius > 0)) continue;
    scene_.surfels.push_back(surfel);
    scene_.surfel_ingredients.push_back(number);
  }
}

void SceneMaker::addTriangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
                             bool is_two_sided, std::uint8_t number) {
  scene_.triangles.push_back(
      {{setting_.position(a), setting_.position(b), setting_.position(c)}, is_two_sided, number});
}

void SceneMaker::addTruth(const CellGrid& grid, bool is_flat, bool is_two_sided,
                          std::uint8_t number) {
  const int columns = is_flat ? 1 : grid.columns(), rows = is_flat ? 1 : grid.rows();
  const int wide = grid.columns() / columns, high = grid.rows() / rows;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int left = column * wide, right = left + wide, low = row * high, top = low + high;
      const glm::dvec3 a = grid.corner(left, low), d = grid.corner(right, top);
      addTriangle(a, grid.corner(right, low), d, is_two_sided, number);
      addTriangle(a, d, grid.corner(left, top), is_two_sided, number);
    }
  }
}

// Whether the place lies in the surface of another part, as below a box on its ground: what it sees
// is a matter of rounding.
bool SceneMaker::isInContact(const glm::vec3& position, int number) const {
  for (std::size_t i = 0; i < scene_.surfels.size(); ++i) {
    const Surfel& surfel = scene_.surfels[i];
    if (int(scene_.surfel_ingredients[i]) == number || surfel.isSphere()) continue;
    const glm::vec3 offset = position - surfel.position;
    if (glm::dot(offset, offset) > 2 * surfel.radius * surfel.radius) continue;
    if (std::abs(glm::dot(offset, surfel.normal)) < kContact * surfel.radius) return true;
  }
  return false;
}

void SceneMaker::addReceiver(const SurfaceSite& site, const char* place, int number) {
  RandomReceiver one;
  one.is_on_border = site.is_on_border;
  one.receiver.position = setting_.position(site.position);
  one.receiver.normal = glm::normalize(setting_.direction(site.normal));
  one.place = place;
  one.ingredient = number;
  const glm::vec3 away = glm::abs(one.receiver.position);
  one.ray_offset = std::max(float(2e-3 * setting_.scale * site.spacing),
                            2e-6f * std::max({away.x, away.y, away.z}));
  if (!isInContact(one.receiver.position, number)) scene_.receivers.push_back(one);
}

// A place beyond the border of a patch, mirrored at it. On the border itself a place may lie in
// another patch of its part, and what it sees is a matter of rounding.
double withinUnit(double place) {
  return std::min(place > 1 ? 2 - place : std::abs(place), .99999);
}

// One or some neighbours on a part.
void SceneMaker::addSurfaceReceivers(int number, RandomNumbers& random) {
  const Part& part = parts_[std::size_t(number)];
  if (part.grids.empty()) {
    if (part.shape.leaves.empty()) return addFreeReceiver(random.chance(.3), random);
    const ShapeLeaf& leaf =
        part.shape.leaves[std::size_t(random.below(int(part.shape.leaves.size())))];
    SurfaceSite site;
    site.position = leaf.middle + random.between(-.8, .8) * leaf.half_u;
    site.normal = glm::normalize(glm::cross(leaf.half_u, leaf.half_v));
    if (random.chance(.5)) site.normal = -site.normal;
    site.spacing = glm::length(leaf.half_v);
    return addReceiver(site, "on a leaf", number);
  }
  // Cavities where there are some
  int chosen = random.below(int(part.grids.size()));
  for (int i = 0; i < 2 && !part.shape.patches[std::size_t(chosen)].is_cavity; ++i) {
    chosen = random.below(int(part.grids.size()));
  }
  const ShapePatch& patch = part.shape.patches[std::size_t(chosen)];
  const CellGrid& grid = part.grids[std::size_t(chosen)];
  const bool at_edge = random.chance(.25);
  double u = random.unit(), v = random.unit();
  if (at_edge) {
    (random.chance(.5) ? u : v) =
        random.chance(.5) ? random.logBetween(1e-3, .1) : 1 - random.logBetween(1e-3, .1);
  }
  const int neighbours = random.chance(.5) ? 1 : random.intBetween(2, 16);
  const double spread = random.logBetween(.003, .3);
  const bool is_two_sided = part.look.is_two_sided || patch.always_two_sided;
  const bool turns = random.chance(is_two_sided ? .5 : .03);
  for (int i = 0; i < neighbours; ++i) {
    const double near_u = withinUnit(u + (i > 0 ? spread * random.between(-.5, .5) : 0));
    const double near_v = withinUnit(v + (i > 0 ? spread * random.between(-.5, .5) : 0));
    const double column = near_u * grid.columns(), row = near_v * grid.rows();
    SurfaceSite site =
        grid.site(int(column), int(row), column - std::floor(column), row - std::floor(row));
    const double aside = std::min({column, grid.columns() - column, row, grid.rows() - row});
    site.is_on_border = aside < kBorder;
    if (turns) site.normal = -site.normal;
    if (turns && !is_two_sided) site.position += .3 * site.spacing * site.normal;
    addReceiver(site,
                turns && !is_two_sided ? "behind a back"
                : at_edge              ? "at an edge"
                : patch.is_cavity      ? "in a cavity"
                                       : "on a surface",
                number);
  }
}

void SceneMaker::addFreeReceiver(bool is_spherical, RandomNumbers& random) {
  RandomReceiver& one = scene_.receivers.emplace_back();
  one.receiver.position = setting_.position(1.2 * random.inBall());
  if (!is_spherical) one.receiver.normal = glm::normalize(setting_.direction(random.direction()));
  one.place = is_spherical ? "without normal" : "in the open";
  one.ray_offset = float(1e-6 * setting_.scale);
}

void SceneMaker::addReceivers() {
  RandomNumbers random = random_.fork(3);
  const std::size_t count = std::size_t(random.intBetween(kFewestReceivers, kMostReceivers));
  int tries = 0;
  while (scene_.receivers.size() < count) {
    const double kind = random.unit();
    if (kind < .85 && tries++ < kMostTries) {
      addSurfaceReceivers(random.below(int(parts_.size())), random);
    } else {
      addFreeReceiver(kind > .95, random);
    }
  }
  scene_.receivers.resize(count);
}

}  // namespace

std::string RandomScene::describe() const {
  std::string text = fmt::format("seed {}: {} surfels, {} receivers, {}\n", seed, surfels.size(),
                                 receivers.size(), setting);
  for (std::size_t i = 0; i < ingredients.size(); ++i) {
    if (ingredients[i].surfels == 0) continue;
    text += fmt::format("  {}: {}\n", i, ingredients[i].text);
  }
  return text;
}

RandomScene RandomScene::only(std::uint64_t kept) const {
  const auto keeps = [kept](std::uint8_t number) { return (kept >> number & 1) != 0; };
  RandomScene scene = *this;
  scene.surfels.clear();
  scene.surfel_ingredients.clear();
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (!keeps(surfel_ingredients[i])) continue;
    scene.surfels.push_back(surfels[i]);
    scene.surfel_ingredients.push_back(surfel_ingredients[i]);
  }
  std::erase_if(scene.triangles, [&](const RandomTriangle& one) { return !keeps(one.ingredient); });
  std::erase_if(scene.spheres, [&](const RandomSphere& one) { return !keeps(one.ingredient); });
  for (std::size_t i = 0; i < ingredients.size(); ++i) {
    if (!keeps(std::uint8_t(i))) scene.ingredients[i].surfels = 0;
  }
  return scene;
}

RandomScene RandomScene::onlySurfaces() const {
  std::uint64_t kept = 0;
  for (std::size_t i = 0; i < ingredients.size(); ++i) {
    if (ingredients[i].is_surface) kept |= std::uint64_t{1} << i;
  }
  return only(kept);
}

RandomScene RandomScene::withoutSizes(bool keeps_areas) const {
  RandomScene scene = onlySurfaces();
  for (Surfel& surfel : scene.surfels) {
    surfel.radius = 0;
    if (!keeps_areas) surfel.area = 0;
  }
  return scene;
}

RandomScene RandomScene::withOpacities() const {
  constexpr double kLeast = .05, kMost = .95;
  RandomScene scene = *this;
  RandomNumbers random = RandomNumbers(seed).fork(4);
  const std::size_t always = std::size_t(random.below(int(ingredients.size())));
  for (std::size_t i = 0; i < ingredients.size(); ++i) {
    RandomIngredient& one = scene.ingredients[i];
    const bool is_translucent = random.chance(.6) || i == always, is_tinted = random.chance(.25);
    const glm::vec3 tint(random.color(kLeast, kMost));
    if (!is_translucent) continue;
    one.opacity = is_tinted ? tint : glm::vec3(tint.x);
    one.text += is_tinted ? fmt::format(", opacity {:.2f} {:.2f} {:.2f}", tint.x, tint.y, tint.z)
                          : fmt::format(", opacity {:.2f}", tint.x);
  }
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const glm::vec3& opacity = scene.ingredients[surfel_ingredients[i]].opacity;
    scene.surfels[i].setOpacity(opacity.x, opacity.y, opacity.z);
  }
  return scene;
}

std::vector<LocalReceiver> RandomScene::plainReceivers() const {
  std::vector<LocalReceiver> plain;
  for (const RandomReceiver& one : receivers) plain.push_back(one.receiver);
  return plain;
}

RandomScene makeRandomScene(std::uint64_t seed, const RandomSampling& sampling) {
  return SceneMaker(seed, sampling).make();
}

}  // namespace surfeit
