// Every sample file beside the repository is read as its README describes it, or refused with a
// reason.
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"

namespace surfeit {
namespace {

namespace fs = std::filesystem;

const fs::path kData = SURFEIT_SHARED_DATA_DIR;

struct Sample {
  std::string path;                    // below kData
  std::optional<std::uint64_t> count;  // of points or vertices, where the README says it
};

// The rows of README's table: "| path | what it is | contents | ...".
std::vector<Sample> readSamples() {
  std::vector<Sample> samples;
  std::ifstream file(kData / "README.md");
  const std::regex row(R"(^\| ([^ |]+/[^ |]+) \|[^|]*\|([^|]*)\|.*)");
  const std::regex count(R"((\d+) (points|vertices|particles)\b)");
  for (std::string line; std::getline(file, line);) {
    std::smatch cells, number;
    if (!std::regex_match(line, cells, row)) continue;
    samples.push_back({cells[1], {}});
    const std::string contents = cells[2];
    if (std::regex_search(contents, number, count)) samples.back().count = std::stoull(number[1]);
  }
  return samples;
}

// Why those that are no clouds are refused, by the end of their names.
const std::map<std::string, std::string>& refusals() {
  static const std::map<std::string, std::string> reasons = {
      {".hair", "found HAIR"},
      {"LatLong.exr", "expected world positions"},
      {".hdr", "found a Radiance picture"},
      {".JPG", "found a JPEG picture"},
      {".obj", "`surfeit sample` makes one of a mesh"},
      {".mtl", "expected a cloud"},
      {".icecache", "found a particle cache of Softimage ICE"},
  };
  return reasons;
}

std::string refusalOf(const std::string& path) {
  for (const auto& [ending, reason] : refusals()) {
    if (path.ends_with(ending)) return reason;
  }
  return "";
}

// Reads the cloud to its end.
void expectCloud(const Sample& sample) {
  const std::string path = kData / sample.path;
  Result<std::unique_ptr<RowReader>> reader = openRowReader(path);
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  const RowLayout& element = (*reader)->element();
  std::uint64_t count = 0;
  AlignedBuffer buffer;
  for (;;) {
    const Result<Bytes> rows = (*reader)->readRows(1 << 12, buffer);
    ASSERT_TRUE(rows.ok()) << rows.status().message();
    if (rows->empty()) break;
    count += rows->size() / element.row_bytes;
  }
  EXPECT_GT(count, 0u);
  EXPECT_EQ(count, element.count);
  if (sample.count) {
    EXPECT_EQ(count, *sample.count);
  }
}

TEST(SharedDataTest, EveryFileIsReadOrRefusedWithAReason) {
  if (!fs::exists(kData / "README.md")) GTEST_SKIP() << "no sample files in " << kData;
  std::size_t read = 0, refused = 0;
  for (const Sample& sample : readSamples()) {
    SCOPED_TRACE(sample.path);
    ASSERT_TRUE(fs::exists(kData / sample.path));
    const std::string reason = refusalOf(sample.path);
    if (reason.empty()) {
      expectCloud(sample);
      ++read;
      continue;
    }
    const auto reader = openRowReader(kData / sample.path);
    ASSERT_FALSE(reader.ok());
    EXPECT_NE(reader.status().message().find(reason), std::string::npos)
        << reader.status().message();
    ++refused;
  }
  std::printf("%zu files read, %zu refused\n", read, refused);
  EXPECT_GE(read + refused, 50u);
}

}  // namespace
}  // namespace surfeit
