#include "storage/byte_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <string>

#include "io/compressed_files.h"
#include "io/fault_injector.h"
#include "io/test_bytes.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

class ByteOutputTest : public DirectoryTest {
 protected:
  // Writes `text` in parts, its first bytes last.
  Status writeParts(const std::string& name, const std::string& text, std::size_t part) {
    SURFEIT_ASSIGN_OR_RETURN(ByteOutput file, ByteOutput::create(path(name)));
    const std::size_t head = std::min<std::size_t>(text.size(), 10);
    SURFEIT_RETURN_IF_ERROR(file.append(bytesOf(std::string(head, '-'))));
    for (std::size_t at = head; at < text.size(); at += part) {
      SURFEIT_RETURN_IF_ERROR(file.append(bytesOf(text.substr(at, part))));
    }
    EXPECT_EQ(file.size(), text.size());
    SURFEIT_RETURN_IF_ERROR(file.writeAt(0, bytesOf(text.substr(0, head))));
    return file.commit();
  }

  std::string unpacked(const std::string& name, std::size_t size) {
    if (name.ends_with(".gz")) return gunzipped(path(name));
    return name.ends_with(".zst") ? zstdUnpacked(contents(name), size) : contents(name);
  }
};

TEST_F(ByteOutputTest, WhatIsWrittenIsReadByTheLibraries) {
  for (const std::size_t size : {0u, 1u, 1000u, 1u << 20, 3'000'001u}) {
    const std::string text = packableText(size);
    for (const std::string name : {"a", "a.gz", "a.zst"}) {
      const Status status = writeParts(name, text, 70'000);
      ASSERT_TRUE(status.ok()) << status.message();
      EXPECT_TRUE(unpacked(name, size) == text) << name << " " << size;
    }
    if (size > 1000) {
      EXPECT_LT(std::filesystem::file_size(path("a.gz")), size * 3 / 4);
      EXPECT_LT(std::filesystem::file_size(path("a.zst")), size * 3 / 4);
    }
  }
  EXPECT_EQ(fileCount(), 3);
}

TEST_F(ByteOutputTest, SameInputGivesTheSameBytesHoweverItIsCut) {
  const std::string text = packableText(1'500'000);
  for (const std::string extension : {".gz", ".zst"}) {
    ASSERT_TRUE(writeParts("a" + extension, text, 1'000).ok());
    ASSERT_TRUE(writeParts("b" + extension, text, 777'777).ok());
    EXPECT_TRUE(contents("a" + extension) == contents("b" + extension));
  }
}

TEST_F(ByteOutputTest, LeavesNothingWithoutCommit) {
  for (const std::string name : {"a", "a.gz", "a.zst"}) {
    Result<ByteOutput> file = ByteOutput::create(path(name));
    ASSERT_TRUE(file.ok());
    EXPECT_TRUE(file->append(bytesOf("hello")).ok());
    EXPECT_FALSE(std::filesystem::exists(path(name)));
  }
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(ByteOutputTest, FileIsWholeOrAbsentWhicheverCallFails) {
  const std::string text = packableText(2'500'000);
  for (const std::string name : {"a.gz", "a.zst"}) {
    for (const FailCall::Repeat repeat : {FailCall::Repeat::kOnce, FailCall::Repeat::kForEver}) {
      int number = 1;
      for (;; ++number) {
        SCOPED_TRACE(testing::Message() << name << " call " << number);
        ASSERT_LT(number, 200) << "the calls come to no end";
        write(name, "old");
        FailCall fail(number, EIO, repeat);
        Status status;
        {
          const Faults faults({&fail});
          status = writeParts(name, text, 700'000);
        }
        if (status.ok()) {
          EXPECT_TRUE(unpacked(name, text.size()) == text);
        } else {
          EXPECT_EQ(status.code(), StatusCode::kIoError) << status.message();
          EXPECT_THAT(status.message(), HasSubstr(name));
          // When only the directory could not be synced, the new file is there
          EXPECT_TRUE(contents(name) == "old" || unpacked(name, text.size()) == text);
        }
        // What a system refuses to remove goes when the next writer comes
        if (repeat == FailCall::Repeat::kForEver) {
          EXPECT_TRUE(ByteOutput::create(path(name)).ok());
        }
        EXPECT_EQ(fileCount(), 1) << status.message();
        if (!fail.hasFailed()) break;
        if (HasFailure()) return;
        std::filesystem::remove(path(name));
      }
      EXPECT_GT(number, 10);
      std::filesystem::remove(path(name));
    }
  }
}

TEST_F(ByteOutputTest, FailedCommitIsFinal) {
  Result<ByteOutput> file = ByteOutput::create(path("a.gz"));
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(bytesOf("hello")).ok());
  FailCall fail(1, EIO, FailCall::Repeat::kOnce, only(Call::kFsync));
  const Faults faults({&fail});
  const Status first = file->commit();
  EXPECT_EQ(first.code(), StatusCode::kIoError);
  EXPECT_EQ(file->commit().message(), first.message());
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(ByteOutputTest, FullDiskIsTold) {
  FullDisk full(1'000'000);
  const Faults faults({&full});
  const Status status = writeParts("a.gz", packableText(1'500'000), 100'000);
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_THAT(status.message(), HasSubstr("bytes are available"));
}

TEST(WithoutCompression, TakesTheLastExtensionOff) {
  EXPECT_EQ(withoutCompression("a.ply.gz"), "a.ply");
  EXPECT_EQ(withoutCompression("a.ply.zst"), "a.ply");
  EXPECT_EQ(withoutCompression("a.ply"), "a.ply");
  EXPECT_EQ(withoutCompression("gz"), "gz");
  EXPECT_EQ(withoutCompression("A.PLY.GZ"), "A.PLY");
}

}  // namespace
}  // namespace surfeit
