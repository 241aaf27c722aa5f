#include "storage/byte_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "io/compressed_files.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

class ByteInputTest : public DirectoryTest {
 protected:
  ByteInput open(const std::string& contents) {
    write("a", contents);
    Result<ByteInput> file = ByteInput::open(path("a"));
    EXPECT_TRUE(file.ok()) << file.status().message();
    return std::move(*file);
  }

  // Everything, by reads of `step` bytes.
  static Result<std::string> readAll(ByteInput& file, std::size_t step) {
    std::string text, part(step, '\0');
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                               file.readSome(text.size(), std::as_writable_bytes(std::span(part))));
      text.append(part, 0, got);
      if (got < step) return text;
    }
  }
  Result<std::string> readAll(const std::string& contents) {
    ByteInput file = open(contents);
    return readAll(file, 4096);
  }
};

// The same text in every form that is read.
std::vector<std::string> allForms(const std::string& text) {
  const std::string front = text.substr(0, text.size() / 3), back = text.substr(front.size());
  const std::string skippable("\x53\x2a\x4d\x18\x05\0\0\0hello", 13);
  return {text,
          gzipped(text),
          zstdPacked(text),
          gzipped(front) + gzipped("") + gzipped(back),
          zstdPacked(front) + zstdPacked("") + zstdPacked(back),
          skippable + zstdPacked(front) + skippable + zstdPacked(back)};
}

TEST_F(ByteInputTest, EveryFormGivesTheSameBytesWhateverIsReadAtOnce) {
  const std::string text = packableText(600'000);
  for (const std::string& form : allForms(text)) {
    ByteInput file = open(form);
    for (const std::size_t step : {997u, 4096u, 300'000u, 1'000'000u}) {
      const Result<std::string> got = readAll(file, step);
      ASSERT_TRUE(got.ok()) << got.status().message();
      EXPECT_TRUE(*got == text) << step;
    }
  }
}

TEST_F(ByteInputTest, SizeIsKnownOfPlainFilesOnly) {
  const std::string text = packableText(1000);
  EXPECT_EQ(open(text).size(), 1000u);
  EXPECT_FALSE(open(text).isCompressed());
  EXPECT_EQ(open(gzipped(text)).size(), std::nullopt);
  EXPECT_TRUE(open(gzipped(text)).isCompressed());
  EXPECT_TRUE(open(zstdPacked(text)).isCompressed());
}

TEST_F(ByteInputTest, ReadsGoForwardAndBack) {
  const std::string text = packableText(200'000);
  std::mt19937 random(5);
  for (const std::string& form : allForms(text)) {
    ByteInput file = open(form);
    AlignedBuffer buffer;
    for (int i = 0; i < 40; ++i) {
      const std::size_t offset = random() % (text.size() + 1000), size = random() % 5000;
      const Result<Bytes> view = file.readView(offset, size, buffer);
      ASSERT_TRUE(view.ok()) << view.status().message();
      const std::string expected = offset < text.size() ? text.substr(offset, size) : "";
      ASSERT_TRUE(std::equal(view->begin(), view->end(), std::as_bytes(std::span(expected)).begin(),
                             std::as_bytes(std::span(expected)).end()))
          << offset;
    }
  }
}

TEST_F(ByteInputTest, ReadAtTellsWhereTheBytesEnd) {
  for (const std::string& form : allForms("0123456789")) {
    ByteInput file = open(form);
    std::string part(6, '\0');
    EXPECT_TRUE(file.readAt(4, std::as_writable_bytes(std::span(part))).ok());
    EXPECT_EQ(part, "456789");
    const Status status = file.readAt(7, std::as_writable_bytes(std::span(part)));
    EXPECT_EQ(status.code(), StatusCode::kCorruption);
    EXPECT_THAT(status.message(), HasSubstr("file ends early: 3 bytes at 7, expected 6"));
  }
}

TEST_F(ByteInputTest, EveryTruncationIsFound) {
  const std::string text = packableText(700);
  for (const std::string& packed : {gzipped(text), zstdPacked(text)}) {
    // What is left of the first bytes must still tell the format
    for (std::size_t size = 4; size < packed.size(); ++size) {
      const Result<std::string> got = readAll(packed.substr(0, size));
      ASSERT_FALSE(got.ok()) << size;
      EXPECT_EQ(got.status().code(), StatusCode::kCorruption);
      EXPECT_THAT(got.status().message(), HasSubstr("file ends early"));
    }
  }
}

TEST_F(ByteInputTest, NoFlippedBitChangesWhatIsRead) {
  const std::string text = packableText(80);
  for (const std::string& packed : {gzipped(text), zstdPacked(text)}) {
    int refused = 0;
    for (std::size_t bit = 32; bit < 8 * packed.size(); ++bit) {
      std::string damaged = packed;
      damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
      const Result<std::string> got = readAll(damaged);
      if (got.ok()) {
        EXPECT_EQ(*got, text) << bit;  // a time or a name
      } else {
        EXPECT_EQ(got.status().code(), StatusCode::kCorruption);
        ++refused;
      }
    }
    EXPECT_GT(refused, int(4 * packed.size()));
  }
}

TEST_F(ByteInputTest, DamageNamesThePlaceAndStays) {
  std::string packed = gzipped(packableText(500'000));
  packed[packed.size() / 2] = static_cast<char>(~packed[packed.size() / 2]);
  packed.replace(packed.size() / 2 + 1, 100, 100, '\xff');
  ByteInput file = open(packed);
  const Result<std::string> first = readAll(file, 4096), second = readAll(file, 4096);
  ASSERT_FALSE(first.ok());
  EXPECT_THAT(first.status().message(), HasSubstr("damaged gzip data before byte "));
  EXPECT_EQ(second.status().message(), first.status().message());
  // What lies before it can be read
  std::string part(100, '\0');
  EXPECT_TRUE(file.readAt(10, std::as_writable_bytes(std::span(part))).ok());
}

TEST_F(ByteInputTest, BytesBehindTheLastMemberAreCorruption) {
  const std::string text = packableText(100);
  EXPECT_EQ(readAll(gzipped(text) + "more").status().code(), StatusCode::kCorruption);
  EXPECT_EQ(readAll(zstdPacked(text) + "more").status().code(), StatusCode::kCorruption);
}

TEST_F(ByteInputTest, WindowsAreBounded) {
  const std::string text = packableText(1000);
  EXPECT_EQ(*readAll(zstdPacked(text, 23)), text);
  const Result<std::string> got = readAll(zstdPacked(text, 24));
  ASSERT_FALSE(got.ok());
  EXPECT_EQ(got.status().code(), StatusCode::kCorruption);
  EXPECT_THAT(got.status().message(), HasSubstr("a window larger than 2^23 bytes"));
}

TEST_F(ByteInputTest, ChangeOfTheFileShows) {
  ByteInput file = open(gzipped("hello"));
  EXPECT_TRUE(file.checkUnchanged().ok());
  write("a", gzipped("hello, world"));
  EXPECT_EQ(file.checkUnchanged().code(), StatusCode::kCorruption);
}

TEST_F(ByteInputTest, MissingFilesAndDirectoriesAreRefused) {
  EXPECT_EQ(ByteInput::open(path("missing")).status().code(), StatusCode::kIoError);
  EXPECT_EQ(ByteInput::open(directory_.string()).status().code(), StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
