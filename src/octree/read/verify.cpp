#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <mutex>

#include "core/first_failure.h"
#include "core/job_limits.h"
#include "core/program_memory.h"
#include "core/worker_threads.h"
#include "octree/node/lobe.h"
#include "octree/page/surfel_marks.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "octree/read/verify_bounds.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxFindings = 100;
// Stack and allocator of a thread, and the sums of its subtrees.
constexpr std::uint64_t kThreadBytes = std::uint64_t{768} << 10;
// Quantized sums and spheres may differ by this part.
constexpr float kAreaTolerance = 2e-3f;
constexpr float kReachTolerance = 2e-3f;
constexpr double kPowerTolerance = 1e-2;

// Collects findings from several threads.
class Findings {
 public:
  explicit Findings(VerifyReport& report) : report_(report) {}
  void add(const std::string& finding) {
    const std::lock_guard lock(mutex_);
    // A damaged page is met again by every reference to it
    if (std::find(report_.findings.begin(), report_.findings.end(), finding) !=
        report_.findings.end()) {
      return;
    }
    ++report_.finding_count;
    if (report_.findings.size() < kMaxFindings) report_.findings.push_back(finding);
  }
  void finish() { std::sort(report_.findings.begin(), report_.findings.end()); }

 private:
  std::mutex mutex_;
  VerifyReport& report_;
};

// A number that differs between places of records. Sums of it over all records and over all
// references to records are equal when every record is referenced exactly once.
std::uint64_t placeHash(std::uint32_t page, std::uint32_t index) {
  std::uint64_t hash = (std::uint64_t{page} << 32 | index) + 0x9e3779b97f4a7c15ull;
  hash = (hash ^ hash >> 30) * 0xbf58476d1ce4e5b9ull;
  hash = (hash ^ hash >> 27) * 0x94d049bb133111ebull;
  return hash ^ hash >> 31;
}

// In double: squares of the least lengths are no floats.
float distanceBetween(const glm::vec3& a, const glm::vec3& b) {
  return float(glm::distance(glm::dvec3(a), glm::dvec3(b)));
}

// Checks pages one by one. Each thread has its own. All share the number of surfels that leaves
// refer to: those that refer to more than there are would be visited for ever.
class PageChecker {
 public:
  PageChecker(const SceneFile& file, PagedOctree& octree, Findings& findings,
              const Progress& progress, std::atomic<std::uint64_t>& referenced)
      : file_(file),
        reader_(octree),
        findings_(findings),
        progress_(progress),
        referenced_(referenced) {
    nodes_.resize(file.header().node_group_capacity);
    surfels_.resize(file.header().surfel_group_capacity);
    if (file.header().has_lobes) lobes_.resize(file.header().node_group_capacity);
  }

  // Returns how many records the page holds, 0 when it is damaged; kIoError when it cannot be read.
  Result<std::uint64_t> checkSurfelPage(std::uint32_t page) {
    const Result<std::uint32_t> count = file_.decodeSurfels(page, scratch_, surfels_);
    if (!count.ok()) return report(count.status());
    Status outside, marked;
    for (std::uint32_t i = 0; i < *count; ++i) {
      surfel_balance_ += placeHash(page, i);
      noteBrightness(surfels_[i].radiosity);
      if (outside.ok()) outside = checkInBounds(surfels_[i], i);
      if (marked.ok()) marked = checkMarks(surfels_[i], i);
    }
    for (const Status& status : {outside, marked}) {
      if (status.ok()) continue;
      const std::uint32_t file_page = file_.nodePageCount() + page;
      findings_.add(file_.pages().pageError(file_page, status.message()).message());
    }
    return std::uint64_t{*count};
  }

  Result<std::uint64_t> checkNodePage(std::uint32_t page) {
    const Result<std::uint32_t> count = file_.decodeNodes(page, scratch_, nodes_, lobes_);
    if (!count.ok()) return report(count.status());
    page_brightest_ = 0;
    for (std::uint32_t i = 0; i < *count; ++i) {
      noteBrightness(nodes_[i].radiosity);
      for (int c = 0; c < 3; ++c) {
        page_brightest_ = std::max(page_brightest_, nodes_[i].radiosity[c]);
      }
    }
    for (std::uint32_t i = 0; i < *count; ++i) {
      if (progress_.isCancelled()) return Status::interrupted();
      node_balance_ += placeHash(page, i);
      node_lobes_ = lobes_.empty() ? nullptr : &lobes_[i];
      const Status status = nodes_[i].isLeaf() ? checkLeaf(nodes_[i]) : checkInterior(nodes_[i]);
      if (status.ok()) continue;
      const Status at =
          status.code() == StatusCode::kCorruption && !describesPage(status)
              ? file_.pages().pageError(page, fmt::format("node {}: {}", i, status.message()))
              : status;
      SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t none, report(at));
      static_cast<void>(none);
    }
    return std::uint64_t{*count};
  }

  // Records minus references to them, as sums of placeHash: zero over a sound file, once the root
  // counts as referenced.
  std::uint64_t nodeBalance() const { return node_balance_; }
  std::uint64_t surfelBalance() const { return surfel_balance_; }
  // Largest radiosity of the records.
  float brightest() const { return brightest_; }

 private:
  // A damaged page is a finding and the check goes on; a failing disk is not.
  Result<std::uint64_t> report(const Status& status) {
    if (status.code() != StatusCode::kCorruption) return status;
    findings_.add(status.message());
    return std::uint64_t{0};
  }

  bool describesPage(const Status& status) const {
    return status.message().rfind(file_.path(), 0) == 0;
  }

  void noteBrightness(const glm::vec3& radiosity) {
    brightest_ = std::max({brightest_, radiosity.x, radiosity.y, radiosity.z});
  }

  static constexpr const char* kColors[] = {"red", "green", "blue"};

  // Area times opacity, by color.
  template <typename Record>
  static glm::dvec3 coveredBy(const Record& record) {
    return double(record.area) *
           glm::dvec3(record.opacity(0), record.opacity(1), record.opacity(2));
  }

  // What a node claims, against what lies below it.
  struct Below {
    double area = 0;
    glm::dvec3 covered{0};  // by color
    std::uint64_t surfels = 0;
    std::uint64_t groups = 0;
    glm::dvec3 power{0};
    glm::dvec3 lobe{0};        // of that what is sent in lobes
    bool has_one_lobe = true;  // all of it is in the lobes of surfels or of flat nodes
    float brightest = 0;
    float reach = 0;
    // A surfel or a child.
    template <typename Record>
    void add(const Node& node, const Record& record, float radius, std::uint64_t count,
             std::uint64_t record_groups) {
      area += double(record.area);
      const glm::dvec3 part = coveredBy(record);
      covered += part;
      power += part * glm::dvec3(record.radiosity);
      for (int c = 0; c < 3; ++c) brightest = std::max(brightest, record.radiosity[c]);
      surfels += count;
      groups |= record_groups;
      reach = std::max(reach, distanceBetween(record.position, node.position) + radius);
    }
    template <typename Record>
    void addLobe(const Record& record, const Lobe& of_record) {
      lobe += coveredBy(record) * glm::dvec3(record.radiosity) * glm::dvec3(of_record.shares());
    }
  };

  // Positions are quantized by less than a radius.
  Status checkInBounds(const Surfel& surfel, std::uint32_t index) const {
    const Bounds3& bounds = file_.header().bounds;
    for (int axis = 0; axis < 3; ++axis) {
      const float at = surfel.position[axis];
      if (at >= bounds.min[axis] - surfel.radius && at <= bounds.max[axis] + surfel.radius) {
        continue;
      }
      return Status::corruption(
          fmt::format("surfel {}: {} at {}, expected {} to {}, the header's "
                      "bounds",
                      index, "xyz"[axis], at, bounds.min[axis], bounds.max[axis]));
    }
    return {};
  }

  // Programs that do not know a feature bit refuse the scene, so the header names what it has.
  Status checkMarks(const Surfel& surfel, std::uint32_t index) const {
    const std::uint32_t marks = marksOf(surfel);
    if (marks == 0) return {};
    const SceneHeader& header = file_.header();
    const struct {
      std::uint32_t marks;
      bool is_named;
      const char* name;
      int bit;
    } kinds[] = {{kSurfelHiddenSides, header.has_layers, "has hidden sides", 4},
                 {kSurfelLoose | kSurfelLone, header.has_loose, "is loose", 8},
                 {kNodeShares, header.has_sharers, "shares its piece of surface", 32},
                 {kNodeTiles, header.has_tiles, "is a tile", 64}};
    for (const auto& kind : kinds) {
      if ((marks & kind.marks) == 0 || kind.is_named) continue;
      return Status::corruption(fmt::format(
          "surfel {}: it {}, expected feature bit {} of the header", index, kind.name, kind.bit));
    }
    return {};
  }

  Status compare(const Node& node, const Below& below) const {
    if (below.surfels != node.surfel_count) {
      return Status::corruption(fmt::format("surfel count {}, expected {} from what lies below",
                                            node.surfel_count, below.surfels));
    }
    if (below.groups != node.groups) {
      return Status::corruption(fmt::format("groups {:#x}, expected {:#x} from what lies below",
                                            node.groups, below.groups));
    }
    if (std::abs(below.area - double(node.area)) > double(kAreaTolerance * node.area)) {
      return Status::corruption(
          fmt::format("area {}, expected {} from what lies below", node.area, below.area));
    }
    const glm::dvec3 covered = coveredBy(node);
    for (int c = 0; c < 3; ++c) {
      if (std::abs(below.covered[c] - covered[c]) <= double(kAreaTolerance * node.area)) continue;
      return Status::corruption(
          fmt::format("{}opacity {}, expected {} from what lies below",
                      node.isTinted() ? fmt::format("{} ", kColors[c]) : std::string(),
                      node.opacity(c), below.covered[c] / below.area));
    }
    // What is a millionth as bright as the brightest may be lost: steps are parts of a page's
    // largest
    const double slack = 1e-6 * below.area * double(std::max(below.brightest, page_brightest_));
    for (int c = 0; c < 3; ++c) {
      const double power = covered[c] * double(node.radiosity[c]);
      if (std::abs(below.power[c] - power) <= kPowerTolerance * below.power[c] + slack) continue;
      return Status::corruption(fmt::format("{} radiosity {}, expected {} from what lies below",
                                            kColors[c], node.radiosity[c],
                                            below.power[c] / below.covered[c]));
    }
    return compareLobes(node, below, slack);
  }

  // Of flat nodes, which sum up all lobes below; codes of shares are steps of 1/255.
  Status compareLobes(const Node& node, const Below& below, double slack) const {
    if (node_lobes_ == nullptr || !below.has_one_lobe) return {};
    if (!node.isFlat() || node.isTwoSided()) return {};
    Below own;
    own.addLobe(node, (*node_lobes_)[0]);
    for (int c = 0; c < 3; ++c) {
      if (std::abs(below.lobe[c] - own.lobe[c]) <= kPowerTolerance * below.power[c] + slack)
        continue;
      return Status::corruption(
          fmt::format("{} share of its lobe {}, expected {} from what lies below", kColors[c],
                      (*node_lobes_)[0].shares()[c], below.lobe[c] / below.power[c]));
    }
    return {};
  }

  Status checkInterior(const Node& node) {
    for (std::uint32_t i = 0; i < node.child_count; ++i) {
      node_balance_ -= placeHash(node.page, node.first + i);
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> children, reader_.nodes(childrenOf(node)));
    Below below;
    for (const Node& child : children) {
      below.add(node, child, 0, child.surfel_count, child.groups);
      below.has_one_lobe = below.has_one_lobe && child.isFlat() && !child.isTwoSided();
      if (node_lobes_ != nullptr) below.addLobe(child, (*reader_.lobesOf(child))[0]);
      // A child's sphere may stick out of its parent's; its centre, a mean of surfels, may not
      const float distance = distanceBetween(child.position, node.position);
      if (distance > node.radius + (node.radius + child.radius) * kReachTolerance) {
        return Status::corruption(
            fmt::format("bounding radius {}, expected at least {} for the "
                        "centres of its children",
                        node.radius, distance));
      }
    }
    return compare(node, below);
  }

  Status checkLeaf(const Node& node) {
    const std::uint64_t before = referenced_.fetch_add(node.surfel_count);
    if (node.surfel_count > file_.header().surfel_count ||
        before > file_.header().surfel_count - node.surfel_count) {
      findings_.add(fmt::format("{}: leaves refer to more than {} surfels: references form no tree",
                                file_.path(), file_.header().surfel_count));
      referenced_ -= node.surfel_count;
      return {};
    }
    Below below;
    std::uint32_t page = node.page, place = node.first;
    SURFEIT_RETURN_IF_ERROR(reader_.visitLeaf(node, [&](std::span<const Surfel> surfels) {
      const std::span<const Lobe> lobes = reader_.lobesOf(surfels);
      for (std::size_t i = 0; i < lobes.size(); ++i) below.addLobe(surfels[i], lobes[i]);
      for (const Surfel& surfel : surfels) {
        below.add(node, surfel, surfel.radius, 1, groupBit(surfel.group));
        surfel_balance_ -= placeHash(page, place++);
      }
      ++page;
      place = 0;
      return progress_.isCancelled() ? Status::interrupted() : Status();
    }));
    if (below.reach > node.radius * (1 + kReachTolerance)) {
      return Status::corruption(
          fmt::format("bounding radius {}, expected at least {} for the "
                      "disks of its surfels",
                      node.radius, below.reach));
    }
    return compare(node, below);
  }

  const SceneFile& file_;
  PagedOctree::Reader reader_;
  Findings& findings_;
  const Progress& progress_;
  std::atomic<std::uint64_t>& referenced_;
  SceneFile::Scratch scratch_;
  std::vector<Node> nodes_;
  std::vector<NodeLobes> lobes_;           // in a scene with lobes
  const NodeLobes* node_lobes_ = nullptr;  // of the node that is checked
  std::vector<Surfel> surfels_;
  float page_brightest_ = 0;  // of the page of nodes that is checked
  float brightest_ = 0;
  std::uint64_t node_balance_ = 0, surfel_balance_ = 0;
};

// References are followed through small caches: pages come in curve order, so few are needed.
Result<PagedOctree::Memory> planMemory(const SceneFile& file, std::uint64_t memory_bytes,
                                       int threads) {
  constexpr std::uint64_t kMostCacheBytes = std::uint64_t{64} << 20;
  const std::uint64_t thread_bytes =
      file.nodePageCapacityBytes() + file.surfelPageCapacityBytes() + kThreadBytes;
  const std::uint64_t fixed = programBytes(threads) + PagedOctree::fixedBytes(file, threads) +
                              static_cast<std::uint64_t>(threads) * thread_bytes;
  const std::uint64_t least_caches = PagedOctree::leastCacheBytes(file, threads);
  if (memory_bytes == 0) memory_bytes = defaultMemoryBytes();
  if (memory_bytes < fixed + least_caches) {
    return Status::budgetTooSmall(fmt::format(
        "a memory budget of {:.1f} MiB is too small to verify {} with {} {}: {} MiB is the least "
        "that works",
        double(memory_bytes) / (1 << 20), file.path(), threads, threads == 1 ? "thread" : "threads",
        ((fixed + least_caches) >> 20) + 1));
  }
  return PagedOctree::planMemory(
      file, std::clamp(memory_bytes - fixed, least_caches, std::max(least_caches, kMostCacheBytes)),
      threads);
}

}  // namespace

Result<VerifyReport> verifyScene(const std::string& path, int threads, Progress& progress,
                                 std::uint64_t memory_bytes) {
  VerifyReport report;
  Findings findings(report);
  Result<SceneFile> opened = SceneFile::open(path);
  if (!opened.ok()) {
    if (opened.status().code() != StatusCode::kCorruption) return opened.status();
    findings.add(opened.status().message());
    return report;
  }
  threads = threads > 0 ? threads : defaultThreadCount();
  const std::uint32_t node_pages = opened->nodePageCount();
  const std::uint32_t pages = opened->pages().pageCount();
  const std::uint64_t expected_nodes = opened->header().node_count;
  const std::uint64_t expected_surfels = opened->header().surfel_count;

  SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                           planMemory(*opened, memory_bytes, threads));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(*opened), memory));
  const SceneFile& file = octree->file();
  progress.beginPhase("verify", pages, "pages");
  if (const Status tiling = file.pages().checkTiling(); !tiling.ok()) {
    findings.add(tiling.message());
  }

  std::atomic<std::uint32_t> next_page{0};
  std::atomic<std::uint64_t> nodes{0}, surfels{0};
  std::atomic<std::uint64_t> node_balance{0}, surfel_balance{0}, referenced{0};
  std::atomic<float> brightest{0};
  FirstFailure failure;
  const auto work = [&]() -> Status {
    PageChecker checker(file, *octree, findings, progress, referenced);
    while (!failure.happened() && !progress.isCancelled()) {
      const std::uint32_t page = next_page++;
      if (page >= pages) break;
      const bool is_node_page = page < node_pages;
      SURFEIT_ASSIGN_OR_RETURN(
          const std::uint64_t count,
          is_node_page ? checker.checkNodePage(page) : checker.checkSurfelPage(page - node_pages));
      (is_node_page ? nodes : surfels) += count;
      progress.advance(1);
    }
    node_balance += checker.nodeBalance();
    surfel_balance += checker.surfelBalance();
    float most = brightest;
    while (most < checker.brightest() &&
           !brightest.compare_exchange_weak(most, checker.brightest())) {
    }
    return {};
  };
  SURFEIT_RETURN_IF_ERROR(runOnThreads(threads, failure, "verify", work));
  if (progress.isCancelled()) return Status::interrupted();

  // Sums over the whole file
  if (report.finding_count == 0 && (nodes != expected_nodes || surfels != expected_surfels)) {
    findings.add(fmt::format("{}: {} nodes and {} surfels on the pages, the header says {} and {}",
                             path, nodes.load(), surfels.load(), expected_nodes, expected_surfels));
  }
  if (report.finding_count == 0 &&
      (node_balance != placeHash(kRootRange.page, kRootRange.first) || surfel_balance != 0)) {
    findings.add(fmt::format("{}: {} are not each referenced once", path,
                             surfel_balance != 0 ? "surfels" : "nodes"));
  }

  // What is not known to be a tree is not walked
  if (report.finding_count == 0) {
    SURFEIT_RETURN_IF_ERROR(
        verifyBounds(*octree, threads, brightest, progress,
                     [&](const std::string& finding) { findings.add(finding); }));
  }
  report.pages_checked = pages;
  report.bytes_checked = file.fileBytes();
  findings.finish();
  return report;
}

}  // namespace surfeit
