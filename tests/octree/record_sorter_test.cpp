#include "storage/record_sorter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "io/test_directory.h"

namespace surfeit {
namespace {

class RecordSorterTest : public DirectoryTest {
 protected:
  // Two keys, of which many are equal, and words of content.
  static std::vector<std::uint64_t> randomRecords(std::size_t count, std::size_t words) {
    std::mt19937_64 random(4);
    std::vector<std::uint64_t> records(count * words);
    for (std::size_t i = 0; i < records.size(); ++i) {
      const std::size_t word = i % words;
      records[i] = word == 0   ? random() % (count / 3 + 1)
                   : word == 1 ? random() % 2
                               : random() % 256;
    }
    return records;
  }

  // Sorts them and checks the order, going back to a mark twice. Returns what came.
  std::vector<std::uint64_t> sorted(const std::vector<std::uint64_t>& records, std::size_t words,
                                    std::uint64_t memory_bytes, std::uint64_t* file_bytes) {
    RecordSorter sorter({words * 8, memory_bytes, directory_.string()});
    for (std::size_t i = 0; i < records.size(); i += words) {
      EXPECT_TRUE(sorter.add(reinterpret_cast<const std::byte*>(&records[i])).ok());
    }
    EXPECT_TRUE(sorter.finish().ok());
    const auto rest = [&] {
      std::vector<std::uint64_t> all;
      std::vector<std::uint64_t> record(words);
      while (sorter.current() != nullptr) {
        std::memcpy(record.data(), sorter.current(), words * 8);
        all.insert(all.end(), record.begin(), record.end());
        EXPECT_TRUE(sorter.advance().ok());
      }
      return all;
    };
    const RecordSorter::Mark begin = sorter.mark();
    for (std::size_t i = 0; i < records.size() / words / 2; ++i) {
      EXPECT_TRUE(sorter.advance().ok());
    }
    const RecordSorter::Mark middle = sorter.mark();
    const std::vector<std::uint64_t> half = rest();
    EXPECT_TRUE(sorter.reset(middle).ok());
    EXPECT_EQ(rest(), half);
    EXPECT_TRUE(sorter.reset(begin).ok());
    std::vector<std::uint64_t> all = rest();
    EXPECT_TRUE(std::equal(half.begin(), half.end(), all.end() - std::ptrdiff_t(half.size())));
    *file_bytes = sorter.temporaryBytes();
    EXPECT_EQ(sorter.count(), records.size() / words);
    return all;
  }

  static void expectSorted(const std::vector<std::uint64_t>& all, std::size_t words) {
    for (std::size_t i = words; i < all.size(); i += words) {
      const std::uint64_t* a = &all[i - words];
      const std::uint64_t* b = &all[i];
      const bool in_order = a[0] != b[0]   ? a[0] < b[0]
                            : a[1] != b[1] ? a[1] < b[1]
                                           : std::memcmp(a + 2, b + 2, (words - 2) * 8) <= 0;
      ASSERT_TRUE(in_order) << i / words;
    }
  }
};

TEST_F(RecordSorterTest, SortsInMemoryAndOnDiskAlike) {
  for (const std::size_t count : {0, 1, 2, 1000, 300000}) {
    const std::vector<std::uint64_t> records = randomRecords(count, 5);
    std::uint64_t large_file = 0, small_file = 0;
    const auto large = sorted(records, 5, std::uint64_t{1} << 28, &large_file);
    const auto small = sorted(records, 5, RecordSorter::kLeastMemory, &small_file);
    EXPECT_EQ(large.size(), records.size());
    expectSorted(large, 5);
    EXPECT_EQ(large, small);
    EXPECT_EQ(large_file, 0u);
    EXPECT_EQ(small_file > 0, count == 300000);
  }
}

TEST_F(RecordSorterTest, MergesRunsThatAreTooManyToReadAtOnce) {
  const std::size_t words = 64;
  const std::vector<std::uint64_t> records = randomRecords(400000, words);
  std::uint64_t file_bytes = 0;
  const auto all = sorted(records, words, RecordSorter::kLeastMemory, &file_bytes);
  EXPECT_EQ(all.size(), records.size());
  expectSorted(all, words);
  // Some went through the file twice
  EXPECT_GT(file_bytes, records.size() * 8);
}

}  // namespace
}  // namespace surfeit
