// What the lanes of a packet see is what the raster of each receiver alone sees.
#include "gather/packet_raster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "gather/receiver_raster.h"

namespace surfeit {
namespace {

// A piece of a bent surface: its normals lean up to .27 either way.
Node bentNode() {
  Node node{};
  node.radius = .5f;
  node.normal = {1, 0, 0};
  node.flatness = .975f;
  node.flags = kNodeFlat;
  node.area = .6f;
  node.radiosity = {.5f, .6f, .7f};
  node.surfel_count = 100;
  node.groups = 1;
  node.covariance.entries = {.002f, .05f, .05f, 0, 0, 0};
  return node;
}

// From where the node faces them to where it turns away.
std::vector<Receiver> receiversAlongTheRim() {
  std::vector<Receiver> receivers;
  for (int i = 0; i < int(kPacketReceivers); ++i) {
    receivers.push_back({{.2f * float(i) - 1.5f, 0, -3}, {0, 0, 1}});
  }
  return receivers;
}

TEST(PacketRaster, EveryReceiverSeesItsOwnPartOfWhatIsBent) {
  const Node node = bentNode();
  const std::vector<Receiver> receivers = receiversAlongTheRim();
  for (const GatherSides sides : {GatherSides::kFront, GatherSides::kBack}) {
    GatherQuality quality;
    quality.sides = sides;
    const GatherRules rules(GatherMode::kBleeding, quality);
    PacketRaster packet(rules);
    packet.begin(receivers, viewPacket(receivers));
    packet.addNode(node);
    packet.sort();
    packet.draw();
    std::vector<GatherResult> results(receivers.size());
    packet.integrate(results);

    ReceiverRaster alone(rules);
    float least = 1, most = 0;
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      alone.begin(receivers[i]);
      alone.addNode(node);
      const GatherResult expected = alone.finish();
      EXPECT_NEAR(results[i].occlusion, expected.occlusion, 1e-5) << i << ' ' << int(sides);
      EXPECT_NEAR(results[i].irradiance.x, expected.irradiance.x, 1e-5) << i << ' ' << int(sides);
      least = std::min(least, expected.occlusion);
      most = std::max(most, expected.occlusion);
    }
    EXPECT_EQ(least, 0);
    EXPECT_GT(most, .005f);
  }
}

// Lanes without receivers are left out, whole vectors of them, and hold what was drawn before.
TEST(PacketRaster, FewReceiversSeeTheSameAsInAFullPacket) {
  const Node node = bentNode();
  std::vector<Receiver> receivers = receiversAlongTheRim();
  std::reverse(receivers.begin(), receivers.end());
  const PacketView view = viewPacket(receivers);
  const GatherRules rules(GatherMode::kBleeding, {});
  for (const PacketKernel& kernel : packetKernels()) {
    PacketRaster packet(rules, kernel);
    const auto gather = [&](std::size_t count) {
      packet.begin(std::span(receivers).first(count), view);
      packet.addNode(node);
      packet.sort();
      packet.draw();
      std::vector<GatherResult> results(count);
      packet.integrate(results);
      return results;
    };
    const std::vector<GatherResult> all = gather(receivers.size());
    EXPECT_GT(all[0].occlusion, 0);
    for (const std::size_t count : {1, 4, 5, 8, 9, 15}) {
      const std::vector<GatherResult> few = gather(count);
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(few[i].occlusion, all[i].occlusion) << kernel.name << ' ' << count << ' ' << i;
        EXPECT_EQ(few[i].irradiance, all[i].irradiance) << kernel.name << ' ' << count << ' ' << i;
      }
    }
  }
}

}  // namespace
}  // namespace surfeit
