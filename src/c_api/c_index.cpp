// The C function that makes a scene. Apart from the others: it needs the indexer.
#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>

#include "c_api/c_guard.h"
#include "surfeit/surfel_source.h"

namespace surfeit {
namespace {

// Surfels as C has them; positions are counted from the first.
class CSurfels : public SurfelProvider {
 public:
  CSurfels(const surfeit_surfel* surfels, std::size_t count) : surfels_(surfels), count_(count) {
    const auto any = [&](auto has) { return std::any_of(surfels_, surfels_ + count_, has); };
    channels_.normal = any([](const surfeit_surfel& surfel) {
      return surfel.normal[0] != 0 || surfel.normal[1] != 0 || surfel.normal[2] != 0;
    });
    channels_.radius = any([](const surfeit_surfel& surfel) { return surfel.radius != 0; });
    channels_.area = any([](const surfeit_surfel& surfel) { return surfel.area != 0; });
    channels_.radiosity = channels_.albedo = true;
    channels_.two_sided = any([](const surfeit_surfel& surfel) { return surfel.two_sided != 0; });
    channels_.group = any([](const surfeit_surfel& surfel) { return surfel.group != 0; });
  }

  std::uint64_t count() const override { return count_; }
  CloudChannels channels() const override { return channels_; }
  glm::dvec3 origin() const override {
    const double* const first = surfels_->position;
    const bool is_finite =
        std::isfinite(first[0]) && std::isfinite(first[1]) && std::isfinite(first[2]);
    return is_finite ? glm::dvec3(first[0], first[1], first[2]) : glm::dvec3(0);
  }
  Status read(std::uint64_t first, std::size_t count, Surfel* surfels) override {
    const glm::dvec3 from = origin();
    for (std::size_t i = 0; i < count; ++i) {
      const surfeit_surfel& given = surfels_[first + i];
      if (given.group < 0 || given.group >= std::int32_t(kMaxGroups)) {
        return Status::invalidArgument("surfel " + std::to_string(first + i) + ": group " +
                                       std::to_string(given.group) + ", expected 0 to 63");
      }
      Surfel& surfel = surfels[i] = Surfel();
      for (int axis = 0; axis < 3; ++axis) {
        surfel.position[axis] = float(given.position[axis] - from[axis]);
        surfel.normal[axis] = given.normal[axis];
        surfel.radiosity[axis] = given.radiosity[axis];
        surfel.albedo[axis] = given.albedo[axis];
      }
      surfel.radius = given.radius;
      surfel.area = given.area;
      SURFEIT_RETURN_IF_ERROR(fillSizes(first + i, surfel));
      if (given.two_sided != 0) surfel.flags = kSurfelTwoSided;
      surfel.group = std::uint8_t(given.group);
    }
    return {};
  }

 private:
  // A size that others have and this surfel lacks follows from the other one.
  Status fillSizes(std::uint64_t number, Surfel& surfel) const {
    if (surfel.radius == 0 && surfel.area == 0 && (channels_.radius || channels_.area)) {
      return Status::invalidArgument("surfel " + std::to_string(number) +
                                     ": radius and area are 0, expected one of them, because other "
                                     "surfels have sizes: give all surfels one, or none");
    }
    constexpr double kPi = 3.14159265358979323846;
    const double disk_overlap = IndexOptions().disk_overlap;
    if (channels_.radius && surfel.radius == 0 && surfel.area > 0) {
      surfel.radius = float(std::sqrt(disk_overlap * double(surfel.area) / kPi));
    }
    if (channels_.area && surfel.area == 0 && surfel.radius > 0) {
      surfel.area = float(kPi * double(surfel.radius) * double(surfel.radius) / disk_overlap);
    }
    return {};
  }

  const surfeit_surfel* const surfels_;
  const std::size_t count_;
  CloudChannels channels_;
};

}  // namespace
}  // namespace surfeit

using namespace surfeit;  // NOLINT: what follows has C names

extern "C" {

void surfeit_index_options_init(surfeit_index_options* options) {
  if (options == nullptr) return;
  *options = {};
  options->size = sizeof *options;
}

surfeit_code surfeit_index_surfels(const surfeit_surfel* surfels, size_t count, const char* output,
                                   const surfeit_index_options* options) {
  return guard([&]() -> Status {
    if (surfels == nullptr || count == 0) return missing("surfels");
    if (output == nullptr) return missing("output");
    surfeit_index_options from;
    surfeit_index_options_init(&from);
    SURFEIT_RETURN_IF_ERROR(readOptions(options, "options", from));
    IndexOptions given;
    given.memory_bytes = from.memory_bytes;
    given.threads = from.threads;
    given.full_precision = from.full_precision != 0;
    given.strict = true;  // nobody would hear what is left out
    CSurfels provider(surfels, count);
    Progress progress;
    return indexSurfels(provider, output, given, progress).status();
  });
}

}  // extern "C"
