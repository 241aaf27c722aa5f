// A cloud indexed and opened with everything in memory, for the gather's tests.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/long_side.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/test_clouds.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {

// A cloud as a paged octree, all in memory.
class TestScene {
 public:
  explicit TestScene(const std::vector<Surfel>& cloud) {
    CloudChannels channels;
    channels.normal = channels.radius = channels.area = channels.radiosity = true;
    channels.two_sided = true;
    channels.long_side = std::any_of(cloud.begin(), cloud.end(), [](const Surfel& surfel) {
      return surfel.long_side != kNoLongSide;
    });
    channels.group = std::any_of(cloud.begin(), cloud.end(),
                                 [](const Surfel& surfel) { return surfel.group != 0; });
    channels.opacity = channels.tint = std::any_of(
        cloud.begin(), cloud.end(), [](const Surfel& surfel) { return surfel.isTinted(); });
    const std::string cloud_path = directory_.file("cloud.ply"), path = directory_.file("c.sft");
    Result<SurfelWriter> writer = SurfelWriter::create(cloud_path, channels);
    expectOk(writer.status());
    expectOk(writer->write(cloud));
    expectOk(writer->finish());
    readBack(cloud_path, cloud.size());
    IndexOptions options;
    options.full_precision = true;
    options.origin = glm::dvec3(0);  // receivers are given about it
    Progress progress;
    expectOk(indexClouds({cloud_path}, path, options, progress).status());
    Result<SceneFile> file = SceneFile::open(path);
    expectOk(file.status());
    Result<PagedOctree::Memory> memory =
        PagedOctree::planMemory(*file, PagedOctree::unlimitedCacheBytes(*file), 1);
    expectOk(memory.status());
    Result<std::unique_ptr<PagedOctree>> octree = PagedOctree::create(std::move(*file), *memory);
    expectOk(octree.status());
    octree_ = std::move(*octree);
    reader_ = std::make_unique<PagedOctree::Reader>(*octree_);
  }

  GatherResult gather(const LocalReceiver& receiver, const GatherQuality& quality,
                      GatherMode mode = GatherMode::kBleeding) {
    return gather(receiver, GatherRules(mode, quality));
  }
  GatherResult gather(const LocalReceiver& receiver, const GatherRules& rules) {
    PacketGatherer gatherer(rules);
    GatherResult result;
    expectOk(gatherer.gather({&receiver, 1}, *reader_, {&result, 1}));
    work_ = gatherer.work();
    return result;
  }
  PagedOctree::Reader& reader() { return *reader_; }
  std::string path() const { return directory_.file("c.sft"); }
  // The surfels as they are read: with normals normalized once more, in their last bits.
  const std::vector<Surfel>& cloud() const { return cloud_; }
  const PacketGatherer::Work& work() const { return work_; }

 private:
  static void expectOk(const Status& status) { ASSERT_TRUE(status.ok()) << status.message(); }

  void readBack(const std::string& path, std::size_t count) {
    Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(path, true);
    expectOk(source.status());
    cloud_.resize(count);
    for (std::size_t got = 0; got < count;) {
      const Result<std::size_t> read = (*source)->read(std::span(cloud_).subspan(got));
      expectOk(read.status());
      if (*read == 0) break;
      got += *read;
    }
  }

  TestDirectory directory_;
  std::vector<Surfel> cloud_;
  std::unique_ptr<PagedOctree> octree_;
  std::unique_ptr<PagedOctree::Reader> reader_;
  PacketGatherer::Work work_;
};

}  // namespace surfeit
