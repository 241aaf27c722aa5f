#include "storage/block_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <latch>
#include <string>
#include <thread>
#include <vector>

#include "io/fault_injector.h"
#include "io/test_bytes.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

constexpr std::size_t kBlock = BlockWriter::kBlockBytes;

class BlockWriterTest : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    const int descriptor = ::open(path("a").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    file_ = PositionalFile(FileDescriptor(descriptor), "a");
  }

  // The file, of which at most a padding is no part.
  std::string written(const BlockWriter& writer) const {
    std::string text = contents("a");
    EXPECT_LT(text.size() - writer.size(), kDirectAlignment);
    EXPECT_TRUE(writer.isPadded() || text.size() == writer.size());
    text.resize(writer.size());
    return text;
  }

  PositionalFile file_;
};

TEST_F(BlockWriterTest, SmallFileStartsNoThread) {
  const std::ptrdiff_t threads = entryCount("/proc/self/task");
  BlockWriter writer(file_);
  ASSERT_TRUE(writer.append(bytesOf(std::string(kBlock - 1, 'a'))).ok());
  ASSERT_TRUE(writer.flush().ok());
  EXPECT_TRUE(threadsComeDownTo(threads));
  EXPECT_FALSE(file_.isDirect());
  ASSERT_TRUE(writer.append(bytesOf("a")).ok());
  EXPECT_GT(entryCount("/proc/self/task"), threads);
}

TEST_F(BlockWriterTest, AppendReturnsOffsetsAndFlushWritesAll) {
  BlockWriter writer(file_, 2);
  std::string expected;
  for (const std::size_t size : {0u, 1u, 100'000u, 5u << 20, 1u << 20, 3u, (1u << 20) - 4, 77u}) {
    const std::string part(size, static_cast<char>('a' + size % 26));
    const Result<std::uint64_t> offset = writer.append(bytesOf(part));
    ASSERT_TRUE(offset.ok());
    EXPECT_EQ(*offset, expected.size());
    expected += part;
    ASSERT_TRUE(writer.flush().ok());
    EXPECT_EQ(writer.flushedSize(), expected.size());
    ASSERT_TRUE(written(writer) == expected) << size;
  }
}

TEST_F(BlockWriterTest, FlushWithoutAppendWritesNothing) {
  BlockWriter writer(file_);
  CountCalls writes(only(Call::kPwrite));
  const Faults faults{&writes};
  ASSERT_TRUE(writer.flush().ok());
  ASSERT_TRUE(writer.append(bytesOf("a")).ok());
  ASSERT_TRUE(writer.flush().ok());
  ASSERT_TRUE(writer.flush().ok());
  EXPECT_EQ(writes.count(), 1);
}

TEST_F(BlockWriterTest, OverwriteReachesQueuedWrittenAndOpenBlocks) {
  BlockWriter writer(file_);
  std::string expected(3 * kBlock + 1000, 'a');
  ASSERT_TRUE(writer.append(bytesOf(expected)).ok());
  for (const std::size_t offset : {std::size_t{0}, kBlock - 3, 3 * kBlock - 3, 3 * kBlock + 990}) {
    ASSERT_TRUE(writer.overwrite(offset, bytesOf("0123456789")).ok());
    expected.replace(offset, 10, "0123456789");
  }
  ASSERT_TRUE(writer.append(bytesOf("b")).ok());
  expected += 'b';
  ASSERT_TRUE(writer.flush().ok());
  ASSERT_TRUE(writer.overwrite(3 * kBlock + 1, bytesOf("after the flush")).ok());
  expected.replace(3 * kBlock + 1, 15, "after the flush");
  ASSERT_TRUE(writer.flush().ok());
  EXPECT_TRUE(written(writer) == expected);
}

TEST_F(BlockWriterTest, FirstFailureIsTheAnswerToAllThatFollows) {
  BlockWriter writer(file_, 2);
  FailCall fail(2, EIO, FailCall::Repeat::kOnce, only(Call::kPwrite));
  CountCalls writes(only(Call::kPwrite));
  const Faults faults{&writes, &fail};
  Status status;
  for (int i = 0; i < 10 && status.ok(); ++i) {
    status = writer.append(bytesOf(std::string(kBlock, 'a'))).status();
  }
  EXPECT_EQ(status.message(), "a: cannot write 1048576 bytes at 1048576: Input/output error");
  EXPECT_EQ(writer.flush().message(), status.message());
  EXPECT_EQ(writer.append({}).status().message(), status.message());
  EXPECT_EQ(writer.overwrite(0, bytesOf("b")).message(), status.message());
  EXPECT_EQ(writes.count(), 2);
}

TEST_F(BlockWriterTest, BlocksQueuedBehindAFailedOneAreNotWritten) {
  BlockWriter writer(file_, 4);
  std::latch all_queued(1);
  ActAtCall wait(only(Call::kPwrite), [&] { all_queued.wait(); });
  FailCall fail(1, EIO, FailCall::Repeat::kOnce, only(Call::kPwrite));
  CountCalls writes(only(Call::kPwrite));
  const Faults faults{&wait, &writes, &fail};
  EXPECT_TRUE(writer.append(bytesOf(std::string(4 * kBlock, 'a'))).ok());
  all_queued.count_down();
  EXPECT_EQ(writer.flush().message(), "a: cannot write 1048576 bytes at 0: Input/output error");
  EXPECT_EQ(writes.count(), 1);
}

TEST_F(BlockWriterTest, DestructionDropsWhatIsQueued) {
  BlockWriter writer(file_);
  ASSERT_TRUE(writer.append(bytesOf(std::string(3 * kBlock + 5, 'a'))).ok());
}

TEST_F(BlockWriterTest, AppendsOfSeveralThreadsStayWhole) {
  struct Record {
    std::uint64_t offset;
    std::string text;
  };
  constexpr std::size_t kThreads = 4;
  BlockWriter writer(file_);
  std::vector<std::vector<Record>> records(kThreads);
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < 40; ++i) {
        std::string text(1 + 7919 * i % 70'000, static_cast<char>('a' + (i + t) % 26));
        const Result<std::uint64_t> offset = writer.append(bytesOf(text));
        ASSERT_TRUE(offset.ok());
        records[t].push_back({*offset, std::move(text)});
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ASSERT_TRUE(writer.flush().ok());
  const std::string text = written(writer);
  for (const std::vector<Record>& of_thread : records) {
    for (const Record& record : of_thread) {
      ASSERT_TRUE(text.compare(record.offset, record.text.size(), record.text) == 0);
    }
  }
}

}  // namespace
}  // namespace surfeit
