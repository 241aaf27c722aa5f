#include <algorithm>
#include <array>
#include <vector>

#include "core/luminance.h"
#include "gather/packet/packet_raster.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/result_sums.h"

// What a packet's pixels give, of all colors or of one after the other (docs/algorithm.md,
// "Tints").
namespace surfeit {

void PacketRaster::integrate(std::span<GatherResult> results) {
  luminance_ = kLuminance;
  of_colors_.clear();
  kernel_.integrate(canvas(), results);
  for (GatherResult& result : results) makeDirectionsUnit(result);
}

void PacketRaster::integrateColor(std::span<GatherResult> results) {
  // Of the light of the other colors no direction is told
  luminance_ = glm::vec3(0);
  luminance_[color_] = kLuminance[color_];
  std::array<GatherResult, kPacketReceivers> drawn;
  kernel_.integrate(canvas(), std::span(drawn).first(results.size()));
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (color_ == 0) results[i] = {};
    addColor(drawn[i], color_, results[i]);
    if (color_ == 2) makeDirectionsUnit(results[i]);
  }
  if (recorder_ == nullptr) return;
  std::vector<PixelContent> pixels(geometry_.pixels().size());
  kernel_.readPixels(canvas(), pixels);
  if (color_ == 0) of_colors_.assign(pixels.size(), {.open = glm::vec3(0)});
  for (std::size_t i = 0; i < pixels.size(); ++i) addColor(pixels[i], color_, of_colors_[i]);
}

void PacketRaster::readPixels(std::span<PixelContent> pixels) const {
  if (of_colors_.empty()) return kernel_.readPixels(canvas(), pixels);
  std::copy(of_colors_.begin(), of_colors_.end(), pixels.begin());
}

}  // namespace surfeit
