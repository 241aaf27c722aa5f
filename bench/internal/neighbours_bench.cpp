// Rates of what neighbours tell, per second of one core: sizes, normals, both.
//
//   neighbours_bench CLOUD... [--repeat N]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "bench/or_exit.h"
#include "core/job_limits.h"
#include "index/index_places.h"
#include "octree/neighbours/surface_search.h"
#include "octree/read/paged_octree.h"

namespace surfeit {
namespace {

std::unique_ptr<PagedOctree> octreeOf(const std::string& cloud) {
  IndexOptions options;
  options.memory_bytes = std::uint64_t{1} << 30;
  options.threads = 1;
  Progress quiet;
  const std::string beside = std::filesystem::temp_directory_path() / "neighbours";
  SceneFile file = take(indexPlaces(cloud, beside, options, quiet));
  const auto memory =
      take(PagedOctree::planMemory(file, PagedOctree::unlimitedCacheBytes(file), 1));
  return take(PagedOctree::create(std::move(file), memory));
}

// Millions a second and core, of all places of a cloud.
double rateOf(PagedOctree& octree, const SurfaceNeeds& needs) {
  constexpr std::uint32_t kPages = 16;  // as many as local_density.cpp takes
  const SceneFile& file = octree.file();
  const std::size_t capacity = file.header().surfel_group_capacity;
  const Progress quiet;
  SurfaceSearch search(octree);
  std::vector<Surfel> surfels;
  std::uint64_t count = 0;
  const double before = processCpuSeconds();
  for (std::uint32_t page = 0; page < file.surfelPageCount();) {
    SceneFile::Scratch scratch;
    surfels.clear();
    for (std::uint32_t i = 0; i < kPages && page < file.surfelPageCount(); ++i, ++page) {
      const std::size_t size = surfels.size();
      surfels.resize(size + capacity);
      surfels.resize(size +
                     take(file.decodeSurfels(page, scratch, std::span(surfels).subspan(size))));
    }
    need(search.find(
        surfels, [&](std::size_t) { return needs; },
        [&](std::size_t, const SurfaceAt&) { ++count; }, quiet));
  }
  return double(count) / (processCpuSeconds() - before) / 1e6;
}

double medianRate(PagedOctree& octree, const SurfaceNeeds& needs, int repeat) {
  std::vector<double> rates;
  for (int i = 0; i < repeat; ++i) rates.push_back(rateOf(octree, needs));
  std::sort(rates.begin(), rates.end());
  return rates[rates.size() / 2];
}

void run(const std::vector<std::string>& clouds, int repeat) {
  fmt::print(
      "Millions of points a second of one core, medians of {}.\n\n"
      "| cloud | points | sizes | normals | both |\n|---|--:|--:|--:|--:|\n",
      repeat);
  for (const std::string& cloud : clouds) {
    const std::unique_ptr<PagedOctree> octree = octreeOf(cloud);
    fmt::print("| {} | {} | {:.2f} | {:.2f} | {:.2f} |\n",
               std::filesystem::path(cloud).stem().string(), octree->file().header().surfel_count,
               medianRate(*octree, {.size = true}, repeat),
               medianRate(*octree, {.plane = true, .normal = true}, repeat),
               medianRate(*octree, {.size = true, .plane = true, .normal = true}, repeat));
  }
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  CLI::App app("Rates of sizes and normals from neighbours");
  std::vector<std::string> clouds;
  int repeat = 5;
  app.add_option("CLOUD", clouds, "Positions are enough")->required();
  app.add_option("--repeat", repeat, "Runs of each")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  surfeit::run(clouds, repeat);
  return 0;
}
