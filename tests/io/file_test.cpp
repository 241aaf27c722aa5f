#include "storage/file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "io/fault_injector.h"
#include "io/test_bytes.h"
#include "io/test_directory.h"
#include "storage/block_writer.h"
#include "storage/page_file.h"

namespace surfeit {
namespace {

namespace fs = std::filesystem;

std::string textOf(Bytes bytes) {
  std::string text(bytes.size(), ' ');
  std::ranges::copy(bytes, std::as_writable_bytes(std::span(text)).begin());
  return text;
}

using InputFileTest = DirectoryTest;
using AtomicFileTest = DirectoryTest;
using TemporaryFileTest = DirectoryTest;

TEST_F(InputFileTest, MissingFileIsAnIoErrorThatNamesThePath) {
  const Result<InputFile> file = InputFile::open(path("missing"));
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(file.status().code(), StatusCode::kIoError);
  EXPECT_NE(file.status().message().find(path("missing")), std::string::npos);
}

TEST_F(InputFileTest, DirectoryIsRefused) {
  EXPECT_EQ(InputFile::open(directory_.string()).status().code(), StatusCode::kIoError);
}

TEST_F(InputFileTest, ReadsTheBytesAtAnOffset) {
  write("a", "0123456789");
  const Result<InputFile> file = InputFile::open(path("a"));
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(file->size(), 10u);
  std::string text(4, ' ');
  ASSERT_TRUE(file->readAt(3, std::as_writable_bytes(std::span(text))).ok());
  EXPECT_EQ(text, "3456");
}

TEST_F(InputFileTest, ReadAtBeyondTheEndIsCorruption) {
  write("a", "0123456789");
  const Result<InputFile> file = InputFile::open(path("a"));
  ASSERT_TRUE(file.ok());
  std::string text(4, ' ');
  const Status status = file->readAt(8, std::as_writable_bytes(std::span(text)));
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_NE(status.message().find("file ends early"), std::string::npos);
}

TEST_F(InputFileTest, ReadAtBeyondAnyFileIsCorruption) {
  write("file", "0123456789");
  const Result<InputFile> file = InputFile::open(path("file"));
  ASSERT_TRUE(file.ok());
  std::byte bytes[4];
  for (const std::uint64_t offset : {~std::uint64_t{0}, std::uint64_t{1} << 63,
                                     (std::uint64_t{1} << 63) - 2, std::uint64_t{1} << 62}) {
    const Status status = file->readAt(offset, bytes);
    EXPECT_EQ(status.code(), StatusCode::kCorruption) << status.message();
  }
}

TEST_F(InputFileTest, ReadSomeIsShortOnlyAtTheEnd) {
  write("a", "0123456789");
  const Result<InputFile> file = InputFile::open(path("a"));
  ASSERT_TRUE(file.ok());
  std::string text(8, ' ');
  const auto bytes = std::as_writable_bytes(std::span(text));
  EXPECT_EQ(*file->readSome(0, bytes), 8u);
  EXPECT_EQ(*file->readSome(7, bytes), 3u);
  EXPECT_EQ(*file->readSome(10, bytes), 0u);
}

TEST_F(InputFileTest, ViewsHoldTheBytesAndEndWithTheFile) {
  std::string text(3 * kDirectAlignment + 10, ' ');
  for (std::size_t i = 0; i < text.size(); ++i) text[i] = static_cast<char>(i * 31 % 251);
  write("a", text);
  for (const Access access : {Access::kCached, Access::kDirect}) {
    const Result<InputFile> file = InputFile::open(path("a"), access);
    ASSERT_TRUE(file.ok());
    AlignedBuffer buffer;
    for (const std::size_t offset : {0u, 1u, 4095u, 4096u, 8192u, 12290u, 12298u, 20000u}) {
      for (const std::size_t size : {0u, 1u, 4096u, 4097u, 100'000u}) {
        const Result<Bytes> view = file->readView(offset, size, buffer);
        ASSERT_TRUE(view.ok()) << view.status().message();
        const std::string expected =
            offset < text.size() ? text.substr(offset, size) : std::string();
        EXPECT_TRUE(textOf(*view) == expected) << offset << ' ' << size;
      }
    }
    EXPECT_LE(buffer.capacity(), 100'000 + 2 * kDirectAlignment);
  }
}

TEST_F(InputFileTest, WritingToAnOpenFileIsNoticed) {
  write("a", "0123");
  const Result<InputFile> file = InputFile::open(path("a"));
  ASSERT_TRUE(file.ok());
  EXPECT_TRUE(file->checkUnchanged().ok());
  fs::last_write_time(path("a"), fs::file_time_type::clock::now() + std::chrono::seconds(5));
  const Status status = file->checkUnchanged();
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_NE(status.message().find("/a: changed while it was read: found 4 bytes"),
            std::string::npos);
  FailCall fail(1, EIO, FailCall::Repeat::kOnce, only(Call::kFstat));
  const Faults faults{&fail};
  EXPECT_EQ(file->checkUnchanged().code(), StatusCode::kIoError);
}

TEST_F(InputFileTest, NewFileUnderTheNameOfAnOpenOneIsNoChange) {
  write("a", "0123");
  const Result<InputFile> file = InputFile::open(path("a"));
  ASSERT_TRUE(file.ok());
  write("b", "longer than before");
  fs::rename(path("b"), path("a"));
  EXPECT_TRUE(file->checkUnchanged().ok());
  fs::remove(path("a"));
  EXPECT_TRUE(file->checkUnchanged().ok());
}

TEST_F(InputFileTest, FileKeepsItsBytesWhenItsPathGoes) {
  write("a", "0123456789");
  const Result<InputFile> file = InputFile::open(path("a"), Access::kDirect);
  ASSERT_TRUE(file.ok());
  fs::remove(path("a"));
  AlignedBuffer buffer;
  const Result<Bytes> view = file->readView(2, 5, buffer);
  ASSERT_TRUE(view.ok());
  EXPECT_EQ(textOf(*view), "23456");
}

TEST_F(AtomicFileTest, NothingAppearsBeforeCommit) {
  Result<AtomicFile> file = AtomicFile::create(path("a"));
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(bytesOf("hello")).ok());
  EXPECT_FALSE(fs::exists(path("a")));
  ASSERT_TRUE(file->commit().ok());
  EXPECT_EQ(contents("a"), "hello");
  EXPECT_EQ(fileCount(), 1);
}

TEST_F(AtomicFileTest, NothingIsLeftWithoutCommit) {
  {
    Result<AtomicFile> file = AtomicFile::create(path("a"));
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file->append(bytesOf("hello")).ok());
  }
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(AtomicFileTest, OldFileSurvivesAnUnfinishedNewOne) {
  write("a", "old");
  {
    Result<AtomicFile> file = AtomicFile::create(path("a"));
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file->append(bytesOf("new")).ok());
    EXPECT_EQ(contents("a"), "old");
  }
  EXPECT_EQ(contents("a"), "old");
  EXPECT_EQ(fileCount(), 1);
}

TEST_F(AtomicFileTest, CommitReplacesTheOldFile) {
  write("a", "something old and longer");
  Result<AtomicFile> file = AtomicFile::create(path("a"));
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(bytesOf("new")).ok());
  ASSERT_TRUE(file->commit().ok());
  EXPECT_EQ(contents("a"), "new");
}

TEST_F(AtomicFileTest, MovedFileKeepsItsBytes) {
  {
    Result<AtomicFile> first = AtomicFile::create(path("a"));
    Result<AtomicFile> dropped = AtomicFile::create(path("b"));
    ASSERT_TRUE(first.ok() && dropped.ok());
    ASSERT_TRUE(first->append(bytesOf("hel")).ok());
    *dropped = std::move(*first);
    ASSERT_TRUE(dropped->append(bytesOf("lo")).ok());
    ASSERT_TRUE(dropped->commit().ok());
  }
  EXPECT_EQ(contents("a"), "hello");
  EXPECT_EQ(fileCount(), 1);
}

TEST_F(AtomicFileTest, AppendsOfAllSizesKeepTheirOrder) {
  Result<AtomicFile> file = AtomicFile::create(path("a"));
  ASSERT_TRUE(file.ok());
  std::string expected;
  for (const std::size_t size : {1u, 1000u, (1u << 20) - 1, 1u << 20, 3u << 20, 0u, 7u}) {
    const std::string part(size, static_cast<char>('a' + expected.size() % 26));
    ASSERT_TRUE(file->append(bytesOf(part)).ok());
    expected += part;
    EXPECT_EQ(file->size(), expected.size());
  }
  ASSERT_TRUE(file->commit().ok());
  EXPECT_TRUE(contents("a") == expected);
}

TEST_F(AtomicFileTest, WriteAtOverwritesWhatWasAppended) {
  Result<AtomicFile> file = AtomicFile::create(path("a"));
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(bytesOf("....world")).ok());
  ASSERT_TRUE(file->writeAt(0, bytesOf("good")).ok());
  ASSERT_TRUE(file->append(bytesOf("!")).ok());
  ASSERT_TRUE(file->commit().ok());
  EXPECT_EQ(contents("a"), "goodworld!");
}

TEST_F(AtomicFileTest, MissingDirectoryIsAnIoError) {
  EXPECT_EQ(AtomicFile::create(path("no/such/a")).status().code(), StatusCode::kIoError);
}

TEST_F(AtomicFileTest, DirectoryUnderTheFinalNameIsAnIoError) {
  {
    Result<AtomicFile> file = AtomicFile::create(path("a"));
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file->append(bytesOf("hello")).ok());
    fs::create_directory(path("a"));
    EXPECT_EQ(file->commit().code(), StatusCode::kIoError);
  }
  EXPECT_EQ(fileCount(), 1);
  // One that is there already is told at once
  EXPECT_EQ(AtomicFile::create(path("a")).status().code(), StatusCode::kInvalidArgument);
}

// Calls `check` for files without a name while they are written, and with one.
template <typename Check>
void withAndWithoutName(Check check) {
  check();
  RefuseUnnamed refuse;
  const Faults faults{&refuse};
  check();
}

TEST_F(AtomicFileTest, FileHasTheModeOfTheUsersMask) {
  withAndWithoutName([&] {
    const mode_t mask = ::umask(027);
    Result<AtomicFile> file = AtomicFile::create(path("a"));
    ::umask(mask);
    ASSERT_TRUE(file.ok() && file->commit().ok());
    struct ::stat info {};
    ASSERT_EQ(::stat(path("a").c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0640u);
  });
}

TEST_F(AtomicFileTest, NamesOfAnyLengthThatTheSystemTakesWork) {
  withAndWithoutName([&] {
    const std::string name(255, 'n');
    Result<AtomicFile> file = AtomicFile::create(path(name));
    ASSERT_TRUE(file.ok()) << file.status().message();
    ASSERT_TRUE(file->append(bytesOf("hello")).ok() && file->commit().ok());
    EXPECT_EQ(contents(name), "hello");
  });
}

TEST_F(AtomicFileTest, PathWithoutDirectoryIsInTheWorkingDirectory) {
  const fs::path before = fs::current_path();
  fs::current_path(directory_);
  withAndWithoutName([&] {
    Result<AtomicFile> file = AtomicFile::create("a");
    ASSERT_TRUE(file.ok() && file->append(bytesOf("hello")).ok() && file->commit().ok());
  });
  fs::current_path(before);
  EXPECT_EQ(contents("a"), "hello");
}

TEST_F(AtomicFileTest, LastOfTwoWritersOfOnePathWins) {
  withAndWithoutName([&] {
    Result<AtomicFile> first = AtomicFile::create(path("a"));
    Result<AtomicFile> second = AtomicFile::create(path("a"));
    ASSERT_TRUE(first.ok() && first->append(bytesOf("first")).ok());
    ASSERT_TRUE(second.ok() && second->append(bytesOf("second")).ok());
    ASSERT_TRUE(second->commit().ok());
    EXPECT_EQ(contents("a"), "second");
    ASSERT_TRUE(first->commit().ok());
    EXPECT_EQ(contents("a"), "first");
    EXPECT_EQ(fileCount(), 1);
  });
}

TEST_F(AtomicFileTest, ManyWritersOfOnePathAtOnceEachPublishAWholeFile) {
  withAndWithoutName([&] {
    std::vector<std::thread> writers;
    for (char letter = 'a'; letter < 'e'; ++letter) {
      writers.emplace_back([&, letter] {
        for (int i = 0; i < 5; ++i) {
          Result<AtomicFile> file = AtomicFile::create(path("a"));
          ASSERT_TRUE(file.ok()) << file.status().message();
          ASSERT_TRUE(file->append(bytesOf(std::string(300'000, letter))).ok());
          const Status status = file->commit();
          ASSERT_TRUE(status.ok()) << status.message();
        }
      });
    }
    for (std::thread& writer : writers) writer.join();
    const std::string text = contents("a");
    ASSERT_EQ(text.size(), 300'000u);
    EXPECT_EQ(text.find_first_not_of(text[0]), text.npos);
    EXPECT_EQ(fileCount(), 1);
  });
}

TEST_F(AtomicFileTest, FinishedUnnamedItIsReadableAndGoesWithItsReader) {
  for (const std::size_t size : {std::size_t{100}, BlockWriter::kBlockBytes + 100}) {
    withAndWithoutName([&] {
      std::string text(size, '.');
      Result<AtomicFile> file = AtomicFile::create(path("a"));
      ASSERT_TRUE(file.ok() && file->append(bytesOf(text)).ok());
      ASSERT_TRUE(file->writeAt(5, bytesOf("hello")).ok());
      text.replace(5, 5, "hello");
      const Result<InputFile> input = file->finishUnnamed("scratch");
      ASSERT_TRUE(input.ok()) << input.status().message();
      EXPECT_EQ(fileCount(), 0);
      EXPECT_EQ(input->path(), "scratch");
      EXPECT_EQ(input->size(), size);
      EXPECT_EQ(file->size(), size);
      AlignedBuffer buffer;
      const Result<Bytes> view = input->readView(0, size + 1, buffer);
      ASSERT_TRUE(view.ok());
      EXPECT_TRUE(textOf(*view) == text);
    });
  }
}

TEST_F(AtomicFileTest, SceneFinishedUnnamedIsCheckedAndReadable) {
  withAndWithoutName([&] {
    Result<PageFileWriter> writer = PageFileWriter::create(path("a"), 7);
    ASSERT_TRUE(writer.ok() && writer->addSurfelPage(bytesOf("page of 16 bytes"), 16).ok());
    const Result<PageFile> pages = writer->finishUnnamed({}, "provenance");
    ASSERT_TRUE(pages.ok()) << pages.status().message();
    EXPECT_EQ(fileCount(), 0);
    EXPECT_EQ(pages->path(), "temporary scene in " + directory_.string());
    EXPECT_EQ(pages->pageCount(), 1u);
    EXPECT_EQ(pages->provenance(), "provenance");
  });
}

TEST_F(TemporaryFileTest, ReadsBackAndHasNoName) {
  Result<TemporaryFile> file = TemporaryFile::create(directory_.string());
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(fileCount(), 0);
  ASSERT_TRUE(file->append(bytesOf("hello ")).ok());
  ASSERT_TRUE(file->append(bytesOf("world")).ok());
  EXPECT_EQ(file->size(), 11u);
  std::string text(5, ' ');
  ASSERT_TRUE(file->readAt(6, std::as_writable_bytes(std::span(text))).ok());
  EXPECT_EQ(text, "world");
}

TEST_F(TemporaryFileTest, ReadAtBeyondTheEndIsCorruption) {
  Result<TemporaryFile> file = TemporaryFile::create(directory_.string());
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(bytesOf("hello")).ok());
  std::string text(5, ' ');
  EXPECT_EQ(file->readAt(1, std::as_writable_bytes(std::span(text))).code(),
            StatusCode::kCorruption);
}

TEST_F(TemporaryFileTest, MissingDirectoryIsAnIoErrorThatNamesIt) {
  EXPECT_EQ(TemporaryFile::create(path("missing")).status().message(),
            path("missing") + ": cannot create a temporary file: No such file or directory");
}

TEST_F(TemporaryFileTest, PaddingIsNoPartOfIt) {
  Result<TemporaryFile> file = TemporaryFile::create(directory_.string());
  ASSERT_TRUE(file.ok() && file->append(bytesOf("hello")).ok() && file->flush().ok());
  AlignedBuffer buffer;
  EXPECT_EQ(file->readView(1, 5, buffer).status().code(), StatusCode::kCorruption);
  EXPECT_TRUE(file->readView(1, 4, buffer).ok());
}

TEST_F(TemporaryFileTest, SeveralThreadsAppendAndReadAtOnce) {
  constexpr std::size_t kThreads = 4, kRecords = 60;
  Result<TemporaryFile> file = TemporaryFile::create(directory_.string(), 2);
  ASSERT_TRUE(file.ok());
  const auto record = [](std::size_t thread, std::size_t i) {
    return std::string(20'000 + 7919 * (i + thread) % 70'000, static_cast<char>('a' + i % 26));
  };
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      std::vector<std::uint64_t> offsets;
      AlignedBuffer buffer;
      const auto read = [&](std::size_t i) {
        const std::string expected = record(t, i);
        const Result<Bytes> view = file->readView(offsets[i], expected.size(), buffer);
        ASSERT_TRUE(view.ok()) << view.status().message();
        ASSERT_TRUE(textOf(*view) == expected);
      };
      for (std::size_t i = 0; i < kRecords; ++i) {
        const Result<std::uint64_t> offset = file->append(bytesOf(record(t, i)));
        ASSERT_TRUE(offset.ok());
        offsets.push_back(*offset);
        if (i % 20 == 19) read(i / 2);
      }
      for (std::size_t i = 0; i < kRecords; ++i) read(i);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST(AvailableBytes, TellsOfADirectoryThatExists) {
  EXPECT_GT(*availableBytes("."), 0u);
  EXPECT_EQ(availableBytes("/no/such").status().code(), StatusCode::kIoError);
}

TEST(DirectoryOf, IsThePartBeforeTheLastSlash) {
  EXPECT_EQ(directoryOf("a"), ".");
  EXPECT_EQ(directoryOf("/a"), "/");
  EXPECT_EQ(directoryOf("b/c/a"), "b/c");
}

TEST_F(TemporaryFileTest, TemporaryFileGivesBackWhatItReleasesAndNothingElse) {
  Result<TemporaryFile> file = TemporaryFile::create(directory_.string());
  ASSERT_TRUE(file.ok());
  const std::vector<std::byte> bytes(3 << 20, std::byte{7});
  ASSERT_TRUE(file->append(bytes).ok());
  ASSERT_TRUE(file->flush().ok());
  const std::uint64_t begin = 100'000, size = 2'000'000;
  file->release(begin, size);
  std::vector<std::byte> found(bytes.size());
  ASSERT_TRUE(file->readAt(0, found).ok());
  const auto is_kept = [](std::byte b) { return b == std::byte{7}; };
  const auto at = [&](std::uint64_t offset) { return found.begin() + std::ptrdiff_t(offset); };
  EXPECT_TRUE(std::all_of(found.begin(), at(begin), is_kept));
  EXPECT_TRUE(std::all_of(at(begin + size), found.end(), is_kept));
  // All but the pages at the ends, where the file system can
  const auto kept = std::count_if(at(begin), at(begin + size), is_kept);
  EXPECT_TRUE(kept < 3 * 4096 || kept == std::ptrdiff_t(size)) << kept;
}

}  // namespace
}  // namespace surfeit
