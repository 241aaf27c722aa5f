#include "tools/cache_report.h"

#include <fmt/format.h>

#include "surfeit/output.h"
#include "tools/command.h"

namespace surfeit {
namespace {

double percent(double part, double whole) { return whole > 0 ? 100 * part / whole : 0; }

double hitPercent(const GatherCacheStats& cache) {
  return cache.requests > 0 ? percent(double(cache.hits), double(cache.requests)) : 100;
}

std::string cacheRow(const char* name, const GatherCacheStats& cache) {
  return fmt::format("  {:<8}{:>16}{:>10.4f}{:>9.2f}{:>12}{:>12}{:>11}{:>12}", name,
                     formatCount(cache.requests), hitPercent(cache),
                     percent(double(cache.front_hits), double(cache.requests)),
                     formatCount(cache.misses), formatCount(cache.prefetches),
                     formatCount(cache.repeated_loads), formatCount(cache.evictions));
}

std::string memoryRow(const char* name, const GatherCacheStats& cache) {
  return fmt::format("  {:<8}{:>12}{:>12}{:>9.1f}{:>9.1f}{:>12}{:>12}{:>13}{:>12}", name,
                     formatBytes(cache.bytes_read), formatBytes(cache.repeated_bytes),
                     cache.load_seconds, cache.stall_seconds, formatBytes(cache.budget_bytes),
                     formatBytes(cache.peak_bytes), formatBytes(cache.working_set_bytes),
                     formatBytes(cache.decoded_bytes));
}

nlohmann::json windowJson(const GatherWindow& window) {
  return {{"begin_seconds", window.begin_seconds},
          {"end_seconds", window.end_seconds},
          {"receivers", window.receivers},
          {"run_receivers", window.run_receivers},
          {"prefetch_receivers", window.prefetch_receivers},
          {"node_cache", cacheJson(window.node_cache)},
          {"surfel_cache", cacheJson(window.surfel_cache)}};
}

// One line for every window; the fields of the caches by the names of the JSON.
std::string seriesCsv(const std::vector<GatherWindow>& windows) {
  std::string text;
  const auto addRow = [&text](const nlohmann::json& window, bool names) {
    std::string row;
    for (const auto& [name, value] : window.items()) {
      if (value.is_object()) continue;
      row += (row.empty() ? "" : ",") + (names ? name : value.dump());
    }
    for (const char* cache : {"node_cache", "surfel_cache"}) {
      for (const auto& [name, value] : window[cache].items()) {
        row += "," + (names ? fmt::format("{}.{}", cache, name) : value.dump());
      }
    }
    text += row + "\n";
  };
  addRow(windowJson({}), true);
  for (const GatherWindow& window : windows) addRow(windowJson(window), false);
  return text;
}

}  // namespace

nlohmann::json cacheJson(const GatherCacheStats& cache) {
  return {{"requests", cache.requests},
          {"hits", cache.hits},
          {"front_hits", cache.front_hits},
          {"shared_hits", cache.shared_hits},
          {"waits", cache.waits},
          {"misses", cache.misses},
          {"prefetches", cache.prefetches},
          {"repeated_loads", cache.repeated_loads},
          {"evictions", cache.evictions},
          {"bytes_read", cache.bytes_read},
          {"repeated_bytes", cache.repeated_bytes},
          {"load_seconds", cache.load_seconds},
          {"stall_seconds", cache.stall_seconds},
          {"peak_bytes", cache.peak_bytes},
          {"budget_bytes", cache.budget_bytes},
          {"decoded_bytes", cache.decoded_bytes},
          {"working_set_bytes", cache.working_set_bytes}};
}

nlohmann::json windowsJson(const std::vector<GatherWindow>& windows) {
  nlohmann::json array = nlohmann::json::array();
  for (const GatherWindow& window : windows) array.push_back(windowJson(window));
  return array;
}

std::string cacheTable(const GatherStats& stats) {
  return fmt::format(
      "  {:<8}{:>16}{:>10}{:>9}{:>12}{:>12}{:>11}{:>12}\n{}\n{}\n"
      "  {:<8}{:>12}{:>12}{:>9}{:>9}{:>12}{:>12}{:>13}{:>12}\n{}\n{}",
      "cache", "requests", "hits %", "front %", "misses", "prefetches", "repeated", "evictions",
      cacheRow("nodes", stats.node_cache), cacheRow("surfels", stats.surfel_cache), "", "read",
      "repeated", "load s", "stall s", "budget", "peak", "working set", "all",
      memoryRow("nodes", stats.node_cache), memoryRow("surfels", stats.surfel_cache));
}

Status writeCacheSeries(const std::string& path, const std::vector<GatherWindow>& windows) {
  return writeOutput(
      path, path.ends_with(".json") ? jsonText(windowsJson(windows)) + "\n" : seriesCsv(windows));
}

}  // namespace surfeit
