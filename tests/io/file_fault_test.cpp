// What files do when the system refuses: every call of a file being written fails in turn.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "io/fault_injector.h"
#include "io/test_bytes.h"
#include "io/test_directory.h"
#include "storage/file.h"
#include "storage/page_file.h"

namespace surfeit {
namespace {

using Repeat = FailCall::Repeat;

constexpr int kMostCalls = 200;  // more than any file here takes

// Bytes without a period.
std::string noise(std::size_t size) {
  std::string text(size, '\0');
  std::uint32_t state = 1;
  for (char& c : text) {
    state = state * 1664525 + 1013904223;
    c = static_cast<char>(state >> 24);
  }
  return text;
}

// Two blocks and a tail of no alignment, with a header that is written last.
const std::string& newContents() {
  static const std::string text = noise((2u << 20) + 300'001);
  return text;
}

Status writeNewFile(const std::string& path) {
  const std::string& text = newContents();
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  SURFEIT_RETURN_IF_ERROR(file.append(bytesOf(std::string(512, '-'))));
  constexpr std::size_t kPart = 700'000;
  for (std::size_t at = 512; at < text.size(); at += kPart) {
    SURFEIT_RETURN_IF_ERROR(file.append(bytesOf(text.substr(at, kPart))));
  }
  SURFEIT_RETURN_IF_ERROR(file.writeAt(0, bytesOf(text.substr(0, 512))));
  return file.commit();
}

Status writeNewScene(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(PageFileWriter writer, PageFileWriter::create(path, 7));
  const std::string& text = newContents();
  constexpr std::size_t kPage = 60'000;
  for (std::size_t at = 0; at + kPage <= text.size(); at += kPage) {
    const Bytes page = bytesOf(text).subspan(at, kPage);
    SURFEIT_RETURN_IF_ERROR(writer.addSurfelPage(page, kPage));
  }
  return writer.finish({}, "provenance");
}

enum class Names { kUnnamed, kNamed };  // whether a file has a name while it is written

struct FaultKind {
  int error;
  Repeat repeat;
  Names names;
  CallFilter filter = {};
};

class FileFaultTest : public DirectoryTest {
 protected:
  using Writer = std::function<Status(const std::string&)>;

  // Fails call 1, 2, 3, ... of `write` until there is no such call.
  void sweep(const Writer& write, const std::string& new_contents, const FaultKind& kind) {
    for (int number = 1; number < kMostCalls; ++number) {
      SCOPED_TRACE(testing::Message() << "call " << number << ", " << std::strerror(kind.error));
      if (contents("a") != "old") this->write("a", "old");
      FailCall fail(number, kind.error, kind.repeat, kind.filter);
      const Status status = writeWithFault(write, fail, kind.names);
      if (!fail.hasFailed()) {
        EXPECT_TRUE(status.ok()) << status.message();
        EXPECT_GT(number, 1);
        return;
      }
      checkOutcome(status, new_contents, kind, fail);
      if (HasFailure()) return;
    }
    FAIL() << "the calls come to no end";
  }

  Status writeWithFault(const Writer& write, FailCall& fail, Names names) {
    const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
    const std::ptrdiff_t threads = entryCount("/proc/self/task");
    RefuseUnnamed refuse_unnamed;
    NameLog names_log;
    Status status;
    {
      const Faults faults(
          names == Names::kNamed
              ? std::initializer_list<FaultInjector*>{&names_log, &refuse_unnamed, &fail}
              : std::initializer_list<FaultInjector*>{&names_log, &fail});
      status = write(path("a"));
    }
    EXPECT_EQ(entryCount("/proc/self/fd"), descriptors);
    EXPECT_TRUE(threadsComeDownTo(threads));
    live_names_ = names_log.liveNames();
    return status;
  }

  void checkOutcome(const Status& status, const std::string& new_contents, const FaultKind& kind,
                    const FailCall& fail) {
    EXPECT_TRUE(kind.error != EINTR || status.ok()) << status.message();
    if (status.ok()) {
      EXPECT_TRUE(contents("a") == new_contents);
    } else {
      EXPECT_EQ(status.code(), StatusCode::kIoError);
      EXPECT_NE(status.message().find(path("a")), std::string::npos) << status.message();
      // Once the file has its name, only the sync of its directory is left to fail
      if (status.message().find("sync the directory") == std::string::npos) {
        EXPECT_EQ(contents("a"), "old") << status.message();
      } else {
        EXPECT_TRUE(fail.failedCall() == Call::kFsync && contents("a") == new_contents);
      }
    }
    // A system that refuses to remove the temporary file does so when the next writer comes
    if (kind.repeat == Repeat::kForEver && !live_names_.empty()) {
      EXPECT_TRUE(AtomicFile::create(path("a")).ok());
    } else {
      EXPECT_TRUE(live_names_.empty()) << *live_names_.begin();
    }
    EXPECT_EQ(fileCount(), 1);
  }

  std::set<std::string> live_names_;
};

TEST_F(FileFaultTest, AtomicFileIsWholeOrAbsentWhicheverCallFails) {
  for (const Names names : {Names::kUnnamed, Names::kNamed}) {
    for (const int error : {EIO, ENOSPC, EDQUOT, EAGAIN}) {
      sweep(writeNewFile, newContents(), {error, Repeat::kOnce, names});
    }
    sweep(writeNewFile, newContents(), {EIO, Repeat::kForEver, names});
    sweep(writeNewFile, newContents(), {ENOSPC, Repeat::kForEver, names, only(Call::kPwrite)});
    sweep(writeNewFile, newContents(), {EMFILE, Repeat::kOnce, names, only(Call::kOpen)});
    sweep(writeNewFile, newContents(), {EMFILE, Repeat::kForEver, names, only(Call::kOpen)});
  }
}

TEST_F(FileFaultTest, InterruptedCallsAreMadeAgain) {
  for (const Names names : {Names::kUnnamed, Names::kNamed}) {
    sweep(writeNewFile, newContents(), {EINTR, Repeat::kOnce, names});
  }
}

TEST_F(FileFaultTest, SceneIsWholeOrAbsentWhicheverCallFails) {
  ASSERT_TRUE(writeNewScene(path("b")).ok());
  const std::string scene = contents("b");
  std::filesystem::remove(path("b"));
  for (const Names names : {Names::kUnnamed, Names::kNamed}) {
    sweep(writeNewScene, scene, {EIO, Repeat::kOnce, names});
    sweep(writeNewScene, scene, {ENOSPC, Repeat::kForEver, names});
  }
}

TEST_F(FileFaultTest, FailedSyncIsFinal) {
  FailCall fail(1, EIO, Repeat::kOnce, only(Call::kFsync));
  CountCalls syncs(only(Call::kFsync));
  const Faults faults{&syncs, &fail};
  Result<AtomicFile> file = AtomicFile::create(path("a"));
  ASSERT_TRUE(file.ok() && file->append(bytesOf("new")).ok());
  const Status status = file->commit();
  EXPECT_EQ(status.message(), path("a") + ": cannot sync: Input/output error");
  EXPECT_EQ(file->commit().message(), status.message());
  EXPECT_EQ(file->finishUnnamed("b").status().message(), status.message());
  EXPECT_EQ(syncs.count(), 1);
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(FileFaultTest, FileSystemThatDoesNotSyncDirectoriesIsFine) {
  FailCall fail(2, EINVAL, Repeat::kOnce, only(Call::kFsync));
  const Faults faults{&fail};
  EXPECT_TRUE(writeNewFile(path("a")).ok());
  EXPECT_TRUE(fail.hasFailed());
}

TEST_F(FileFaultTest, FailedWriteIsFinalAndTellsOfTheRoomLeft) {
  FullDisk full((1 << 20) + 5000);
  CountCalls writes(only(Call::kPwrite));
  const Faults faults{&writes, &full};
  Result<TemporaryFile> file = TemporaryFile::create(directory_.string());
  ASSERT_TRUE(file.ok());
  Status status;
  const std::string part = noise(300'000);
  for (int i = 0; i < 100 && status.ok(); ++i) status = file->append(bytesOf(part)).status();
  if (status.ok()) status = file->flush();
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  for (const char* words :
       {"No space left on device", " bytes are written so far; ", " bytes are available; ",
        "use --temp to put temporary files elsewhere", directory_.c_str()}) {
    EXPECT_NE(status.message().find(words), std::string::npos) << status.message();
  }
  const int before = writes.count();
  EXPECT_EQ(file->append(bytesOf(part)).status().message(), status.message());
  EXPECT_EQ(file->flush().message(), status.message());
  AlignedBuffer buffer;
  EXPECT_EQ(file->readView(file->size() - 10, 10, buffer).status().message(), status.message());
  EXPECT_EQ(writes.count(), before);
}

TEST_F(FileFaultTest, FailedReadNamesFileAndPlace) {
  write("a", noise(20'000));
  for (const Access access : {Access::kCached, Access::kDirect}) {
    const Result<InputFile> file = InputFile::open(path("a"), access);
    ASSERT_TRUE(file.ok());
    FailCall fail(1, EIO, Repeat::kForEver, only(Call::kPread));
    const Faults faults{&fail};
    AlignedBuffer buffer;
    const Status status = file->readView(8192, 4096, buffer).status();
    EXPECT_EQ(status.message(), path("a") + ": cannot read 4096 bytes at 8192: Input/output error");
  }
}

// Writes a file and a temporary file and reads both in several ways.
void expectSameBytes(const std::string& path) {
  const std::string& text = newContents();
  const Status written = writeNewFile(path);
  ASSERT_TRUE(written.ok()) << written.message();
  Result<TemporaryFile> temporary = TemporaryFile::create(directoryOf(path));
  ASSERT_TRUE(temporary.ok() && temporary->append(bytesOf(text)).ok() && temporary->flush().ok());
  const Result<InputFile> cached = InputFile::open(path);
  const Result<InputFile> direct = InputFile::open(path, Access::kDirect);
  ASSERT_TRUE(cached.ok() && direct.ok());
  AlignedBuffer buffer;
  for (const std::size_t offset : {0u, 1u, 4095u, 4096u, 1u << 20, (2u << 20) + 299'999}) {
    for (const std::size_t size : {1u, 5000u, 1'200'000u}) {
      const std::string expected = text.substr(offset, size);
      const auto check = [&](const Result<Bytes>& view) {
        ASSERT_TRUE(view.ok()) << view.status().message();
        ASSERT_EQ(view->size(), expected.size());
        EXPECT_EQ(std::memcmp(view->data(), expected.data(), expected.size()), 0);
      };
      check(cached->readView(offset, size, buffer));
      check(direct->readView(offset, size, buffer));
      check(temporary->readView(offset, expected.size(), buffer));
      std::string read(expected.size(), ' ');
      const auto bytes = std::as_writable_bytes(std::span(read));
      EXPECT_TRUE(direct->readAt(offset, bytes).ok() && read == expected);
      EXPECT_TRUE(temporary->readAt(offset, bytes).ok() && read == expected);
    }
  }
}

TEST_F(FileFaultTest, ShortReadsAndWritesGiveTheSameBytes) {
  for (const std::size_t limit : {0u, 4095u, 4096u, 8193u, 1'000'000u}) {
    SCOPED_TRACE(limit);
    ShortTransfers short_transfers(limit);
    const Faults faults{&short_transfers};
    expectSameBytes(path("a"));
  }
}

TEST_F(FileFaultTest, FirstTransferOfAnyLengthGivesTheSameBytes) {
  constexpr std::size_t kSize = 3 * kDirectAlignment;
  const std::string text = noise(kSize + 100);
  write("a", text);
  const Result<InputFile> file = InputFile::open(path("a"), Access::kDirect);
  ASSERT_TRUE(file.ok());
  AlignedBuffer buffer, page(kSize);
  std::memcpy(page.data(), text.data(), kSize);
  PositionalFile written(FileDescriptor(::open(path("b").c_str(), O_RDWR | O_CREAT, 0600)), "b");
  written.openDirect(O_RDWR);
  for (std::size_t length = 1; length <= kSize; length += length % 512 == 1 ? 510 : 1) {
    ShortFirstTransfer short_read(length), short_write(length);
    {
      const Faults faults{&short_read};
      const Result<Bytes> view = file->readView(100, kSize, buffer);
      ASSERT_TRUE(view.ok() && view->size() == kSize) << length;
      ASSERT_EQ(std::memcmp(view->data(), text.data() + 100, kSize), 0) << length;
    }
    {
      const Faults faults{&short_write};
      ASSERT_TRUE(written.writeAligned(0, {page.data(), kSize}).ok()) << length;
    }
    ASSERT_TRUE(contents("b") == text.substr(0, kSize)) << length;
    ASSERT_EQ(::ftruncate(written.descriptor(), 0), 0);
  }
}

TEST_F(FileFaultTest, StormOfSignalsGivesTheSameBytes) {
  InterruptStorm storm;
  const Faults faults{&storm};
  expectSameBytes(path("a"));
}

TEST_F(FileFaultTest, FileSystemWithoutDirectIoGivesTheSameBytes) {
  for (const auto when : {RefuseDirect::When::kOpened, RefuseDirect::When::kUsed}) {
    RefuseDirect refuse(when);
    const Faults faults{&refuse};
    expectSameBytes(path("a"));
  }
}

TEST_F(FileFaultTest, FileSystemWithoutUnnamedFilesGivesTheSameBytes) {
  RefuseUnnamed refuse;
  const Faults faults{&refuse};
  expectSameBytes(path("a"));
  EXPECT_EQ(fileCount(), 1);
}

TEST_F(FileFaultTest, AvailableBytesTellsWhyNot) {
  FailCall fail(1, EIO, Repeat::kOnce, only(Call::kStatvfs));
  const Faults faults{&fail};
  EXPECT_EQ(availableBytes(directory_.string()).status().message(),
            directory_.string() + ": cannot tell how much room is left: Input/output error");
}

// Runs `work` in a child process with `faults` and returns how it ended, as waitpid.
template <typename Work>
int inChild(std::initializer_list<FaultInjector*> injectors, Work work) {
  const pid_t child = ::fork();
  if (child == 0) {
    const Faults faults(injectors);
    work();
    ::_exit(0);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return status;
}

using KilledWriterTest = FileFaultTest;

TEST_F(KilledWriterTest, LeavesOldOrNewFileAndNothingForTheNext) {
  for (const Names names : {Names::kUnnamed, Names::kNamed}) {
    int leftovers = 0;
    for (int number = 1; number < kMostCalls; ++number) {
      SCOPED_TRACE(number);
      write("a", "old");
      CountCalls none;
      RefuseUnnamed refuse;
      DieAtCall die(number);
      FaultInjector* const first = names == Names::kNamed ? static_cast<FaultInjector*>(&refuse)
                                                          : static_cast<FaultInjector*>(&none);
      const int status =
          inChild({first, &die}, [&] { static_cast<void>(writeNewFile(path("a"))); });
      leftovers += fileCount() > 1;
      ASSERT_LE(fileCount(), 2);
      EXPECT_TRUE(contents("a") == "old" || contents("a") == newContents());
      EXPECT_TRUE(AtomicFile::create(path("a")).ok());
      ASSERT_EQ(fileCount(), 1);
      if (WIFEXITED(status)) break;  // there was no such call
      ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    }
    // Without a name, only death between naming and renaming leaves one
    EXPECT_TRUE(names == Names::kNamed ? leftovers > 5 : leftovers == 1) << leftovers;
  }
}

TEST_F(KilledWriterTest, LivingWritersFileStays) {
  RefuseUnnamed refuse;
  const Faults faults{&refuse};
  Result<AtomicFile> living = AtomicFile::create(path("a"));
  ASSERT_TRUE(living.ok() && living->append(bytesOf("living")).ok());
  const int status = inChild({&refuse}, [&] {
    const Result<AtomicFile> file = AtomicFile::create(path("a"));
    ::kill(::getpid(), SIGKILL);
  });
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(fileCount(), 2);
  { EXPECT_TRUE(AtomicFile::create(path("a")).ok()); }
  EXPECT_EQ(fileCount(), 1) << "that of the living writer";
  EXPECT_TRUE(living->commit().ok());
  EXPECT_EQ(contents("a"), "living");
}

TEST_F(KilledWriterTest, FileInTheMomentOfItsRenamingStays) {
  for (const bool named : {false, true}) {
    RefuseUnnamed refuse;
    CountCalls none;
    ActAtCall act(only(Call::kRename), [&] {
      EXPECT_EQ(fileCount(), 1);
      EXPECT_TRUE(AtomicFile::create(path("a")).ok());
      EXPECT_EQ(fileCount(), 1);
    });
    const Faults faults{named ? static_cast<FaultInjector*>(&refuse) : &none, &act};
    const Status status = writeNewFile(path("a"));
    EXPECT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(act.hasActed());
    std::filesystem::remove(path("a"));
  }
}

TEST_F(KilledWriterTest, FileRemovedBeforeItIsLockedIsCreatedAnew) {
  RefuseUnnamed refuse;
  ActAtCall act(only(Call::kFlock), [&] {
    for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
      std::filesystem::remove(entry);
    }
  });
  const Faults faults{&refuse, &act};
  const Status status = writeNewFile(path("a"));
  EXPECT_TRUE(status.ok()) << status.message();
  EXPECT_TRUE(act.hasActed());
  EXPECT_TRUE(contents("a") == newContents());
}

TEST_F(KilledWriterTest, OtherFilesStay) {
  for (const char* name : {"a.surfeit-0000.tmp", "a.surfeit-000000.tmp.bak", "b.surfeit-000000.tmp",
                           "a.surfeit-ABCDEF.tmp", "aa.surfeit-000000.tmp"}) {
    write(name, "");
  }
  std::filesystem::create_directory(path("a.surfeit-000001.tmp"));
  std::filesystem::create_symlink("b.surfeit-000000.tmp", path("a.surfeit-000002.tmp"));
  write("a.surfeit-000003.tmp", "a leftover");
  EXPECT_EQ(fileCount(), 8);
  EXPECT_TRUE(AtomicFile::create(path("a")).ok());
  EXPECT_EQ(fileCount(), 7);
}

}  // namespace
}  // namespace surfeit
