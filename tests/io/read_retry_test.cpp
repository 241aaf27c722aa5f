#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <string>

#include "io/fault_injector.h"
#include "io/test_directory.h"
#include "storage/file.h"
#include "surfeit/process.h"

namespace surfeit {
namespace {

// One read in `every` fails, and `times` of its repetitions.
class FailingReads : public FaultInjector {
 public:
  FailingReads(int every, int times) : every_(every), times_(times) {}
  int before(CallInfo& info) override {
    if (info.call != Call::kPread) return 0;
    if (left_ > 0) {
      --left_;
      return EIO;
    }
    if (has_failed_) {
      has_failed_ = false;
      return 0;
    }
    if (++reads_ % every_ != 0) return 0;
    has_failed_ = true;
    left_ = times_ - 1;
    return EIO;
  }

 private:
  const int every_, times_;
  int reads_ = 0, left_ = 0;
  bool has_failed_ = false;
};

class ReadRetryTest : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    expected_.resize(300'000);
    for (std::size_t i = 0; i < expected_.size(); ++i) expected_[i] = static_cast<char>(i * i >> 7);
    write("data", expected_);
  }
  void TearDown() override { setReadRetries(0); }

  // The file, read a thousand bytes at a time; what was read until a failure.
  Status read(std::string& got) {
    SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path("data")));
    got.clear();
    std::string part(1000, ' ');
    while (got.size() < expected_.size()) {
      SURFEIT_RETURN_IF_ERROR(file.readAt(got.size(), std::as_writable_bytes(std::span(part))));
      got += part;
    }
    return {};
  }
  std::string expected_;
};

TEST_F(ReadRetryTest, ReadsThatFailAMomentAreTriedAgainAndCounted) {
  for (const int every : {7, 32, 100}) {
    FailingReads failing(every, 2);
    const Faults faults({&failing});
    setReadRetries(2);
    const std::uint64_t before = readsRetried();
    std::string got;
    const Status status = read(got);
    ASSERT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(got == expected_);
    EXPECT_EQ(readsRetried() - before, std::uint64_t(2 * (300 / every)));
  }
}

TEST_F(ReadRetryTest, WithoutRetriesAndWithTooFewAFailureIsAnError) {
  for (const int retries : {0, 1}) {
    FailingReads failing(32, 2);
    const Faults faults({&failing});
    setReadRetries(retries);
    std::string got;
    EXPECT_EQ(read(got).code(), StatusCode::kIoError);
    EXPECT_EQ(got, expected_.substr(0, got.size()));
  }
}

}  // namespace
}  // namespace surfeit
