// Scenes whose file is not what it was when it was opened: it rots on the disk, or another one
// takes its name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/job_limits.h"
#include "io/fault_injector.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

// Holds the first read at an offset until others may be taken to wait for its page.
class HeldRead : public FaultInjector {
 public:
  HeldRead(std::uint64_t offset, std::function<bool()> may_go)
      : offset_(offset), may_go_(std::move(may_go)) {}
  int before(CallInfo& info) override {
    if (info.call != Call::kPread || info.offset != offset_ || was_held_.exchange(true)) return 0;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!may_go_() && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return 0;
  }

 private:
  const std::uint64_t offset_;
  std::function<bool()> may_go_;
  std::atomic<bool> was_held_{false};
};

class ChangingSceneTest : public SceneTest {
 protected:
  static constexpr int kThreads = 4;

  std::string smallPages(std::size_t count, std::uint32_t seed) {
    IndexOptions options;
    options.leaf_capacity = 4;
    options.full_precision = true;
    return index(randomCloud(count, seed), kAllChannels, options);
  }

  // With the fewest frames that so many threads can work with: what was read is soon gone.
  static std::unique_ptr<PagedOctree> openInLittleMemory(const std::string& scene) {
    Result<SceneFile> file = SceneFile::open(scene);
    EXPECT_TRUE(file.ok()) << file.status().message();
    const auto memory =
        PagedOctree::planMemory(*file, PagedOctree::leastCacheBytes(*file, kThreads), kThreads);
    EXPECT_TRUE(memory.ok()) << memory.status().message();
    Result<std::unique_ptr<PagedOctree>> octree = PagedOctree::create(std::move(*file), *memory);
    EXPECT_TRUE(octree.ok()) << octree.status().message();
    return std::move(*octree);
  }

  static void flipByte(const std::string& file, std::uint64_t offset) {
    std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
    stream.seekg(static_cast<std::streamoff>(offset));
    const char byte = static_cast<char>(stream.get() ^ 0x10);
    stream.seekp(static_cast<std::streamoff>(offset));
    stream.put(byte);
  }

  // The surfels of a page as bytes, or the message of the failure.
  static std::string read(PagedOctree::Reader& reader, std::uint32_t page) {
    const auto surfels = reader.surfels(page, 0, ~std::uint64_t{0});
    if (!surfels.ok()) {
      EXPECT_EQ(surfels.status().code(), StatusCode::kCorruption);
      return surfels.status().message();
    }
    return {reinterpret_cast<const char*>(surfels->data()), surfels->size_bytes()};
  }
};

TEST_F(ChangingSceneTest, PageThatRotsBetweenTwoReadsIsToldToAllWhoWaitForIt) {
  const std::string scene = smallPages(40'000, 1);
  const auto octree = openInLittleMemory(scene);
  const PageFile& pages = octree->file().pages();
  const std::uint32_t page = 3, count = octree->file().surfelPageCount();
  const std::uint32_t file_page = octree->file().nodePageCount() + page;
  const std::uint64_t offset = pages.entry(file_page).offset;

  // Sound, and gone from the cache
  std::string sound;
  std::vector<std::string> others;
  {
    PagedOctree::Reader reader(*octree);
    sound = read(reader, page);
    EXPECT_THAT(sound, testing::Not(HasSubstr("checksum")));
    for (std::uint32_t other = 4; other < count; ++other) others.push_back(read(reader, other));
    ASSERT_FALSE(octree->surfelCache().isLoaded(page));
  }

  // Rotten: one thread reads it, the others wait for the same read
  flipByte(scene, offset + 5);
  const std::string expected = scene + ": page " + std::to_string(file_page) + " at " +
                               std::to_string(offset) + ": checksum";
  const std::uint64_t waits = octree->surfelCache().counters().waits;
  std::atomic<int> told{0}, started{0};
  HeldRead held(offset, [&] { return started == kThreads; });
  {
    const Faults faults({&held});
    std::vector<std::thread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&] {
        PagedOctree::Reader reader(*octree);
        ++started;
        told += read(reader, page).starts_with(expected);
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  EXPECT_EQ(told, kThreads);
  EXPECT_EQ(octree->surfelCache().counters().waits, waits + kThreads - 1);
  EXPECT_FALSE(octree->surfelCache().isLoaded(page));

  // The others are as they were, and so is this one once the disk is right again
  PagedOctree::Reader reader(*octree);
  for (std::uint32_t other = 4; other < count; ++other) {
    ASSERT_TRUE(read(reader, other) == others[other - 4]) << other;
  }
  EXPECT_THAT(read(reader, page), HasSubstr("checksum"));
  flipByte(scene, offset + 5);
  EXPECT_TRUE(read(reader, page) == sound);
}

TEST_F(ChangingSceneTest, SceneThatIsReplacedStaysWhatItWasForThoseWhoHaveItOpen) {
  const std::string scene = smallPages(40'000, 1), next = smallPages(30'000, 2);
  const auto octree = openInLittleMemory(scene);
  const std::uint32_t count = octree->file().surfelPageCount();
  std::vector<std::string> before;
  {
    PagedOctree::Reader reader(*octree);
    for (std::uint32_t page = 0; page < count; ++page) before.push_back(read(reader, page));
  }
  indexFiles({path("scene2.ply")}, scene);  // over the one that is open
  PagedOctree::Reader reader(*octree);
  for (std::uint32_t page = 0; page < count; ++page) {
    ASSERT_TRUE(read(reader, page) == before[page]) << page;
  }
  const Result<SceneFile> opened = SceneFile::open(scene);
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  EXPECT_EQ(opened->header().surfel_count, 30'000u);
}

// Threads that open a scene again and again while it is replaced again and again.
TEST_F(ChangingSceneTest, EachReaderSeesOneOfTheScenesThatArePublished) {
  const std::string one = smallPages(900, 1), other = smallPages(700, 2);
  const std::string scene = path("published.sft");
  const auto publish = [&](const std::string& from) {
    std::filesystem::copy_file(from, path("next.sft"),
                               std::filesystem::copy_options::overwrite_existing);
    std::filesystem::rename(path("next.sft"), scene);
  };
  const auto bytesOf = [](const std::string& file) {
    const Result<ReadScene> read = readScene(file);
    if (!read.ok()) return std::string(read.status().message());
    return std::string(reinterpret_cast<const char*>(read->surfels.data()),
                       read->surfels.size() * sizeof(Surfel));
  };
  const std::string first = bytesOf(one), second = bytesOf(other);
  publish(one);
  std::atomic<bool> ended{false};
  std::atomic<int> firsts{0}, seconds{0}, wrong{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&] {
      while (!ended) {
        const std::string found = bytesOf(scene);
        ++(found == first ? firsts : found == second ? seconds : wrong);
      }
    });
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  for (int i = 0;
       (i < 200 || firsts < 20 || seconds < 20) && std::chrono::steady_clock::now() < deadline;
       ++i) {
    publish(i % 2 == 0 ? other : one);
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  ended = true;
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_GE(firsts, 20);
  EXPECT_GE(seconds, 20);
}

}  // namespace
}  // namespace surfeit
