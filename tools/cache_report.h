// What the caches of a gather did: a table for people, JSON for statistics, and the monitor's
// record over time as CSV or JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "surfeit/bake.h"
#include "surfeit/status.h"

namespace surfeit {

// Fields as in docs/stats.md.
nlohmann::json cacheJson(const GatherCacheStats& cache);
nlohmann::json windowsJson(const std::vector<GatherWindow>& windows);

// A table of some lines, without a final newline.
std::string cacheTable(const GatherStats& stats);

// Writes the record over time: JSON when the name ends in ".json", else CSV with a line of names.
Status writeCacheSeries(const std::string& path, const std::vector<GatherWindow>& windows);

}  // namespace surfeit
