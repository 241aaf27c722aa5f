// The same surfels in files of other forms give the same scene.

#include <gtest/gtest.h>

#include <span>
#include <string>

#include "octree/test_scenes.h"
#include "storage/byte_output.h"
#include "surfeit/index.h"

namespace surfeit {
namespace {

class IndexFormatsTest : public SceneTest {
 protected:
  // A scene of the cloud, after it was written once more under a name that asks for compression.
  std::string sceneOfCopy(const std::string& name) {
    Result<ByteOutput> file = ByteOutput::create(path(name));
    EXPECT_TRUE(file.ok());
    const std::string cloud = contents("cloud.ply");
    EXPECT_TRUE(file->append(std::as_bytes(std::span(cloud))).ok());
    EXPECT_TRUE(file->commit().ok());
    indexFiles({path(name)}, path(name + ".sft"));
    return contents(name + ".sft");
  }
};

TEST_F(IndexFormatsTest, CompressedCloudsGiveTheSameScene) {
  for (const CloudChannels& channels : {kAllChannels, kPositionsOnly}) {
    writeCloud(path("cloud.ply"), randomCloud(20'000), channels);
    indexFiles({path("cloud.ply")}, path("plain.sft"));
    const std::string plain = contents("plain.sft");
    ASSERT_GT(plain.size(), 100'000u);
    EXPECT_TRUE(sceneOfCopy("copy.ply.gz") == plain);
    EXPECT_TRUE(sceneOfCopy("copy.ply.zst") == plain);
  }
}

TEST_F(IndexFormatsTest, PlainAndCompressedCloudsMix) {
  const std::vector<Surfel> cloud = randomCloud(10'000);
  writeCloud(path("cloud.ply"), cloud);
  indexFiles({path("cloud.ply")}, path("whole.sft"));
  writeCloud(path("a.ply"), std::span(cloud).first(3000));
  writeCloud(path("cloud.ply"), std::span(cloud).subspan(3000));
  sceneOfCopy("b.ply.gz");
  indexFiles({path("a.ply"), path("b.ply.gz")}, path("both.sft"));
  EXPECT_TRUE(contents("both.sft") == contents("whole.sft"));
}

}  // namespace
}  // namespace surfeit
