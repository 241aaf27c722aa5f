#include "octree/build/octree_builder.h"

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "core/assert.h"
#include "core/first_failure.h"
#include "core/parallel.h"

namespace surfeit {
namespace {

// A slab on its way through the stages. Its memory is used again by a later one.
struct Work {
  BuiltSlab built;
  std::vector<FullNodePage> full_pages;
  std::vector<EncodedPages> node_pages;  // one each; there may be more from before
};

// The stages. What fails first ends the work: later stages pass what they get.
class OctreePipeline {
 public:
  OctreePipeline(SlabSource& source, SceneWriter& writer, std::size_t slabs, Progress& progress)
      : source_(source),
        writer_(writer),
        // The writer's header changes while slabs are built
        header_(writer.header()),
        stitcher_(writer),
        progress_(progress),
        works_(slabs) {
    for (std::size_t i = 0; i < works_.size(); ++i) free_works_.push_back(i);
  }

  Status run();

 private:
  std::optional<std::size_t> fetch();
  void build(Work& work);
  void stitch(Work& work);
  void encode(Work& work);
  void write(Work& work);
  void giveBack(Work& work);

  SlabSource& source_;
  SceneWriter& writer_;
  const SceneHeader header_;
  SlabStitcher stitcher_;
  Progress& progress_;
  FirstFailure failure_;
  std::vector<Work> works_;
  std::mutex free_mutex_;                // guards free_works_
  std::vector<std::size_t> free_works_;  // the last one given back is taken first: caches have it
};

std::optional<std::size_t> OctreePipeline::fetch() {
  if (progress_.isCancelled()) failure_.note(Status::interrupted());
  if (failure_.happened()) return std::nullopt;
  std::size_t number = 0;
  {
    const std::lock_guard lock(free_mutex_);
    SURFEIT_CHECK(!free_works_.empty());
    number = free_works_.back();
    free_works_.pop_back();
  }
  const Result<bool> has_one = source_.fetch(number);
  failure_.note(has_one.status());
  if (!has_one.ok() || !*has_one) return std::nullopt;
  return number;
}

void OctreePipeline::build(Work& work) {
  if (failure_.happened()) return;
  failure_.note(source_.build(static_cast<std::size_t>(&work - works_.data()), work.built));
}

void OctreePipeline::stitch(Work& work) {
  if (failure_.happened()) return;
  stitcher_.add(work.built);
  work.full_pages = writer_.takeFullNodePages();
}

void OctreePipeline::encode(Work& work) {
  if (failure_.happened()) return;
  work.node_pages.resize(std::max(work.node_pages.size(), work.full_pages.size()));
  for (std::size_t i = 0; i < work.full_pages.size(); ++i) {
    work.node_pages[i].clear();
    failure_.note(encodeNodePage(work.full_pages[i], header_.pageForm(), work.node_pages[i]));
    work.full_pages[i].nodes = {};
  }
}

void OctreePipeline::write(Work& work) {
  if (failure_.happened()) return;
  failure_.note(writer_.addSurfelPages(work.built.surfel_pages, work.built.surfel_count));
  for (std::size_t i = 0; i < work.full_pages.size() && !failure_.happened(); ++i) {
    failure_.note(writer_.addNodePage(work.full_pages[i].level, work.node_pages[i].bytes,
                                      work.node_pages[i].pages.front().payload_bytes));
  }
  progress_.advance(work.built.surfel_count);
  progress_.advanceBytes(work.built.surfel_pages.bytes.size());
}

void OctreePipeline::giveBack(Work& work) {
  const std::lock_guard lock(free_mutex_);
  free_works_.push_back(static_cast<std::size_t>(&work - works_.data()));
}

Status OctreePipeline::run() {
  using Mode = PipelineStage::Mode;
  const auto stage = [this](Mode mode, void (OctreePipeline::*work)(Work&)) {
    return PipelineStage{mode, [this, work](std::size_t i) { (this->*work)(works_[i]); }};
  };
  const PipelineStage stages[] = {stage(Mode::kParallel, &OctreePipeline::build),
                                  stage(Mode::kInOrder, &OctreePipeline::stitch),
                                  stage(Mode::kParallel, &OctreePipeline::encode),
                                  stage(Mode::kInOrder, &OctreePipeline::write),
                                  stage(Mode::kParallel, &OctreePipeline::giveBack)};
  runPipeline(
      works_.size(), [this] { return fetch(); }, stages);
  if (failure_.happened()) return failure_.status();
  SURFEIT_CHECK(stitcher_.isComplete());

  // Pages that never became full
  Work rest;
  rest.full_pages = writer_.takeOpenNodePages();
  encode(rest);
  write(rest);
  return failure_.status();
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
    if (slab.giant) {
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

// The sums of a giant leaf add up piece by piece; its sphere is that around their box, and nothing
// is known of slab and cone, because the normal is known after the last piece only.
void SlabStitcher::addGiantPiece(BuiltSlab& slab, BuiltSlab::Root& root) {
  if (slab.giant->begins) {
    giant_ = root.node;
  } else {
    giant_.sums.add(root.node.sums);
  }
  if (!slab.giant->ends) return;
  const Node first = giant_.node.node;
  Node& node = giant_.node.node;
  const float radius = radiusOfBox(giant_.sums.centre(), giant_.sums.disk_bounds) * 1.000001f;
  node = giant_.sums.toNode(writer_.header().flatness_limit, radius);
  giant_.node.normal_angle = kUnknownAngle;
  node.page = first.page;
  node.first = first.first;
  join(giant_, root.boundary_level);
}

void SlabStitcher::join(FinishedNode& node, int boundary_level) {
  if (!sweep_.place(node, boundary_level, 0)) return;
  writer_.addSiblings(0, {&node.node, 1});
  complete_ = true;
}

Status buildOctree(SortedSurfelStream& stream, SceneWriter& writer, std::size_t slabs,
                   Progress& progress) {
  CutSlabs source(stream, writer.header(), slabs);
  return stitchOctree(source, writer, slabs, progress);
}

Status stitchOctree(SlabSource& source, SceneWriter& writer, std::size_t slabs,
                    Progress& progress) {
  return OctreePipeline(source, writer, slabs, progress).run();
}

double SlabForm::nodesPerSurfel() const { return std::min(2.0, 4.0 / leaf_capacity); }

std::uint64_t buildOctreeBytes(const SlabForm& form, int threads, std::size_t slabs) {
  // A slab has at most 2 * kBrickSurfels surfels, with their nodes and pages, in vectors that grow
  // by doubling; the batches that its surfels came in stay meanwhile. A thread fetches the surfels
  // of one slab at a time.
  constexpr double kSlack = 1.5;
  constexpr double kQuantizedBytes = 24, kFullBytes = 64;
  constexpr std::uint64_t kSlabSurfels = 2 * kBrickSurfels;
  constexpr std::uint64_t kFetchBytes = kSlabSurfels * (sizeof(Surfel) + sizeof(CurveKey));
  constexpr double kBatchBytes = sizeof(Surfel) + sizeof(Ticket);
  const double built_bytes = form.nodesPerSurfel() * sizeof(LevelNode) +
                             (form.full_precision ? kFullBytes : kQuantizedBytes);
  return slabs * static_cast<std::uint64_t>(kSlabSurfels * (kSlack * built_bytes + kBatchBytes)) +
         static_cast<std::uint64_t>(threads) * kFetchBytes;
}

}  // namespace surfeit
