// Every allocation of those who write files fails in turn, on whichever thread it is made. A
// program of its own, as it replaces operator new.
#include <fcntl.h>
#include <gtest/gtest.h>

#include <functional>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "failing_allocations.h"
#include "io/fault_injector.h"
#include "io/test_directory.h"
#include "storage/block_writer.h"
#include "storage/file.h"

namespace surfeit {
namespace {

class IoAllocation : public DirectoryTest {};

// Ever later allocations of `work` fail, one or all that follow, until it needs no more: it may
// answer that something went wrong, or throw that memory ran out, but must succeed at last.
void failInTurn(const std::function<void()>& prepare, const std::function<bool()>& work) {
  for (const bool for_ever : {false, true}) {
    long count = 0;
    for (bool any_failed = true; any_failed; ++count) {
      ASSERT_LT(count, 1000);
      prepare();
      const long live_before = live_allocations;
      bool is_ok = false;
      {
        const FailingAllocations failing(count, for_ever);
        try {
          is_ok = work();
        } catch (const std::bad_alloc&) {
        }
        any_failed = failing.anyFailed();
      }
      EXPECT_TRUE(is_ok || any_failed) << "allocation " << count;
      EXPECT_EQ(live_allocations, live_before) << "allocation " << count;
    }
    EXPECT_GT(count, 3);
  }
}

// Two blocks and a half, in three parts.
bool writeBlocks(const std::string& path, const std::vector<std::byte>& part) {
  PositionalFile file(FileDescriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)),
                      path);
  BlockWriter writer(file, 2);
  for (int i = 0; i < 3; ++i) {
    if (!writer.append(part).ok()) return false;
  }
  return writer.flush().ok();
}

TEST_F(IoAllocation, BlocksAreWrittenOrTheFailureIsTold) {
  const std::vector<std::byte> part(BlockWriter::kBlockBytes * 5 / 6);
  failInTurn([] {}, [&] { return writeBlocks(path("a"), part); });
}

// The text that tells of it is made on the thread that writes.
TEST_F(IoAllocation, FullDisksAreToldWithoutMemory) {
  const std::vector<std::byte> part(BlockWriter::kBlockBytes * 5 / 6);
  FailCall full(1, ENOSPC, FailCall::Repeat::kForEver, only(Call::kPwrite));
  const Faults faults{&full};
  failInTurn([] {}, [&] { return !writeBlocks(path("a"), part); });
}

TEST_F(IoAllocation, FilesAreWholeAndLeavingsGo) {
  const std::string name = path("a");
  const std::string left = name + ".surfeit-abcdef.tmp";
  const auto leave = [&] { write("a.surfeit-abcdef.tmp", "left"); };
  failInTurn(leave, [&] {
    Result<AtomicFile> file = AtomicFile::create(name);
    return file.ok() && file->append(std::as_bytes(std::span("text", 4))).ok() &&
           file->commit().ok() && ::access(left.c_str(), F_OK) != 0;
  });
  EXPECT_EQ(contents("a"), "text");
}

}  // namespace
}  // namespace surfeit
