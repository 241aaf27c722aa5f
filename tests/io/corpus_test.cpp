// Replays the corpora of the fuzzers (fuzz/README.md): what they found once is never found again.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "fuzz/probe.h"

namespace surfeit {

void PrintTo(const Probe& probe, std::ostream* stream) { *stream << probe.name; }

namespace {

// Readers take a few MiB, pictures 64; the gigabytes that damaged files declare must fail. The
// sanitizers reserve terabytes of addresses, and have limits of their own.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
constexpr rlim_t kMaxGrowthBytes = 256 << 20;
void limitMemory() {
  std::ifstream file("/proc/self/statm");
  rlim_t pages = 0;
  file >> pages;
  const rlim_t limit = pages * 4096 + kMaxGrowthBytes;
  const rlimit limits = {limit, limit};
  setrlimit(RLIMIT_AS, &limits);
}
#else
void limitMemory() {}
#endif

std::vector<std::filesystem::path> filesOf(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

[[noreturn]] void replay(const Probe& probe, const std::vector<std::filesystem::path>& files) {
  limitMemory();
  for (const std::filesystem::path& name : files) {
    std::fprintf(stderr, "%s\n", name.filename().c_str());  // shown when the child fails
    std::ifstream file(name, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    probeBytes(probe, std::as_bytes(std::span(bytes)));
  }
  std::_Exit(0);
}

class CorpusTest : public testing::TestWithParam<Probe> {};

TEST_P(CorpusTest, EveryFileIsReadOrRefused) {
  const std::filesystem::path directory =
      std::filesystem::path(SURFEIT_TEST_SOURCE_DIR) / "../fuzz/corpus" / GetParam().name;
  const std::vector<std::filesystem::path> files = filesOf(directory);
  ASSERT_FALSE(files.empty()) << directory;
  EXPECT_EXIT(replay(GetParam(), files), testing::ExitedWithCode(0), "");
}

INSTANTIATE_TEST_SUITE_P(Formats, CorpusTest, testing::ValuesIn(probes().begin(), probes().end()),
                         [](const testing::TestParamInfo<Probe>& probe) {
                           return std::string(probe.param.name);
                         });

}  // namespace
}  // namespace surfeit
