#include "bounce/bounce_crew.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>

#include "core/worker_threads.h"
#include "surfels/rows/surfel_mapping.h"

namespace surfeit {
namespace {

// Where few receivers are chosen, stretches of so many pages fill clusters with them; longer ones
// would take more memory and gain little.
constexpr int kMostPages = 16;

std::uint32_t pagesOfStretch(int surfels_per_receiver) {
  return static_cast<std::uint32_t>(std::min(surfels_per_receiver, kMostPages));
}

}  // namespace

// Neighbouring surfel pages on their way. Its memory is used again by the next.
struct BounceCrew::Stretch {
  explicit Stretch(int surfels_per_receiver) : receivers(surfels_per_receiver) {}

  std::vector<Surfel> surfels;       // of all pages, with B_0
  std::vector<glm::vec3> before;     // B_{k-1}
  std::vector<std::size_t> ends;     // of the pages, in surfels
  std::vector<glm::vec3> radiosity;  // B_k of a page
  BounceReceivers receivers;
  std::vector<Lobe> lobes;                              // of a page
  std::vector<glm::vec3> irradiance;                    // at the receivers
  std::vector<glm::vec3> around, towards;               // the same of ArrivingLight
  std::array<GatherResult, kClusterReceivers> results;  // of a cluster
  SceneFile::Scratch scratch;
};

std::uint64_t BounceCrew::threadBytes(const SceneFile& scene, int surfels_per_receiver,
                                      bool is_glossy) {
  const std::uint64_t surfels =
      std::uint64_t{pagesOfStretch(surfels_per_receiver)} * scene.header().surfel_group_capacity;
  // Vectors that grow by doubling, of up to two receivers a surfel
  const std::uint64_t glossy_bytes = is_glossy ? 8 * sizeof(glm::vec3) + 4 * sizeof(Lobe) : 0;
  return surfels * (sizeof(Surfel) + 7 * sizeof(glm::vec3) + glossy_bytes) + sizeof(Stretch) +
         2 * BounceReceivers::memoryBytes(surfels) + scene.pages().maxStoredBytes() +
         scene.pages().maxPayloadBytes() + 2 * kDirectAlignment;
}

Status BounceCrew::run() {
  return runOnThreads(setup_.threads, failure_, "gather", [this] { return gatherStretches(); });
}

Status BounceCrew::gatherStretches() {
  ThreadGatherer gatherer(setup_.world);
  const auto stretch_memory = std::make_unique<Stretch>(setup_.surfels_per_receiver);
  Stretch& stretch = *stretch_memory;
  const std::uint32_t pages = pagesOfStretch(setup_.surfels_per_receiver);
  while (!failure_.happened()) {
    const std::uint32_t first_page = next_page_.fetch_add(pages * setup_.stride);
    if (first_page >= setup_.scene.surfelPageCount()) return {};
    SURFEIT_RETURN_IF_ERROR(load(first_page, gatherer.reader(), stretch));
    stretch.receivers.choose(stretch.surfels);
    SURFEIT_RETURN_IF_ERROR(gather(gatherer, stretch));
    SURFEIT_RETURN_IF_ERROR(handIn(first_page, stretch));
  }
  return {};
}

Status BounceCrew::load(std::uint32_t first_page, PagedOctree::Reader& reader,
                        Stretch& stretch) const {
  const SceneFile& scene = setup_.scene;
  const std::uint32_t capacity = scene.header().surfel_group_capacity;
  const std::uint32_t end_page =
      std::min(first_page + pagesOfStretch(setup_.surfels_per_receiver), scene.surfelPageCount());
  stretch.surfels.resize(std::size_t{end_page - first_page} * capacity);
  stretch.before.clear();
  stretch.ends.clear();
  std::size_t end = 0;
  for (std::uint32_t page = first_page; page < end_page; ++page) {
    SURFEIT_ASSIGN_OR_RETURN(
        const std::uint32_t count,
        scene.decodeSurfels(page, stretch.scratch, std::span(stretch.surfels).subspan(end)));
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> before, reader.surfels(page, 0, count));
    for (const Surfel& surfel : before) stretch.before.push_back(surfel.radiosity);
    end += count;
    stretch.ends.push_back(end);
    if (stretch.before.size() != end) {
      return Status::failed(
          fmt::format("{}: surfel page {}: {} surfels in the bounce before, "
                      "expected {}: the file changed meanwhile",
                      scene.path(), page, before.size(), count));
    }
  }
  stretch.surfels.resize(end);
  return {};
}

// In clusters of about the same size, the longest there may be.
Status BounceCrew::gather(ThreadGatherer& gatherer, Stretch& stretch) const {
  const std::span<const LocalReceiver> receivers = stretch.receivers.receivers();
  stretch.irradiance.clear();
  stretch.around.clear();
  stretch.towards.clear();
  const std::size_t clusters = (receivers.size() + kClusterReceivers - 1) / kClusterReceivers;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= clusters; ++i) {
    if (setup_.progress.isCancelled()) return Status::interrupted();
    const std::size_t count = receivers.size() * i / clusters - begin;
    const std::span<GatherResult> results = std::span(stretch.results).first(count);
    SURFEIT_RETURN_IF_ERROR(gatherer.gather(receivers.subspan(begin, count), results));
    for (const GatherResult& result : results) {
      stretch.irradiance.push_back(result.irradiance);
      if (setup_.gloss == nullptr) continue;
      const ArrivingLight light = arrivingLight(result.radiance_sh);
      stretch.around.emplace_back(light.around);
      stretch.towards.push_back(light.towards);
    }
    begin += count;
  }
  return {};
}

// albedo E by the look; a look that is off leaves every bit.
glm::vec3 BounceCrew::reflected(const Surfel& surfel, const glm::vec3& irradiance) const {
  const bool has_two_sides = surfel.isTwoSided() && !surfel.isSphere();
  const glm::vec3 normal = surfel.isSphere() ? glm::vec3(0) : surfel.normal;
  const glm::vec3 arriving =
      lookedAt(setup_.look, irradiance, surfel.position, normal, has_two_sides);
  return corrected(setup_.of_groups[surfel.group], surfel.albedo * arriving);
}

// Light that arrives at neighbours is mixed as their irradiance is.
Lobe BounceCrew::lobeOf(std::size_t i, const glm::vec3& sent, const glm::vec3& radiosity,
                        const Stretch& stretch) {
  const Surfel& surfel = stretch.surfels[i];
  const Gloss& gloss = (*setup_.gloss)[surfel.group];
  if (gloss.share == 0) return {};
  if (surfel.isSphere() || surfel.isTwoSided()) {
    ++without_mirror_;
    return {};
  }
  const ArrivingLight light = {.around = stretch.receivers.irradiance(i, stretch.around).x,
                               .towards = stretch.receivers.irradiance(i, stretch.towards)};
  return mirrorLobe(gloss, light, surfel.normal, sent, radiosity);
}

// B_k = B_0 + albedo E (memo 7.4).
Status BounceCrew::handIn(std::uint32_t first_page, Stretch& stretch) {
  float largest_change = 0;
  std::size_t i = 0;
  for (std::size_t page = 0; page < stretch.ends.size(); ++page) {
    stretch.radiosity.clear();
    stretch.lobes.clear();
    for (; i < stretch.ends[page]; ++i) {
      const Surfel& surfel = stretch.surfels[i];
      const glm::vec3 irradiance = stretch.receivers.irradiance(i, stretch.irradiance);
      const glm::vec3 sent = reflected(surfel, irradiance);
      const glm::vec3 radiosity = glm::min(surfel.radiosity + sent, glm::vec3(kLargestColor));
      const glm::vec3 change = glm::abs(radiosity - stretch.before[i]);
      largest_change = std::max({largest_change, change.r, change.g, change.b});
      stretch.radiosity.push_back(radiosity);
      if (setup_.gloss != nullptr) stretch.lobes.push_back(lobeOf(i, sent, radiosity, stretch));
    }
    SURFEIT_RETURN_IF_ERROR(setup_.radiosity.put(first_page + static_cast<std::uint32_t>(page),
                                                 stretch.radiosity, stretch.lobes));
  }
  noteChange(largest_change);
  receivers_ += stretch.receivers.receivers().size();
  surfels_ += stretch.surfels.size();
  setup_.progress.advance(stretch.surfels.size());
  setup_.controller.advance(stretch.receivers.receivers().size());
  return {};
}

void BounceCrew::noteChange(float change) {
  float largest = largest_change_.load();
  while (change > largest && !largest_change_.compare_exchange_weak(largest, change)) {
  }
}

}  // namespace surfeit
