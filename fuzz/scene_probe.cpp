#include "fuzz/scene_probe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <glm/vec3.hpp>
#include <iterator>
#include <span>
#include <string_view>
#include <vector>

#include "cloud/rows/row_filter.h"
#include "core/assert.h"
#include "fuzz/row_probe.h"
#include "octree/node/node.h"
#include "octree/page/node_group.h"
#include "octree/page/page_form.h"
#include "octree/page/page_limits.h"
#include "octree/page/surfel_group.h"
#include "surfeit/cloud_info.h"
#include "surfeit/progress.h"
#include "surfeit/scene.h"
#include "surfels/generated/scene_generator.h"
#include "surfels/generated/scene_recipe.h"
#include "tests/io/page_file_damage.h"

namespace surfeit {
namespace {

constexpr std::size_t kHeaderBytes = 512;
// Where a file declares pages that this does not hold, the message says what would do
constexpr std::uint64_t kMemory = 128 << 20;

std::string contentsOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void checkSceneRefusal(const Status& status) {
  SURFEIT_CHECK(!status.message().empty());
  if (status.code() != StatusCode::kBudgetTooSmall) checkRefusal(status);
}

PageForm formOf(std::byte first) {
  const auto has = [&](int bit) { return (std::to_integer<int>(first) >> bit & 1) != 0; };
  return {.full_precision = has(0),
          .has_albedo = has(1),
          .has_groups = has(2),
          .has_long_sides = has(3),
          .has_bounds = has(4),
          .has_opacity = has(5),
          .has_lobes = has(6)};
}

}  // namespace

void probeScene(const std::string& path) {
  std::string file = contentsOf(path);
  if (file.size() < kHeaderBytes + kFooterBytes) return;
  sealPages(file);
  sealFile(file);
  std::ofstream(path, std::ios::binary | std::ios::trunc) << file;

  Progress progress;
  const Result<VerifyReport> report = verifyScene(path, 1, progress, kMemory);
  if (!report.ok()) checkSceneRefusal(report.status());
  const Result<CloudInfo> info = readCloudInfo(path, {}, progress);
  if (!info.ok()) checkSceneRefusal(info.status());
}

void probeSurfelPage(const std::string& path) {
  const std::string bytes = contentsOf(path);
  if (bytes.empty()) return;
  const Bytes all = std::as_bytes(std::span(bytes)), payload = all.subspan(1);
  const PageForm form = formOf(all[0]);
  std::vector<Surfel> surfels(kDefaultSurfelGroup);
  const Result<std::uint32_t> count = decodeSurfelGroup(payload, form, surfels);
  if (!count.ok()) return checkRefusal(count.status());
  SURFEIT_CHECK(*count >= 1 && *count <= surfels.size());
  std::vector<glm::vec3> radiosity(*count);
  for (std::uint32_t i = 0; i < *count; ++i) {
    SURFEIT_CHECK(std::isfinite(surfels[i].position.x) && std::isfinite(surfels[i].area));
    radiosity[i] = surfels[i].radiosity;
  }
  std::vector<std::byte> replaced;
  const std::vector<Lobe> lobes(form.has_lobes ? *count : 0);
  const Result<std::size_t> front =
      replaceSurfelRadiosity(payload, form, radiosity, replaced, lobes);
  SURFEIT_CHECK(front.ok() && *front <= replaced.size());
  const Result<std::uint32_t> again = decodeSurfelGroup(replaced, form, surfels);
  SURFEIT_CHECK(again.ok() && *again == *count);
}

void probeNodePage(const std::string& path) {
  const std::string bytes = contentsOf(path);
  if (bytes.empty()) return;
  const Bytes all = std::as_bytes(std::span(bytes)), payload = all.subspan(1);
  std::array<std::uint32_t, 23> first_pages = {};
  for (std::size_t i = 0; i < first_pages.size(); ++i) {
    first_pages[i] = std::uint32_t(std::min<std::size_t>(i, 20));
  }
  const NodeLimits limits{first_pages, 64, kDefaultNodeGroup, kDefaultSurfelGroup};
  std::vector<Node> nodes(kDefaultNodeGroup);
  const PageForm form = formOf(all[0]);
  const Result<std::uint32_t> count = decodeNodeGroup(payload, form, 0, limits, nodes);
  if (!count.ok()) return checkRefusal(count.status());
  SURFEIT_CHECK(*count >= 1 && *count <= nodes.size());
  const auto decoded = std::span(nodes).first(*count);
  std::vector<std::byte> replaced;
  const Result<std::size_t> front = replaceNodeRadiosity(payload, form, decoded, replaced);
  SURFEIT_CHECK(front.ok() && *front <= replaced.size());
}

void probeRecipe(const std::string& path) {
  const Result<SceneRecipe> recipe = parseSceneRecipe(contentsOf(path), "recipe");
  if (!recipe.ok()) return checkRefusal(recipe.status());
  const Result<SceneGenerator> generator = SceneGenerator::create(*recipe);
  if (!generator.ok()) checkRefusal(generator.status());
}

void probeExpression(const std::string& path) {
  std::array<RowProperty, 2> properties;
  properties[0].name = "x";
  properties[1].name = "group";
  properties[1].type = ValueType::kUint8;
  properties[1].offset = 4;
  const Result<RowFilter> filter = RowFilter::create(contentsOf(path), properties);
  if (!filter.ok()) return checkRefusal(filter.status());
  constexpr std::size_t kRowBytes = 5;
  const std::vector<std::byte> rows(kRowBytes * kFilterRows, std::byte{63});
  std::array<std::uint8_t, kFilterRows> holds;
  RowFilter::Workspace workspace;
  filter->test(rows.data(), kRowBytes, kFilterRows, workspace, holds.data());
  for (const std::uint8_t one : holds) SURFEIT_CHECK(one == holds[0]);
}

}  // namespace surfeit
