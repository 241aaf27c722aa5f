#include "bench/internal/embree_peers.h"

#include <fmt/format.h>
#if defined(__x86_64__)
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/vec2.hpp>
#include <limits>
#include <utility>

#include "core/square_strata.h"

namespace surfeit {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();
// Rays for choosing what is best for a peer.
constexpr int kTrialRays = 256;
// Starts of rays above disks, in their radii.
constexpr float kDiskOffsets[] = {0.001f, 0.005f, 0.02f, 0.1f, 0.5f};

// Flushes denormals to zero while it lives, as Embree recommends.
class FlushedDenormals {
 public:
#if defined(__x86_64__)
  FlushedDenormals() : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | _MM_FLUSH_ZERO_ON | _MM_DENORMALS_ZERO_ON);
  }
  ~FlushedDenormals() { _mm_setcsr(before_); }

 private:
  unsigned before_;
#endif
};

// Rays and hits with the layout of RTCRayHit, RTCRayHit8 and RTCRayHit16.
template <int kLanes>
struct alignas(64) Packet {
  float org_x[kLanes], org_y[kLanes], org_z[kLanes], tnear[kLanes];
  float dir_x[kLanes], dir_y[kLanes], dir_z[kLanes], time[kLanes];
  float tfar[kLanes];
  unsigned mask[kLanes], id[kLanes], flags[kLanes];
  float normal_x[kLanes], normal_y[kLanes], normal_z[kLanes], u[kLanes], v[kLanes];
  unsigned primitive[kLanes], geometry[kLanes], instance[kLanes];
};

template <int kLanes>
void occluded(RTCScene scene, RTCIntersectContext& context, const int* valid,
              Packet<kLanes>& packet) {
  if constexpr (kLanes == 1) {
    static_cast<void>(valid);
    rtcOccluded1(scene, &context, reinterpret_cast<RTCRay*>(&packet));
  } else if constexpr (kLanes == 8) {
    rtcOccluded8(valid, scene, &context, reinterpret_cast<RTCRay8*>(&packet));
  } else {
    rtcOccluded16(valid, scene, &context, reinterpret_cast<RTCRay16*>(&packet));
  }
}

template <int kLanes>
void intersect(RTCScene scene, RTCIntersectContext& context, const int* valid,
               Packet<kLanes>& packet) {
  if constexpr (kLanes == 1) {
    static_cast<void>(valid);
    rtcIntersect1(scene, &context, reinterpret_cast<RTCRayHit*>(&packet));
  } else if constexpr (kLanes == 8) {
    rtcIntersect8(valid, scene, &context, reinterpret_cast<RTCRayHit8*>(&packet));
  } else {
    rtcIntersect16(valid, scene, &context, reinterpret_cast<RTCRayHit16*>(&packet));
  }
}

template <int kLanes>
class RayWorker : public Worker {
 public:
  RayWorker(const PeerScene& scene, GatherMode mode, const RayDirections& directions,
            bool is_coherent, bool is_exact)
      : scene_(scene),
        is_bleeding_(mode == GatherMode::kBleeding),
        directions_(directions),
        exact_(is_exact ? scene.exact : nullptr),
        x_(std::size_t(directions.rays())),
        y_(x_),
        z_(x_) {
    rtcInitIntersectContext(&context_);
    context_.flags =
        is_coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    for (int i = 0; i < kLanes; ++i) {
      valid_[i] = -1;
      packet_.tnear[i] = packet_.time[i] = 0;
      packet_.mask[i] = ~0u, packet_.id[i] = unsigned(i), packet_.flags[i] = 0;
      packet_.instance[i] = RTC_INVALID_GEOMETRY_ID;
    }
  }

  Status gather(const ReceiverSet& set, std::size_t begin, std::size_t end,
                std::span<GatherResult> results) override {
    [[maybe_unused]] const FlushedDenormals flushed;
    for (std::size_t i = begin; i < end; ++i) {
      const LocalReceiver& receiver = set.receivers[i];
      directions_.turn(receiver.normal, i, x_.data(), y_.data(), z_.data());
      const float offset = scene_.offset + scene_.offset_radii * set.radii[i];
      const glm::vec3 origin = receiver.position + offset * receiver.normal;
      for (int lane = 0; lane < kLanes; ++lane) {
        packet_.org_x[lane] = origin.x;
        packet_.org_y[lane] = origin.y;
        packet_.org_z[lane] = origin.z;
      }
      results[i - begin] = is_bleeding_ ? traceBleeding(origin) : traceOcclusion();
    }
    return {};
  }

 private:
  void aim(int first) {
    std::memcpy(packet_.dir_x, &x_[std::size_t(first)], sizeof packet_.dir_x);
    std::memcpy(packet_.dir_y, &y_[std::size_t(first)], sizeof packet_.dir_y);
    std::memcpy(packet_.dir_z, &z_[std::size_t(first)], sizeof packet_.dir_z);
    std::fill_n(packet_.tfar, kLanes, kFar);
  }

  GatherResult traceOcclusion() {
    int hits = 0;
    for (int first = 0; first < directions_.rays(); first += kLanes) {
      aim(first);
      occluded<kLanes>(scene_.embree->handle(), context_, valid_, packet_);
      for (int i = 0; i < kLanes; ++i) hits += packet_.tfar[i] < 0 ? 1 : 0;  // -inf
    }
    return {float(hits) / float(directions_.rays()), glm::vec3(0)};
  }

  GatherResult traceBleeding(const glm::vec3& origin) {
    int hits = 0;
    glm::vec4 sum(0);
    for (int first = 0; first < directions_.rays(); first += kLanes) {
      aim(first);
      std::fill_n(packet_.geometry, kLanes, RTC_INVALID_GEOMETRY_ID);
      intersect<kLanes>(scene_.embree->handle(), context_, valid_, packet_);
      for (int i = 0; i < kLanes; ++i) {
        if (packet_.geometry[i] == RTC_INVALID_GEOMETRY_ID) continue;
        ++hits;
        sum += exact_ == nullptr ? scene_.radiosity[packet_.primitive[i]] : shade(i, origin);
      }
    }
    const float weight = 1 / float(directions_.rays());
    return {float(hits) * weight, weight * glm::vec3(sum)};
  }

  glm::vec4 shade(int lane, const glm::vec3& origin) const {
    const glm::vec3 direction(packet_.dir_x[lane], packet_.dir_y[lane], packet_.dir_z[lane]);
    const std::uint32_t material = exact_->mesh.triangle_material[packet_.primitive[lane]];
    return glm::vec4(radiosityAt(*exact_, material, origin + packet_.tfar[lane] * direction), 0);
  }

  const PeerScene& scene_;
  const bool is_bleeding_;
  const RayDirections& directions_;
  const SceneGeometry* const exact_;
  RTCIntersectContext context_;
  std::vector<float> x_, y_, z_;
  alignas(64) int valid_[kLanes];
  Packet<kLanes> packet_;
};

// Turns vectors from the frame (tangent, bitangent, normal) to the world.
SURFEIT_BENCH_CLONES void turnAll(const glm::vec3& tangent, const glm::vec3& bitangent,
                                  const glm::vec3& normal, int count,
                                  const float* __restrict local_x, const float* __restrict local_y,
                                  const float* __restrict local_z, float* __restrict x,
                                  float* __restrict y, float* __restrict z) {
  const glm::vec3 a = tangent, b = bitangent, c = normal;
  for (int i = 0; i < count; ++i) {
    x[i] = local_x[i] * a.x + local_y[i] * b.x + local_z[i] * c.x;
    y[i] = local_x[i] * a.y + local_y[i] * b.y + local_z[i] * c.y;
    z[i] = local_x[i] * a.z + local_y[i] * b.z + local_z[i] * c.z;
  }
}

// Disks that cover as much as their surfels stand for, without overlap.
std::vector<float> radiiOfAreas(std::span<const Surfel> surfels) {
  std::vector<float> radii;
  radii.reserve(surfels.size());
  for (const Surfel& surfel : surfels) radii.push_back(std::sqrt(surfel.area / 3.14159265f));
  return radii;
}

std::vector<float> radiiOf(std::span<const Surfel> surfels) {
  std::vector<float> radii;
  radii.reserve(surfels.size());
  for (const Surfel& surfel : surfels) radii.push_back(surfel.radius);
  return radii;
}

}  // namespace

RayDirections::RayDirections(int rays) : rays_(rays) {
  const int side = int(std::lround(std::sqrt(double(rays))));
  for (std::size_t set = 0; set < kSets; ++set) {
    for (const glm::vec3& direction : stratifiedCosineDirections(side, mixBits(1000 + set))) {
      x_.push_back(direction.x);
      y_.push_back(direction.y);
      z_.push_back(direction.z);
    }
  }
  for (std::size_t i = 0; i < kAngles; ++i) {
    const float angle = 6.2831853f * float(i) / float(kAngles);
    angles_.emplace_back(std::cos(angle), std::sin(angle));
  }
}

void RayDirections::turn(const glm::vec3& normal, std::size_t receiver, float* x, float* y,
                         float* z) const {
  const std::uint64_t hash = mixBits(receiver + 1);
  const std::size_t first = hash % kSets * std::size_t(rays_);
  const glm::vec2 angle = angles_[(hash >> 32) % kAngles];
  const TangentFrame frame(normal);
  turnAll(angle.x * frame.x + angle.y * frame.y, angle.x * frame.y - angle.y * frame.x, normal,
          rays_, &x_[first], &y_[first], &z_[first], x, y, z);
}

std::unique_ptr<Worker> makeRayWorker(const PeerScene& scene, GatherMode mode,
                                      const RayDirections& directions, const RayShape& shape,
                                      bool is_exact) {
  if (shape.lanes == 1) {
    return std::make_unique<RayWorker<1>>(scene, mode, directions, shape.is_coherent, is_exact);
  }
  if (shape.lanes == 8) {
    return std::make_unique<RayWorker<8>>(scene, mode, directions, shape.is_coherent, is_exact);
  }
  return std::make_unique<RayWorker<16>>(scene, mode, directions, shape.is_coherent, is_exact);
}

Result<PeerScene> makeTrianglePeer(const GatherScene& scene, bool rejects_backs, int threads) {
  const SceneGeometry& geometry = scene.geometry();
  SURFEIT_ASSIGN_OR_RETURN(
      EmbreeScene embree,
      EmbreeScene::ofTriangles(geometry, {.rejects_backs = rejects_backs, .threads = threads}));
  PeerScene peer{.name = rejects_backs ? "triangles, fronts" : "triangles"};
  peer.notes = fmt::format("{} triangles, {:.1f} s to build", geometry.mesh.triangle.size(),
                           embree.buildSeconds());
  peer.embree = std::make_unique<EmbreeScene>(std::move(embree));
  peer.offset = geometry.ray_offset;
  peer.exact = &geometry;
  for (std::size_t i = 0; i < geometry.mesh.triangle.size(); ++i) {
    const glm::uvec3& corner = geometry.mesh.triangle[i];
    const glm::vec3 middle = (geometry.mesh.position[corner.x] + geometry.mesh.position[corner.y] +
                              geometry.mesh.position[corner.z]) /
                             3.f;
    peer.radiosity.emplace_back(radiosityAt(geometry, geometry.mesh.triangle_material[i], middle),
                                0);
  }
  return peer;
}

Result<PeerScene> makeDiskPeer(const GatherScene& scene, std::span<const Surfel> surfels,
                               const ReceiverSet& set, std::span<const GatherResult> truth,
                               int threads) {
  PeerScene peer{.name = "disks"};
  double area = 0, disk_area = 0;
  for (const Surfel& surfel : surfels) {
    peer.radiosity.emplace_back(surfel.radiosity, 0);
    area += double(surfel.area);
    disk_area += 3.14159265 * double(surfel.radius) * double(surfel.radius);
  }
  const RayDirections directions(kTrialRays);
  const EmbreeBuild build{.rejects_backs = !scene.geometry().is_two_sided, .threads = threads};
  double least_error = std::numeric_limits<double>::infinity();
  std::unique_ptr<EmbreeScene> best;
  float best_offset = 0;
  std::string chosen;
  for (const bool is_given : {true, false}) {
    // Its memory is large: at most the best one and the one on trial at a time
    SURFEIT_ASSIGN_OR_RETURN(
        EmbreeScene embree,
        EmbreeScene::ofDisks(surfels, is_given ? radiiOf(surfels) : radiiOfAreas(surfels), build));
    peer.embree = std::make_unique<EmbreeScene>(std::move(embree));
    peer.notes +=
        fmt::format("{}radii {} ({:.1f} s to build):", is_given ? "" : "; ",
                    is_given ? "of the cloud" : "of the areas", peer.embree->buildSeconds());
    bool is_best = false;
    for (const float offset : kDiskOffsets) {
      peer.offset_radii = offset;
      const auto worker = makeRayWorker(peer, GatherMode::kBleeding, directions, {}, false);
      SURFEIT_ASSIGN_OR_RETURN(const std::vector<GatherResult> results,
                               gatherJudged(set, 1, *worker));
      const ErrorSummary errors = summarise(results, truth);
      peer.notes +=
          fmt::format(" offset {}: {:.4f}/{:.4f}", offset, errors.rmse, errors.color_rmse);
      if (errors.color_rmse >= least_error) continue;
      least_error = errors.color_rmse;
      best_offset = offset;
      is_best = true;
      chosen =
          fmt::format("radii {}, offset {}", is_given ? "of the cloud" : "of the areas", offset);
    }
    if (is_best) best = std::move(peer.embree);
  }
  peer.embree = std::move(best);
  peer.offset_radii = best_offset;
  peer.notes = fmt::format(
      "{}; disks have {:.2f} times their surfels' area; tried (occlusion RMSE / color RMSE) {}",
      chosen, disk_area / area, peer.notes);
  return peer;
}

Status chooseRayShapes(const ReceiverSet& set, PeerScene& scene) {
  constexpr std::size_t kTrialPerRun = 16;
  constexpr int kTrials = 2;  // the better one counts
  const RayDirections directions(kTrialRays);
  for (const GatherMode mode : {GatherMode::kOcclusion, GatherMode::kBleeding}) {
    RayShape best;
    double best_rate = 0;
    scene.notes += mode == GatherMode::kOcclusion ? "; occlusion" : "; color";
    for (const int lanes : {1, 8, 16}) {
      for (const bool is_coherent : {false, true}) {
        const RayShape shape{lanes, is_coherent};
        std::vector<std::unique_ptr<Worker>> workers;
        workers.push_back(makeRayWorker(scene, mode, directions, shape, false));
        double rate = 0;
        for (int trial = 0; trial < kTrials; ++trial) {
          SURFEIT_ASSIGN_OR_RETURN(const Timing timing, timeGather(set, kTrialPerRun, workers));
          rate = std::max(rate, timing.rate());
        }
        scene.notes += fmt::format(" {}{}: {:.0f}", lanes, is_coherent ? "c" : "i", rate);
        if (rate <= best_rate) continue;
        best_rate = rate;
        best = shape;
      }
    }
    (mode == GatherMode::kOcclusion ? scene.occlusion_shape : scene.bleeding_shape) = best;
  }
  return {};
}

}  // namespace surfeit
