#include "octree/octree_builder.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <utility>

#include "core/assert.h"
#include "core/recycler.h"

namespace surfeit {
namespace {

// A slab on its way through the stages.
struct Work {
  Slab slab;
  BuiltSlab built;
  std::vector<FullNodePage> full_pages;
  std::vector<EncodedPages> node_pages;  // one each; there may be more from before
};
using WorkPtr = std::shared_ptr<Work>;

// Slabs on their way: enough that stages do not wait for each other.
std::size_t slabsInFlight(int threads) { return static_cast<std::size_t>(threads) * 3 / 2 + 2; }

// The stages. What fails first ends the work: later stages pass what they get.
class OctreePipeline {
 public:
  OctreePipeline(SortedSurfelStream& stream, SceneWriter& writer, Progress& progress)
      : cutter_(stream),
        writer_(writer),
        // The writer's header changes while slabs are built
        header_(writer.header()),
        stitcher_(writer),
        progress_(progress) {}

  Status run(int threads);

 private:
  WorkPtr cut();
  void build(Work& work);
  void stitch(Work& work);
  void encode(Work& work);
  void write(Work& work);
  void note(const Status& status);

  SlabCutter cutter_;
  SceneWriter& writer_;
  const SceneHeader header_;
  SlabStitcher stitcher_;
  Progress& progress_;
  Recycler<Work> works_;
  std::mutex mutex_;  // guards status_
  Status status_;
  std::atomic<bool> failed_{false};
};

void OctreePipeline::note(const Status& status) {
  if (status.ok()) return;
  const std::lock_guard lock(mutex_);
  if (status_.ok()) status_ = status;
  failed_ = true;
}

WorkPtr OctreePipeline::cut() {
  if (progress_.isCancelled()) note(Status::interrupted());
  if (failed_) return nullptr;
  Result<std::optional<Slab>> slab = cutter_.next();
  note(slab.status());
  if (!slab.ok() || !slab->has_value()) return nullptr;
  const WorkPtr work = works_.take();
  work->slab = std::move(**slab);
  return work;
}

void OctreePipeline::build(Work& work) {
  if (failed_) return;
  note(buildSlab(work.slab, header_, work.built));
  work.slab = {};
}

void OctreePipeline::stitch(Work& work) {
  if (failed_) return;
  stitcher_.add(work.built);
  work.full_pages = writer_.takeFullNodePages();
}

void OctreePipeline::encode(Work& work) {
  if (failed_) return;
  work.node_pages.resize(std::max(work.node_pages.size(), work.full_pages.size()));
  for (std::size_t i = 0; i < work.full_pages.size(); ++i) {
    work.node_pages[i].clear();
    note(encodeNodePage(work.full_pages[i], header_.full_precision, work.node_pages[i]));
    work.full_pages[i].nodes = {};
  }
}

void OctreePipeline::write(Work& work) {
  if (failed_) return;
  note(writer_.addSurfelPages(work.built.surfel_pages, work.built.surfel_count));
  for (std::size_t i = 0; i < work.full_pages.size() && !failed_; ++i) {
    note(writer_.addNodePage(work.full_pages[i].level, work.node_pages[i].bytes,
                             work.node_pages[i].pages.front().payload_bytes));
  }
  progress_.advance(work.built.surfel_count);
  progress_.advanceBytes(work.built.surfel_pages.bytes.size());
}

Status OctreePipeline::run(int threads) {
  using tbb::filter_mode;
  const auto stage = [](auto&& function) {
    return [function](WorkPtr work) {
      function(*work);
      return work;
    };
  };
  const auto source = [this](tbb::flow_control& control) {
    WorkPtr work = cut();
    if (work == nullptr) control.stop();
    return work;
  };
  tbb::parallel_pipeline(
      slabsInFlight(threads),
      tbb::make_filter<void, WorkPtr>(filter_mode::serial_in_order, source) &
          tbb::make_filter<WorkPtr, WorkPtr>(filter_mode::parallel,
                                             stage([this](Work& work) { build(work); })) &
          tbb::make_filter<WorkPtr, WorkPtr>(filter_mode::serial_in_order,
                                             stage([this](Work& work) { stitch(work); })) &
          tbb::make_filter<WorkPtr, WorkPtr>(filter_mode::parallel,
                                             stage([this](Work& work) { encode(work); })) &
          tbb::make_filter<WorkPtr, void>(filter_mode::serial_in_order,
                                          [this](const WorkPtr& work) { write(*work); }));
  if (failed_) return status_;
  SURFEIT_CHECK(stitcher_.isComplete());

  // Pages that never became full
  Work rest;
  rest.full_pages = writer_.takeOpenNodePages();
  encode(rest);
  write(rest);
  return status_;
}

}  // namespace

void SlabStitcher::add(BuiltSlab& slab) {
  places_.clear();
  std::size_t node = 0;
  for (BuiltSlab::Root& root : slab.roots) {
    while (places_.size() < root.siblings_end) {
      const BuiltSlab::Siblings& siblings = slab.siblings[places_.size()];
      const std::span<LevelNode> nodes = std::span(slab.nodes).subspan(node, siblings.count);
      for (LevelNode& sibling : nodes) resolve(sibling);
      places_.push_back(writer_.addSiblings(siblings.level, nodes));
      node += siblings.count;
    }
    resolve(root.node.node);
    if (slab.is_giant) {
      addGiantPiece(slab, root);
    } else {
      join(root.node, root.boundary_level);
    }
  }
  surfel_pages_ += static_cast<std::uint32_t>(slab.surfel_pages.pages.size());
}

// From numbers in the slab to places in the file.
void SlabStitcher::resolve(LevelNode& node) const {
  if (node.node.isLeaf()) {
    node.node.page += surfel_pages_;
  } else {
    const GroupPlace& place = places_[node.node.page];
    node.node.page = place.page;
    node.node.first = place.first;
  }
}

// The sums of a giant leaf add up piece by piece; its sphere is that around their box.
void SlabStitcher::addGiantPiece(BuiltSlab& slab, BuiltSlab::Root& root) {
  if (slab.giant_begins) {
    giant_ = root.node;
  } else {
    giant_.sums.add(root.node.sums);
  }
  if (!slab.giant_ends) return;
  const Node first = giant_.node.node;
  Node& node = giant_.node.node;
  node = giant_.sums.toNode(writer_.header().flatness_limit);
  node.radius = radiusOfBox(node.position, giant_.sums.disk_bounds) * 1.000001f;
  node.page = first.page;
  node.first = first.first;
  join(giant_, root.boundary_level);
}

void SlabStitcher::join(FinishedNode& node, int boundary_level) {
  if (!sweep_.place(node, boundary_level, 0)) return;
  writer_.addSiblings(0, {&node.node, 1});
  complete_ = true;
}

Status buildOctree(SortedSurfelStream& stream, SceneWriter& writer, int threads,
                   Progress& progress) {
  return OctreePipeline(stream, writer, progress).run(threads);
}

double SlabForm::nodesPerSurfel() const { return std::min(2.0, 4.0 / leaf_capacity); }

std::uint64_t buildOctreeBytes(const SlabForm& form, int threads) {
  // A slab has at most 2 * kBrickSurfels surfels, with their nodes and pages, in vectors that grow
  // by doubling; a thread fetches the surfels of one slab at a time
  constexpr double kSlack = 1.5;
  constexpr double kQuantizedBytes = 20, kFullBytes = 60;
  constexpr std::uint64_t kFetchBytes = 2 * kBrickSurfels * (sizeof(Surfel) + sizeof(CurveKey));
  const double surfel_bytes = form.nodesPerSurfel() * sizeof(LevelNode) +
                              (form.full_precision ? kFullBytes : kQuantizedBytes);
  const std::uint64_t slab_bytes =
      static_cast<std::uint64_t>(kSlack * 2 * kBrickSurfels * surfel_bytes);
  return slabsInFlight(threads) * slab_bytes + static_cast<std::uint64_t>(threads) * kFetchBytes;
}

}  // namespace surfeit
