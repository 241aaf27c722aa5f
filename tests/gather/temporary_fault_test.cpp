// Every command with temporary files, when the disk below these fails or lies: an error, or the
// right result; with several threads, for the next one comes after the failure.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "gather/test_clouds.h"
#include "io/fault_injector.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/convert.h"
#include "surfeit/index.h"
#include "surfeit/normals.h"

namespace surfeit {
namespace {

// Calls of each kind that fail or lie, spread over all.
constexpr int kFaultsOfAKind = 8;

struct Job {
  const char* name;
  int threads;
  std::function<Status(const class TemporaryFaultTest&)> run;
  const char* output;
};
void PrintTo(const Job& job, std::ostream* out) { *out << job.name; }

class TemporaryFaultTest : public testing::TestWithParam<Job> {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(temp());
    ::setenv("TMPDIR", temp().c_str(), 1);
    Table cloud = floorAndSphere(110);
    for (const char* name : {"albedo_r", "albedo_g", "albedo_b"}) cloud.addProperty(name);
    for (std::vector<double>& row : cloud.rows) row.insert(row.end(), {.5, .5, .5});
    writeTable(cloud, file("cloud.ply"));
    Table bare;
    for (const char* name : {"x", "y", "z"}) bare.addProperty(name);
    for (const std::vector<double>& row : cloud.rows) bare.rows.push_back({row[0], row[1], row[2]});
    writeTable(bare, file("bare.ply"));
    writeTable(receiversOf(90000), file("receivers.ply"));
    Progress quiet;
    IndexOptions options;
    options.leaf_capacity = 4;
    ASSERT_TRUE(indexClouds({file("cloud.ply")}, file("scene.sft"), options, quiet).ok());
  }
  void TearDown() override { ::unsetenv("TMPDIR"); }

 public:
  std::string temp() const { return directory_.file("temp"); }
  std::string file(const std::string& name) const { return directory_.file(name); }

  template <typename Options>
  Options with(std::uint64_t memory_bytes) const {
    Options options;
    options.threads = GetParam().threads;
    options.memory_bytes = memory_bytes;
    options.temporary_directory = temp();
    return options;
  }

 protected:
  CallFilter temporary(Call call) const {
    return [call, temp = temp()](const CallInfo& info) {
      if (info.call != call) return false;
      std::error_code error;
      const std::string path =
          std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(info.descriptor), error);
      return path.starts_with(temp);
    };
  }

  Status run(FaultInjector& injector) {
    std::filesystem::remove(file(GetParam().output));
    const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
    Status status;
    {
      const Faults faults({&injector});
      status = GetParam().run(*this);
    }
    EXPECT_EQ(entryCount("/proc/self/fd"), descriptors);
    return status;
  }

  // Error, and no output; or the right output.
  void expectNoSilence(FaultInjector& injector, const std::string& what) {
    SCOPED_TRACE(what);
    const Status status = run(injector);
    const bool exists = std::filesystem::exists(file(GetParam().output));
    EXPECT_EQ(exists, status.ok()) << status.message();
    if (!status.ok()) {
      // Damage to a temporary scene is found as that of any scene
      EXPECT_TRUE(status.code() == StatusCode::kIoError ||
                  status.code() == StatusCode::kCorruption);
      EXPECT_THAT(status.message(), testing::HasSubstr("temp"));
      ++errors_;
    } else if (exists) {
      EXPECT_TRUE(readBytes(file(GetParam().output)) == expected_) << "wrong without a word";
    }
  }

  TestDirectory directory_;
  std::string expected_;
  int errors_ = 0;
};

TEST_P(TemporaryFaultTest, FailuresAndDamageAreTold) {
  CountCalls reads(temporary(Call::kPread)), writes(temporary(Call::kPwrite));
  ASSERT_TRUE(run(reads).ok());
  const Status status = run(writes);
  ASSERT_TRUE(status.ok()) << status.message();
  ASSERT_GT(reads.count(), 0);
  ASSERT_GT(writes.count(), 0);
  expected_ = readBytes(file(GetParam().output));
  const auto sweep = [](int count, const std::function<void(int)>& fault) {
    const int step = std::max(1, count / kFaultsOfAKind);
    for (int number = 1 + step / 2; number <= count; number += step) fault(number);
  };
  sweep(reads.count(), [&](int number) {
    FailCall once(number, EIO, FailCall::Repeat::kOnce, temporary(Call::kPread));
    expectNoSilence(once, "read " + std::to_string(number) + " fails");
    FlipBit flip(number, temporary(Call::kPread));
    expectNoSilence(flip, "read " + std::to_string(number) + " brings a wrong bit");
  });
  sweep(writes.count(), [&](int number) {
    FailCall full(number, ENOSPC, FailCall::Repeat::kForEver, temporary(Call::kPwrite));
    expectNoSilence(full, "write " + std::to_string(number) + " finds a full disk");
  });
  EXPECT_GT(errors_, 0);
}

Status gather(const TemporaryFaultTest& test) {
  auto options = test.with<GatherOptions>(0);
  options.quality.max_solid_angle = 6;
  options.quality.raster_resolution = 2;
  Progress quiet;
  // The least memory, which its message names: then receivers and results go to the disk
  options.memory_bytes = 1;
  const auto tryIt = [&] {
    return gatherCloud(test.file("scene.sft"), test.file("receivers.ply"), test.file("g.ply"),
                       options, quiet)
        .status();
  };
  const std::string message = tryIt().message();
  const std::size_t end = message.find(" MiB is the least that works");
  if (end == message.npos) return Status::failed(message);
  const std::size_t begin = message.rfind(' ', end - 1) + 1;
  options.memory_bytes =
      static_cast<std::uint64_t>(std::stod(message.substr(begin)) * (1 << 20)) + 1;
  return tryIt();
}

Status bounce(const TemporaryFaultTest& test) {
  auto options = test.with<BounceOptions>(std::uint64_t{256} << 20);
  options.bounces = 2;
  options.quality.max_solid_angle = 6;
  options.quality.raster_resolution = 2;
  Progress quiet;
  return bounceScene(test.file("scene.sft"), test.file("b.sft"), options, quiet).status();
}

Status indexCloud(const TemporaryFaultTest& test, const char* cloud, bool estimates_normals) {
  auto options = test.with<IndexOptions>(std::uint64_t{128} << 20);
  if (estimates_normals) {
    options.normals.emplace();
    options.normals->orientation.toward = NormalOrientation::Toward::kConsistent;
  }
  Progress quiet;
  return indexClouds({test.file(cloud)}, test.file("i.sft"), options, quiet).status();
}

Status convert(const TemporaryFaultTest& test, const char* output) {
  const auto options = test.with<ConvertOptions>(std::uint64_t{64} << 20);
  Progress quiet;
  return convertClouds({test.file("bare.ply")}, test.file(output), options, quiet).status();
}

Status normals(const TemporaryFaultTest& test) {
  const auto options = test.with<NormalsOptions>(std::uint64_t{256} << 20);
  Progress quiet;
  return estimateNormals(test.file("bare.ply"), test.file("n.ply"), options, quiet).status();
}

INSTANTIATE_TEST_SUITE_P(
    Jobs, TemporaryFaultTest,
    testing::Values(Job{"gather2", 2, gather, "g.ply"}, Job{"gather8", 8, gather, "g.ply"},
                    Job{"bounce4", 4, bounce, "b.sft"},
                    Job{"indexBare3", 3,
                        [](auto& test) { return indexCloud(test, "bare.ply", false); }, "i.sft"},
                    Job{"indexOriented2", 2,
                        [](auto& test) { return indexCloud(test, "bare.ply", true); }, "i.sft"},
                    Job{"normals2", 2, normals, "n.ply"},
                    Job{"las", 1, [](auto& test) { return convert(test, "c.las"); }, "c.las"},
                    Job{"pdb", 1, [](auto& test) { return convert(test, "c.pdb"); }, "c.pdb"}),
    [](const auto& job) { return std::string(job.param.name); });

}  // namespace
}  // namespace surfeit
