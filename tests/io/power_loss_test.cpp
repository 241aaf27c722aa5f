// A power loss at any call leaves the old file or the new one, whole; once commit() has returned,
// the new one.
#include "io/power_loss.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <random>
#include <span>
#include <string>

#include "io/test_directory.h"
#include "storage/file.h"

namespace surfeit {
namespace {

using Disk = PowerLoss::Disk;
using Syncs = PowerLoss::Syncs;

class PowerLossTest : public DirectoryTest {
 protected:
  struct Outcome {
    std::uint64_t losses = 0, old_ones = 0, new_ones = 0, torn = 0;
    bool is_kept = true;  // after commit() the new one is always there
  };

  static std::string bytesOf(std::size_t size, unsigned seed) {
    std::mt19937 random(seed);
    std::string bytes(size, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    return bytes;
  }

  Outcome replace(const std::string& old_bytes, const std::string& new_bytes, unsigned seed,
                  bool is_named, Syncs syncs) {
    std::filesystem::remove_all(path("disk"));
    std::filesystem::create_directory(path("disk"));
    if (!old_bytes.empty()) PowerLoss::restore({{"file", old_bytes}}, path("disk"));
    Outcome outcome;
    const auto look = [&](const Disk& disk) {
      const auto file = disk.find("file");
      const std::string found = file == disk.end() ? "" : file->second;
      ++(found == new_bytes   ? outcome.new_ones
         : found == old_bytes ? outcome.old_ones
                              : outcome.torn);
    };
    PowerLoss disk(path("disk"), seed, look, syncs);
    RefuseUnnamed refuse_unnamed;
    {
      const Faults faults(is_named ? std::initializer_list<FaultInjector*>{&refuse_unnamed, &disk}
                                   : std::initializer_list<FaultInjector*>{&disk});
      writeFile(new_bytes);
    }
    disk.loseNow([&](const Disk& left) {
      const auto file = left.find("file");
      outcome.is_kept &= file != left.end() && file->second == new_bytes;
    });
    outcome.losses = disk.losses();
    return outcome;
  }

  void writeFile(const std::string& bytes) {
    Result<AtomicFile> file = AtomicFile::create(path("disk/file"));
    ASSERT_TRUE(file.ok()) << file.status().message();
    const auto all = std::as_bytes(std::span(bytes));
    const std::size_t half = bytes.size() / 2;
    ASSERT_TRUE(file->append(all.first(half)).ok());
    ASSERT_TRUE(file->append(all.subspan(half)).ok());
    ASSERT_TRUE(half < 8 || file->writeAt(0, all.first(8)).ok());
    const Status status = file->commit();
    ASSERT_TRUE(status.ok()) << status.message();
  }
};

TEST_F(PowerLossTest, LeavesTheOldFileOrTheNewOne) {
  Outcome all;
  unsigned seed = 0;
  for (const std::size_t old_size : {0, 1, 5000, 70'000}) {
    for (const std::size_t new_size : {1, 511, 4096, 100'000}) {
      for (const bool is_named : {false, true}) {
        for (int run = 0; run < 8; ++run) {
          ++seed;
          const Outcome one = replace(bytesOf(old_size, seed), bytesOf(new_size, seed + 1000), seed,
                                      is_named, Syncs::kHonest);
          EXPECT_EQ(one.torn, 0u) << old_size << ", " << new_size << ", " << is_named;
          EXPECT_TRUE(one.is_kept) << old_size << ", " << new_size << ", " << is_named;
          all.losses += one.losses;
          all.old_ones += one.old_ones;
          all.new_ones += one.new_ones;
        }
      }
    }
  }
  fmt::print("{} losses: {} leave the old file, {} the new one before its directory is synced\n",
             all.losses, all.old_ones, all.new_ones);
  EXPECT_GT(all.losses, 10'000u);
  EXPECT_GT(all.old_ones, 1000u);
  EXPECT_GT(all.new_ones, 1000u);
}

// The test sees what it looks for.
TEST_F(PowerLossTest, OfADiskThatDoesNotSyncLeavesTornOrLostFiles) {
  std::uint64_t torn = 0;
  bool is_kept = true;
  for (unsigned seed = 0; seed < 8; ++seed) {
    torn += replace(bytesOf(5000, 1), bytesOf(100'000, 2), seed, false, Syncs::kNotFiles).torn;
    is_kept &=
        replace(bytesOf(5000, 1), bytesOf(9000, 2), seed, false, Syncs::kNotDirectories).is_kept;
  }
  EXPECT_GT(torn, 0u);
  EXPECT_FALSE(is_kept);
}

}  // namespace
}  // namespace surfeit
