// The files of a job in shards, which stand beside its result.
#pragma once

#include <set>
#include <string>

#include "surfeit/shards.h"
#include "surfeit/status.h"

namespace surfeit {

// Where the shards begin.
std::string shardPlanPath(const std::string& result_path, int count);

// The numbers of shards of the jobs that have some beside a result.
Result<std::set<int>> shardCounts(const std::string& result_path);

}  // namespace surfeit
