#include "engine/world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <span>
#include <string>
#include <unordered_map>

#include "core/bounds.h"
#include "engine/gatherer_memory.h"
#include "gather/rules/check_settings.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

// Surfels of a scene that stand for all where many instances are seen as one, and the pages that
// they are taken from.
constexpr std::size_t kSampleSurfels = 1024, kSamplePages = 256;

// x' = matrix x + shift, in the clouds' coordinates.
struct Similarity {
  glm::dmat3 rotation{1};
  double scale = 1;
  glm::dvec3 shift{0};

  glm::dvec3 operator()(const glm::dvec3& place) const {
    return scale * (rotation * place) + shift;
  }
};

bool isIdentity(const Transform& transform) { return transform.m == Transform{}.m; }

Result<Similarity> similarityOf(const Transform& transform, std::size_t number) {
  constexpr double kTolerance = 1e-4;
  const auto& m = transform.m;
  const auto refuse = [&](const char* what) {
    return Status::invalidArgument(fmt::format(
        "transform of instance {}: {}, expected a rotation, one scale for all axes and a shift",
        number, what));
  };
  for (const double value : m) {
    if (!std::isfinite(value)) return refuse("a number that is not finite");
  }
  // Columns of the matrix are where the axes go
  const glm::dvec3 x(m[0], m[4], m[8]), y(m[1], m[5], m[9]), z(m[2], m[6], m[10]);
  const double volume = glm::dot(glm::cross(x, y), z);
  if (!(volume > 0)) return refuse("a mirror, or no volume");
  Similarity similarity;
  similarity.scale = std::cbrt(volume);
  similarity.rotation = glm::dmat3(x, y, z) / similarity.scale;
  const glm::dmat3 square = glm::transpose(similarity.rotation) * similarity.rotation;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      if (!(std::abs(square[i][k] - (i == k ? 1 : 0)) <= kTolerance)) return refuse("a shear");
    }
  }
  similarity.shift = {m[3], m[7], m[11]};
  return similarity;
}

// The root of a scene, and surfels from all over it that add up to its area.
Result<InstancedScene> summaryOf(const PagedOctree& octree, PagedOctree::Reader& reader) {
  reader.use(octree);
  InstancedScene summary;
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> root, reader.nodes(kRootRange));
  summary.root = root.front();
  const std::size_t pages = octree.file().surfelPageCount();
  const std::size_t read = std::min(pages, kSamplePages);
  const std::size_t of_page = (kSampleSurfels + read - 1) / read;
  double area = 0;
  for (std::size_t i = 0; i < read; ++i) {
    const auto page = static_cast<std::uint32_t>((2 * i + 1) * pages / (2 * read));
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> surfels,
                             reader.surfels(page, 0, ~std::uint64_t{0}));
    const std::size_t taken = std::min(of_page, surfels.size());
    for (std::size_t k = 0; k < taken; ++k) {
      Surfel surfel = surfels[(2 * k + 1) * surfels.size() / (2 * taken)];
      surfel.area *= float(double(surfels.size()) / double(taken));
      area += double(surfel.area);
      summary.sample.push_back(surfel);
    }
  }
  const auto factor = float(double(summary.root.area) / area);
  for (Surfel& surfel : summary.sample) surfel.area *= factor;
  return summary;
}

}  // namespace

Result<std::shared_ptr<const World>> World::create(std::shared_ptr<EngineState> engine,
                                                   const std::vector<Instance>& instances,
                                                   const GatherSettings& settings,
                                                   const EnvironmentPixels* environment) {
  SURFEIT_RETURN_IF_ERROR(checkGatherSettings(settings, environment != nullptr));
  if (instances.empty()) {
    return Status::invalidArgument("a gatherer of no instance, expected one or more");
  }
  std::shared_ptr<World> world(new World(std::move(engine)));
  world->addScenes(instances);
  if (environment != nullptr) {
    SURFEIT_RETURN_IF_ERROR(world->loadEnvironment(*environment, settings));
  }
  const bool is_plain = instances.size() == 1 && isIdentity(instances.front().transform);
  if (is_plain) {
    world->origin_ = world->file().header().origin;
  } else {
    SURFEIT_RETURN_IF_ERROR(world->placeInstances(instances));
  }

  GatherSettings local = settings;
  local.eye -= world->origin_;
  local.outputs = settledOutputs(settings, environment != nullptr);
  world->rules_ = gatherRules(local, world->environment_.get());
  std::uint64_t surfels = 0, groups = 0;
  for (const std::uint32_t scene : world->scene_of_) {
    surfels += world->scenes_[scene].info().surfels;
    groups |= world->scenes_[scene].info().groups;
  }
  if ((settings.groups & groups) == 0) {
    return Status::invalidArgument(fmt::format(
        "groups {:#x}: no scene has any of them, expected some of {:#x}", settings.groups, groups));
  }
  std::uint64_t gained = 0;
  for (const GroupGain& of_group : settings.gains) gained |= groupBit(of_group.group);
  if (gained != 0 && (gained & groups) == 0) {
    return Status::invalidArgument(fmt::format(
        "gains of groups {:#x}: no scene has any of them, expected some of {:#x}", gained, groups));
  }
  std::uint64_t decoder_bytes = 0;
  for (const PagedOctree* octree : world->octrees_) {
    decoder_bytes =
        std::max<std::uint64_t>(decoder_bytes, PagedOctree::fixedBytes(octree->file(), 1) -
                                                   PagedOctree::fixedBytes(octree->file(), 0));
  }
  world->gatherer_bytes_ = surfeit::gathererBytes(*world->rules_, surfels) + decoder_bytes;
  return std::shared_ptr<const World>(std::move(world));
}

std::shared_ptr<const World> World::ofPlanned(std::shared_ptr<SceneState> scene,
                                              const GatherRules& rules) {
  std::shared_ptr<World> world(new World(scene->engine));
  world->scenes_.push_back(EngineAccess::handle(std::move(scene)));
  world->octrees_.push_back(EngineAccess::state(world->scenes_.front()).octree.get());
  world->origin_ = world->file().header().origin;
  world->rules_ = rules;
  return world;
}

World::~World() { engine_->giveBack(held_bytes_, 0); }

Status World::take(std::uint64_t bytes, const std::string& what) {
  SURFEIT_RETURN_IF_ERROR(engine_->take(bytes, 0, what));
  held_bytes_ += bytes;
  return {};
}

void World::addScenes(const std::vector<Instance>& instances) {
  std::unordered_map<const PagedOctree*, std::uint32_t> numbers;
  scene_of_.reserve(instances.size());
  for (const Instance& instance : instances) {
    const PagedOctree* const octree = EngineAccess::state(instance.scene).octree.get();
    const auto [found, is_new] =
        numbers.emplace(octree, static_cast<std::uint32_t>(scenes_.size()));
    if (is_new) {
      scenes_.push_back(instance.scene);
      octrees_.push_back(octree);
    }
    scene_of_.push_back(found->second);
  }
}

Status World::loadEnvironment(const EnvironmentPixels& given, const GatherSettings& settings) {
  if (given.pixels == nullptr) return Status::invalidArgument("an environment without pixels");
  int row = 0;
  const auto next = [&]() -> Result<std::span<const glm::vec3>> {
    const std::span<const glm::vec3> pixels(
        given.pixels + std::size_t(given.width) * std::size_t(row++), std::size_t(given.width));
    for (const glm::vec3& pixel : pixels) {
      for (int i = 0; i < 3; ++i) {
        if (pixel[i] >= 0 && std::isfinite(pixel[i])) continue;
        return Status::invalidArgument(fmt::format(
            "row {} of the environment: {}, expected 0 or more, and finite", row - 1, pixel[i]));
      }
    }
    return pixels;
  };
  SURFEIT_ASSIGN_OR_RETURN(
      EnvironmentPicture picture,
      environmentPicture(given.width, given.height, false, next, "environment"));
  EnvironmentPlacement placement = given;
  if (!placement.up) placement.up = scenes_.front().info().up;
  SURFEIT_ASSIGN_OR_RETURN(EnvironmentMap map,
                           EnvironmentMap::create(std::move(picture), placement, "environment"));
  environment_ =
      std::make_unique<LoadedEnvironment>(std::move(map), settings.quality.raster_resolution);
  return take(environment_->memoryBytes(), "an environment");
}

Status World::placeInstances(const std::vector<Instance>& instances) {
  SURFEIT_RETURN_IF_ERROR(take(InstanceTree::memoryBytes(instances.size()),
                               fmt::format("a world of {} instances", instances.size())));
  std::vector<InstancedScene> summaries;
  {
    PagedOctree::Reader reader(*engine_->caches, 1);
    for (const PagedOctree* octree : octrees_) {
      SURFEIT_ASSIGN_OR_RETURN(InstancedScene summary, summaryOf(*octree, reader));
      summaries.push_back(std::move(summary));
    }
  }

  // The middle of all is what places are counted from
  std::vector<Similarity> places;
  places.reserve(instances.size());
  Bounds3d bounds;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    SURFEIT_ASSIGN_OR_RETURN(const Similarity place, similarityOf(instances[i].transform, i));
    const SceneInfo& info = instances[i].scene.info();
    bounds.add(place(0.5 * (info.min + info.max)));
    places.push_back(place);
  }
  origin_ = bounds.centre();

  std::vector<PlacedScene> placed(instances.size());
  float flatness_limit = 0;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const SceneHeader& header = octrees_[scene_of_[i]]->file().header();
    flatness_limit = std::max(flatness_limit, header.flatness_limit);
    placed[i].scene = scene_of_[i];
    placed[i].frame.rotation = glm::mat3(places[i].rotation);
    placed[i].frame.scale = float(places[i].scale);
    placed[i].frame.shift = glm::vec3(places[i](header.origin) - origin_);
  }
  tree_.emplace(summaries, std::move(placed), flatness_limit);
  return {};
}

}  // namespace surfeit
