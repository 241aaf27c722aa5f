#include "io/file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>

#include "io/test_directory.h"

namespace surfeit {
namespace {

namespace fs = std::filesystem;

Bytes bytesOf(const std::string& text) { return std::as_bytes(std::span(text)); }

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
  fs::create_directory(path("a"));
  {
    Result<AtomicFile> file = AtomicFile::create(path("a"));
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file->append(bytesOf("hello")).ok());
    EXPECT_EQ(file->commit().code(), StatusCode::kIoError);
  }
  EXPECT_EQ(fileCount(), 1);
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

TEST_F(TemporaryFileTest, MissingDirectoryIsAnIoError) {
  EXPECT_EQ(TemporaryFile::create(path("missing")).status().code(), StatusCode::kIoError);
}

TEST(DirectoryOf, IsThePartBeforeTheLastSlash) {
  EXPECT_EQ(directoryOf("a"), ".");
  EXPECT_EQ(directoryOf("/a"), "/");
  EXPECT_EQ(directoryOf("b/c/a"), "b/c");
}

}  // namespace
}  // namespace surfeit
