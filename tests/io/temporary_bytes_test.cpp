#include "storage/temporary_bytes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <random>
#include <vector>

#include "io/fault_injector.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

class TemporaryBytesTest : public DirectoryTest {
 protected:
  // As many bytes as are kept, appended by parts of all sizes.
  TemporaryBytes filled(std::size_t size) {
    Result<TemporaryBytes> file = TemporaryBytes::create(directory_.string());
    EXPECT_TRUE(file.ok()) << file.status().message();
    std::mt19937 random(3);
    bytes_.resize(size);
    for (std::byte& byte : bytes_) byte = static_cast<std::byte>(random());
    for (std::size_t begin = 0, part = 1; begin < size;
         begin += part, part = 1 + part * 7 % 99991) {
      part = std::min(part, size - begin);
      EXPECT_TRUE(file->append(std::span(bytes_).subspan(begin, part)).ok());
    }
    EXPECT_TRUE(file->flush().ok());
    return std::move(*file);
  }
  std::vector<std::byte> bytes_;
};

TEST_F(TemporaryBytesTest, WhatIsAppendedIsRead) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{65536},
                                 std::size_t{65537}, std::size_t{1'000'000}}) {
    TemporaryBytes file = filled(size);
    EXPECT_EQ(file.size(), size);
    std::mt19937 random(4);
    for (int i = 0; i < 200 && size > 0; ++i) {
      const std::size_t begin = random() % size;
      std::vector<std::byte> part(random() % std::min<std::size_t>(size - begin, 200'000) + 1);
      ASSERT_TRUE(file.readAt(begin, part).ok());
      EXPECT_TRUE(std::equal(part.begin(), part.end(), bytes_.begin() + std::ptrdiff_t(begin)));
    }
    std::vector<std::byte> beyond(size + 1);
    EXPECT_EQ(file.readAt(0, beyond).code(), StatusCode::kCorruption);
  }
}

TEST_F(TemporaryBytesTest, DamageIsToldAndLasts) {
  for (const int number : {1, 2, 5}) {
    TemporaryBytes file = filled(600'000);
    std::vector<std::byte> all(600'000);
    FlipBit flip(number, only(Call::kPread));
    const Faults faults({&flip});
    const Status status = file.readAt(0, all);
    EXPECT_EQ(status.code(), StatusCode::kIoError);
    EXPECT_THAT(status.message(), testing::HasSubstr("checksum"));
    EXPECT_EQ(file.readAt(0, std::span(all).first(1)).message(), status.message());
  }
}

TEST_F(TemporaryBytesTest, FailedReadsLast) {
  TemporaryBytes file = filled(600'000);
  std::vector<std::byte> all(600'000);
  FailCall fail(3, EIO, FailCall::Repeat::kOnce, only(Call::kPread));
  const Faults faults({&fail});
  const Status status = file.readAt(0, all);
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_EQ(file.readAt(0, all).message(), status.message());
}

}  // namespace
}  // namespace surfeit
