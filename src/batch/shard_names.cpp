#include "batch/shard_names.h"

#include <fmt/format.h>

#include <charconv>
#include <cstddef>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "storage/file.h"

namespace surfeit {
namespace {

constexpr std::string_view kOf = "-of-";

// The number at the end of a text that is digits alone.
bool readNumber(std::string_view text, int& number) {
  const char* const end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, number);
  return error == std::errc() && at == end && number > 0;
}

}  // namespace

std::string shardPath(const std::string& result_path, int shard, int count) {
  return fmt::format("{}.shard-{:0{}}-of-{}", result_path, shard, fmt::formatted_size("{}", count),
                     count);
}

std::string shardPlanPath(const std::string& result_path, int count) {
  return fmt::format("{}.shards-of-{}", result_path, count);
}

Result<std::set<int>> shardCounts(const std::string& result_path) {
  namespace fs = std::filesystem;
  const std::string begin = fs::path(result_path).filename().string() + ".shard-";
  const std::string directory = directoryOf(result_path);
  std::set<int> counts;
  std::error_code error;
  for (fs::directory_iterator at(directory, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    const std::size_t of = name.rfind(kOf);
    int shard = 0, count = 0;
    if (name.starts_with(begin) && of != std::string::npos && of > begin.size() &&
        readNumber(std::string_view(name).substr(begin.size(), of - begin.size()), shard) &&
        readNumber(std::string_view(name).substr(of + kOf.size()), count) && shard <= count &&
        count <= kMostShards) {
      counts.insert(count);
    }
  }
  if (error) {
    return Status::ioError(fmt::format("{}: cannot be listed: {}", directory, error.message()));
  }
  return counts;
}

}  // namespace surfeit
