#include "tools/shard_option.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <system_error>

namespace surfeit {

ShardRange parseShard(const std::string& text) {
  ShardRange range;
  const char* const end = text.data() + text.size();
  const auto [slash, error] = std::from_chars(text.data(), end, range.first);
  if (error == std::errc() && slash != end && *slash == '/') {
    const auto [at, count_error] = std::from_chars(slash + 1, end, range.count);
    range.last = range.first;
    if (count_error == std::errc() && at == end && range.first >= 1 && range.first <= range.count &&
        range.count <= kMostShards) {
      return range;
    }
  }
  throw CLI::ValidationError(
      "--shard", fmt::format("{}, expected I/N such as 3/16, with I from 1 to N, and N up to {}",
                             text, kMostShards));
}

}  // namespace surfeit
