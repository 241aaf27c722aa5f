// The files of a job in shards, which stand beside its result.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "surfeit/shards.h"
#include "surfeit/status.h"

namespace surfeit {

// Where the shards begin.
std::string shardPlanPath(const std::string& result_path, int count);

// The numbers of shards of the jobs that have some beside a result.
Result<std::set<int>> shardCounts(const std::string& result_path);

// "2, 5, 7-9", of rising numbers; without blanks as job schedulers want them.
std::string numberRanges(const std::vector<int>& numbers, const char* separator = ", ");

}  // namespace surfeit
