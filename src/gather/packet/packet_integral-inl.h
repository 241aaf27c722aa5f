// Sums over the pixels of a packet's rasters; for one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_INTEGRAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_INTEGRAL_INL_H_
#undef SURFEIT_PACKET_INTEGRAL_INL_H_
#else
#define SURFEIT_PACKET_INTEGRAL_INL_H_
#endif

#include <hwy/highway.h>
// Needs the instruction set that the former chose
#include <hwy/contrib/math/math-inl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <span>

#include "core/luminance.h"
#include "gather/light/environment_map.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/result_sums.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// What is in a pixel.
struct PixelSight {
  V coverage, occlusion;
  V3 radiosity;  // times the coverage
};

// Sums over the pixels for some of the receivers.
class Integral {
 public:
  Integral(const PacketCanvas& canvas, std::size_t lane)
      : canvas_(canvas),
        rules_(*canvas.rules),
        lane_(lane),
        channels_(PacketCanvas::channels(rules_, canvas.is_translucent)),
        receivers_(*canvas.lanes, lane),
        frames_(*canvas.lanes, lane),
        by_brightness_(rules_.weights.by_brightness && rules_.environment != nullptr) {
    weight_sum_ = bright_sum_ = covered_ = radiosity_.x = radiosity_.y = radiosity_.z =
        hn::Zero(D());
  }

  void AddFace(std::size_t face) {
    const SeenPixels::Face& seen = canvas_.seen->faces[face];
    if (seen.isEmpty()) return;
    const bool has_near = (*canvas_.is_face_used)[face];
    const bool has_more = rules_.has(~std::uint32_t{kOutputOcclusion | kOutputIrradiance});
    near_ = FaceLanes(canvas_.pixels, canvas_, face, lane_, channels_);
    const auto size = std::size_t(canvas_.geometry->resolution());
    const std::size_t first = face * size * size;
    seen.forEachPixel(size, [&](std::size_t in_face) HWY_ATTR {
      const std::size_t i = first + in_face;
      const RasterGeometry::Pixel& pixel = canvas_.geometry->pixels()[i];
      const V direction_weight = WeightOf(pixel.direction);
      const V weight = hn::Mul(direction_weight, Splat(pixel.solid_angle));
      weight_sum_ = hn::Add(weight_sum_, weight);
      const V cover_weight = by_brightness_ ? AddBrightness(i, weight) : weight;
      if (!has_near && !has_more) return;
      const PixelSight sight = has_near ? Look(near_.at(in_face)) : NothingSeen();
      covered_ = hn::MulAdd(cover_weight, sight.occlusion, covered_);
      radiosity_.x = hn::MulAdd(weight, sight.radiosity.x, radiosity_.x);
      radiosity_.y = hn::MulAdd(weight, sight.radiosity.y, radiosity_.y);
      radiosity_.z = hn::MulAdd(weight, sight.radiosity.z, radiosity_.z);
      if (has_more) AddMore(i, direction_weight, weight, sight);
    });
  }

  // What the first of the receivers has in the pixels of a face.
  void ReadFace(std::size_t face, std::span<PixelContent> pixels) const {
    const auto size = std::size_t(canvas_.geometry->resolution());
    const std::size_t first = face * size * size;
    for (std::size_t i = first; i < first + size * size; ++i) {
      const glm::vec3& direction = canvas_.geometry->pixels()[i].direction;
      pixels[i].direction = First(InWorld(direction));
      pixels[i].weight = hn::GetLane(WeightOf(direction));
      pixels[i].environment = First(EnvironmentAt(i));
    }
    if (!(*canvas_.is_face_used)[face]) return;
    const FaceLanes lanes(canvas_.pixels, canvas_, face, lane_, channels_);
    canvas_.seen->faces[face].forEachPixel(size, [&](std::size_t in_face) HWY_ATTR {
      const PixelSight sight = Look(lanes.at(in_face));
      PixelContent& pixel = pixels[first + in_face];
      pixel.coverage = hn::GetLane(sight.coverage);
      pixel.occlusion = hn::GetLane(sight.occlusion);
      pixel.radiosity = First(sight.radiosity);
      pixel.open = glm::vec3(1 - pixel.coverage);
    });
  }

  // Sums of the lanes, and of their weights.
  void Store(std::span<GatherResult> sums, std::span<float> weights) const {
    const D d;
    alignas(64) float lanes[5][kPacketReceivers];
    hn::Store(weight_sum_, d, lanes[0]);
    hn::Store(by_brightness_ ? InDirections(covered_) : covered_, d, lanes[1]);
    hn::Store(radiosity_.x, d, lanes[2]);
    hn::Store(radiosity_.y, d, lanes[3]);
    hn::Store(radiosity_.z, d, lanes[4]);
    for (std::size_t k = 0; k < kStep && lane_ + k < sums.size(); ++k) {
      GatherResult& sum = sums[lane_ + k];
      sum = {};
      weights[lane_ + k] = lanes[0][k];
      sum.occlusion = lanes[1][k];
      sum.irradiance = {lanes[2][k], lanes[3][k], lanes[4][k]};
      const auto more = [&](std::size_t i) {
        return glm::vec3(more_[i].lanes[k], more_[i + 1].lanes[k], more_[i + 2].lanes[k]);
      };
      sum.bent_normal = more(kBentNormal);
      sum.illumination_direction = more(kIllumination);
      sum.environment = more(kEnvironment);
      sum.fluence = more(kFluence);
      for (std::size_t c = 0; c < kShCount; ++c) sum.radiance_sh[c] = more(kSh + 3 * c);
    }
  }

 private:
  static glm::vec3 First(const V3& v) {
    return {hn::GetLane(v.x), hn::GetLane(v.y), hn::GetLane(v.z)};
  }

  // How a direction of the raster weighs (DirectionWeights).
  V WeightOf(const glm::vec3& direction) const {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    const DirectionWeights& weights = *canvas_.weights;
    const bool has_frame = rules_.hasConeRaster();
    const V cosine = has_frame ? Splat(direction.x) : Dot(frames_.x, direction);
    V weight = hn::Max(zero, cosine);
    if (!weights.isPlainCosine()) {
      const M in_front = hn::Gt(cosine, zero);
      if (!weights.isCosine()) weight = hn::IfThenElseZero(in_front, one);
      if (weights.exponent() > 0) {
        const V log = hn::Log(d, hn::Max(cosine, Splat(1e-20f)));
        weight = hn::Mul(weight, hn::Exp(d, hn::Mul(Splat(weights.exponent()), log)));
      }
      if (weights.edgeSlope() > 0) {
        const V part = hn::MulAdd(hn::Sub(cosine, Splat(weights.edgeCosine())),
                                  Splat(weights.edgeSlope()), Splat(0.5f));
        weight = hn::Mul(weight, hn::Min(one, hn::Max(zero, part)));
      }
      const V3 world = InWorld(direction);
      weight = hn::IfThenElseZero(hn::Gt(Dot(receivers_.normal, world), zero), weight);
    }
    return hn::IfThenElse(receivers_.spherical, one, weight);
  }

  V3 InWorld(const glm::vec3& direction) const {
    if (!rules_.hasConeRaster()) {
      return {Splat(direction.x), Splat(direction.y), Splat(direction.z)};
    }
    return {frames_.ToWorld(direction, 0), frames_.ToWorld(direction, 1),
            frames_.ToWorld(direction, 2)};
  }

  static V3 LoadRadiosity(const float* pixel) {
    const D d;
    const float* const at = pixel + PacketCanvas::kCoverageChannels * kStep;
    return {hn::Load(d, at), hn::Load(d, at + kStep), hn::Load(d, at + 2 * kStep)};
  }
  template <typename Float>
  Float* FadedOf(Float* pixel) const {
    return pixel + (PacketCanvas::kCoverageChannels + rules_.channels() - 1) * kStep;
  }

  PixelSight Look(const float* pixel) const {
    const D d;
    const V rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
    PixelSight sight = NothingSeen();
    sight.coverage = hn::Sub(Splat(1), rest);
    if (rules_.hasLight()) sight.radiosity = LoadRadiosity(pixel);
    sight.occlusion = rules_.fades() ? hn::Load(d, FadedOf(pixel)) : sight.coverage;
    return sight;
  }

  static PixelSight NothingSeen() {
    const V zero = hn::Zero(D());
    return {zero, zero, {zero, zero, zero}};
  }

  // pi times the radiance of the environment in the whole pixel.
  V3 EnvironmentAt(std::size_t i) const {
    if (rules_.environment == nullptr) return {hn::Zero(D()), hn::Zero(D()), hn::Zero(D())};
    if (!rules_.hasConeRaster()) {
      const glm::vec3& value = rules_.environment_cube->pixels()[i];
      return {Splat(value.r), Splat(value.g), Splat(value.b)};
    }
    // Every lane looks elsewhere
    const D d;
    const RasterGeometry::Pixel& pixel = canvas_.geometry->pixels()[i];
    const V3 world = InWorld(pixel.direction);
    alignas(64) float lanes[3][kPacketReceivers];
    hn::Store(world.x, d, lanes[0]);
    hn::Store(world.y, d, lanes[1]);
    hn::Store(world.z, d, lanes[2]);
    for (std::size_t k = 0; k < kStep; ++k) {
      const glm::vec3 value =
          rules_.environment->lookup({lanes[0][k], lanes[1][k], lanes[2][k]}, pixel.solid_angle);
      for (int c = 0; c < 3; ++c) lanes[c][k] = value[c];
    }
    return {hn::Load(d, lanes[0]), hn::Load(d, lanes[1]), hn::Load(d, lanes[2])};
  }

  // The weight of a pixel by what light would come through it.
  V AddBrightness(std::size_t i, V weight) {
    const V bright = hn::Mul(weight, Dot(EnvironmentAt(i), kLuminance));
    bright_sum_ = hn::Add(bright_sum_, bright);
    return bright;
  }

  // A part of the light as the sum over directions that is the same part of all of them.
  V InDirections(V sum) const {
    const M is_bright = hn::Gt(bright_sum_, hn::Zero(D()));
    const V divisor = hn::IfThenElse(is_bright, bright_sum_, Splat(1));
    return hn::IfThenElseZero(is_bright, hn::Mul(hn::Div(sum, divisor), weight_sum_));
  }

  void AddMore(std::size_t i, V direction_weight, V weight, const PixelSight& sight) {
    const D d;
    const RasterGeometry::Pixel& pixel = canvas_.geometry->pixels()[i];
    const V open = hn::Sub(Splat(1), sight.coverage);
    const V3 all_around = EnvironmentAt(i);
    const V3 environment = {hn::Mul(open, all_around.x), hn::Mul(open, all_around.y),
                            hn::Mul(open, all_around.z)};
    const V3 light = {hn::Add(sight.radiosity.x, environment.x),
                      hn::Add(sight.radiosity.y, environment.y),
                      hn::Add(sight.radiosity.z, environment.z)};
    if (rules_.has(kOutputEnvironment)) AddTo(kEnvironment, weight, environment);
    if (rules_.has(kOutputBentNormal | kOutputIlluminationDirection)) {
      const V3 world = InWorld(pixel.direction);
      AddTo(kBentNormal, hn::Mul(weight, open), world);
      AddTo(kIllumination, hn::Mul(weight, Dot(light, canvas_.luminance)), world);
    }
    if (!rules_.has(kOutputFluence | kOutputRadianceSh)) return;
    const V seen = hn::IfThenElseZero(hn::Gt(direction_weight, hn::Zero(d)), Splat(1));
    AddTo(kFluence, hn::Mul(seen, Splat(pixel.solid_angle)), light);
    const ShCoefficients basis = shBasis(pixel.direction);
    for (std::size_t c = 0; c < kShCount; ++c) {
      AddTo(kSh + 3 * c, hn::Mul(seen, Splat(pixel.solid_angle * basis[c])), light);
    }
  }

  // Places in more_, three each.
  static constexpr std::size_t kBentNormal = 0, kIllumination = 3, kEnvironment = 6, kFluence = 9,
                               kSh = 12, kMore = kSh + 3 * kShCount;
  struct alignas(64) Sum {
    float lanes[kPacketReceivers] = {};
  };
  void AddTo(std::size_t place, V weight, const V3& value) {
    const D d;
    for (int axis = 0; axis < 3; ++axis, ++place) {
      float* const sum = more_[place].lanes;
      hn::Store(hn::MulAdd(weight, Axis(value, axis), hn::Load(d, sum)), d, sum);
    }
  }

  const PacketCanvas& canvas_;
  const GatherRules& rules_;
  const std::size_t lane_, channels_;
  const Receivers receivers_;
  const Frames frames_;
  FaceLanes near_;  // of the face
  const bool by_brightness_;
  V weight_sum_, bright_sum_, covered_;
  V3 radiosity_;
  std::array<Sum, kMore> more_;
};

void ReadPixels(const PacketCanvas& canvas, std::span<PixelContent> pixels) {
  std::fill(pixels.begin(), pixels.end(), PixelContent{});
  const Integral integral(canvas, 0);
  const auto faces = static_cast<std::size_t>(canvas.geometry->faceCount());
  for (std::size_t face = 0; face < faces; ++face) integral.ReadFace(face, pixels);
}

void Integrate(const PacketCanvas& canvas, std::span<GatherResult> results) {
  const auto faces = static_cast<std::size_t>(canvas.geometry->faceCount());
  std::array<float, kPacketReceivers> weights;
  for (std::size_t lane = 0; lane < results.size(); lane += kStep) {
    Integral integral(canvas, lane);
    for (std::size_t face = 0; face < faces; ++face) integral.AddFace(face);
    integral.Store(results, weights);
  }
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i] = resultOf(results[i], weights[i], *canvas.rules, canvas.lanes->spherical[i] > 0);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
