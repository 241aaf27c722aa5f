#include "surfeit/index.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <memory>
#include <new>
#include <optional>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/thread_scratch.h"
#include "index/index_from.h"
#include "index/index_places.h"
#include "index/notes/told_once.h"
#include "index/steps/cloud_reader.h"
#include "index/steps/group_plan.h"
#include "index/steps/index_neighbours.h"
#include "index/steps/index_notes.h"
#include "index/steps/index_plan.h"
#include "index/steps/phase_clock.h"
#include "index/steps/pinned_cube.h"
#include "index/steps/scene_description.h"
#include "index/steps/scene_place.h"
#include "octree/build/bucket_stream.h"
#include "octree/build/octree_builder.h"
#include "octree/build/scene_writer.h"
#include "octree/neighbours/local_density.h"
#include "octree/neighbours/repeated_surfels.h"
#include "storage/output_target.h"

namespace surfeit {
namespace {

// Bytes per surfel of a finished file: the least, and as many as any cloud took; and of packed
// blocks the least.
constexpr double kLeastOutputBytes = 6;
constexpr double kUsualOutputBytes = 26;
constexpr double kLeastPackedBytes = 10;
// The octree of bare positions, at full precision.
constexpr double kBareOutputBytes = 40;

// kIoError when a directory's file system has less room.
Status checkRoom(const std::string& directory, double needed, const char* advice) {
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t available, availableBytes(directory));
  if (double(available) >= needed) return {};
  return Status::ioError(fmt::format("{}: {} MiB are free, expected at least {:.0f} MiB: {}",
                                     directory, available >> 20, needed / (1 << 20), advice));
}

Bounds3 boundsOf(std::span<const Surfel> surfels) {
  Bounds3 bounds;
  for (const Surfel& surfel : surfels) bounds.add(surfel.position);
  return bounds;
}

glm::vec3 moved(const glm::vec3& position, const glm::dvec3& shift) {
  return glm::vec3(glm::dvec3(position) + shift);
}

class Indexer {
 public:
  Indexer(GroupPlan groups, const std::string& output, const IndexOptions& options, int threads,
          Progress& progress, const SourceOpener& opener = {})
      : groups_(std::move(groups)),
        opener_(opener),
        output_(output),
        options_(options),
        threads_(threads),
        progress_(progress),
        temporary_directory_(temporaryDirectory(options.temporary_directory, output)),
        clock_(stats_) {}

  Result<IndexStats> run();
  // Without a name: the places alone, or with normals where options say so.
  Result<SceneFile> runUnnamed();

 private:
  Status openInputs();
  Status checkFreeSpace(double packed_bytes);
  Status checkOutputRoom() const;
  Result<std::unique_ptr<SurfelStore>> readInputs();
  Result<std::unique_ptr<SurfelStore>> readInto(const std::optional<RootCube>& cube);
  Status takeSample();
  glm::dvec3 originAsked(const Bounds3& bounds) const {
    return surfeit::originAsked(options_, bounds, reader_->origin());
  }
  RootCube cubeOf(const Bounds3& bounds) const {
    return cubeAsked(options_, bounds, reader_->origin());
  }
  bool moveOrigin(const glm::dvec3& origin);
  bool mayNeedNeighbours() const { return reader_->lacksSizes() || options_.normals.has_value(); }
  bool estimatesNormals() const { return options_.normals && totals_.spheres > 0; }
  UpAxis up() const { return options_.up.value_or(reader_->up()); }
  std::optional<NormalRule> normalRule() const;
  Status tellRepeats();
  Status build(SceneWriter& writer, SortedSurfelStream& stream, const char* phase);
  Result<std::unique_ptr<SceneWriter>> createWriter(const std::string& path, bool full_precision);
  Result<std::unique_ptr<BucketStream>> readBuckets();
  std::string unnamedPath() const { return temporary_directory_ + "/surfeit-octree.sft"; }
  Result<SceneFile> buildUnnamed(SortedSurfelStream& stream, const char* phase);
  Result<SceneFile> buildPlaces(std::unique_ptr<BucketStream> buckets);
  Status buildWithNeighbours(std::unique_ptr<BucketStream> buckets, SceneWriter& writer);
  SceneDescription describe(const std::optional<NormalRule>& rule) const;
  std::string provenance() const;
  // Nothing more is planned, and building has a use for the memory.
  void freeSamples() {
    sample_ = std::vector<Surfel>();
    totals_.sample = std::vector<Surfel>();
  }

  const GroupPlan groups_;
  GroupNames group_names_;
  const SourceOpener opener_;
  const std::string& output_;
  const IndexOptions& options_;
  const int threads_;
  Progress& progress_;
  ToldOnce reading_progress_{progress_};  // inputs may be read again
  const std::string temporary_directory_;
  bool keeps_places_ = false;  // of an unnamed scene, in which places are looked up
  std::optional<CloudReader> reader_;
  std::vector<Surfel> sample_;
  std::optional<PinnedCube> pinned_;
  IndexPlan plan_;
  bool gives_space_back_ = false;
  CloudTotals totals_;
  std::optional<RepeatFilter> distinct_;  // of the sorted buckets
  IndexStats stats_;
  PhaseClock clock_;
};

Result<IndexStats> Indexer::run() {
  SURFEIT_ASSIGN_OR_RETURN(auto buckets, readBuckets());
  noteIndexRules(totals_, *reader_, options_, progress_);
  noteSceneName(output_, progress_);
  freeSamples();
  // Others may have filled the disk while we read; blocks that are read will give room back
  if (!gives_space_back_) SURFEIT_RETURN_IF_ERROR(checkOutputRoom());
  SURFEIT_ASSIGN_OR_RETURN(const auto writer, createWriter(output_, options_.full_precision));
  if (totals_.missesSizes() || estimatesNormals()) {
    SURFEIT_RETURN_IF_ERROR(buildWithNeighbours(std::move(buckets), *writer));
  } else {
    SURFEIT_RETURN_IF_ERROR(build(*writer, *distinct_, "build"));
    SURFEIT_RETURN_IF_ERROR(tellRepeats());
    stats_.temporary_bytes = buckets->temporaryBytes();
    buckets.reset();
  }
  SURFEIT_RETURN_IF_ERROR(writer->finish(provenance()));
  stats_.file_bytes = writer->fileBytes();
  clock_.finish("finish");
  return stats_;
}

Result<SceneFile> Indexer::runUnnamed() {
  keeps_places_ = true;
  SURFEIT_ASSIGN_OR_RETURN(auto buckets, readBuckets());
  noteStrays(totals_, reader_->origin(), false, progress_);
  freeSamples();
  if (!estimatesNormals()) return buildPlaces(std::move(buckets));
  SURFEIT_ASSIGN_OR_RETURN(const auto writer, createWriter(unnamedPath(), true));
  SURFEIT_RETURN_IF_ERROR(buildWithNeighbours(std::move(buckets), *writer));
  return writer->finishUnnamed(provenance());
}

Result<std::unique_ptr<BucketStream>> Indexer::readBuckets() {
  stats_.memory_bytes = options_.memory_bytes;
  if (groups_.inputs.empty()) return Status::invalidArgument("index: no input cloud");
  SURFEIT_RETURN_IF_ERROR(checkIndexOptions(options_));
  if (options_.cube) pinned_.emplace(*options_.cube);
  SURFEIT_RETURN_IF_ERROR(openInputs());
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<SurfelStore> store, readInputs());
  stats_.skipped_records = totals_.skipped;
  auto buckets = std::make_unique<BucketStream>(
      std::move(store),
      BucketStream::Options{cubeOf(totals_.bounds), plan_.bucket_capacity, plan_.spare_memory,
                            temporary_directory_},
      progress_);
  distinct_.emplace(*buckets, options_.repeats);
  return buckets;
}

// Opens the inputs, takes a sample where that is possible, and plans.
Status Indexer::openInputs() {
  SURFEIT_ASSIGN_OR_RETURN(const RowReaderOptions reading, readingOf(options_));
  SURFEIT_ASSIGN_OR_RETURN(
      reader_, CloudReader::open(groups_.inputs, options_.strict,
                                 readBytesWithin(options_.memory_bytes), reading, opener_));
  reader_->setGroups(groups_.of_inputs);
  for (const std::string& note : reader_->notes()) progress_.note(note);
  std::vector<std::string> notes;
  group_names_ = groupNames(groups_, *reader_, notes);
  for (const std::string& note : notes) progress_.note(note);
  if (options_.origin || pinned_) reader_->setOrigin(originAsked({}));
  const std::uint64_t records = reader_->recordCount();
  if (records > kReadBatch && reader_->isSeekable()) SURFEIT_RETURN_IF_ERROR(takeSample());
  // The octree of bare positions is built at full precision
  const SlabForm form = {options_.leaf_capacity, options_.full_precision || mayNeedNeighbours()};
  const double packed_bytes = packedBytesPerSurfel(sample_);
  SURFEIT_ASSIGN_OR_RETURN(
      plan_, planIndex({options_.memory_bytes, threads_, records, packed_bytes, form,
                        mayNeedNeighbours() ? leastNeighbourBytes(options_.normals, threads_) : 0,
                        options_.repeats == Repeats::kThin ? RepeatFilter::kBytesPerSurfel : 0}));
  stats_.input_bytes = reader_->fileBytes();
  SURFEIT_RETURN_IF_ERROR(checkFreeSpace(sample_.empty() ? kLeastPackedBytes : packed_bytes));
  clock_.finish("sample");
  return {};
}

// A sample about the origin that it asks for.
Status Indexer::takeSample() {
  const std::uint64_t buckets = usualBucketCount(reader_->recordCount());
  SURFEIT_ASSIGN_OR_RETURN(sample_, reader_->sample(buckets));
  if (sample_.empty()) return {};
  if (moveOrigin(originAsked(boundsOf(sample_)))) {
    SURFEIT_ASSIGN_OR_RETURN(sample_, reader_->sample(buckets));
  }
  for (Surfel& surfel : sample_) applySizeRules(surfel, options_.disk_overlap);
  return {};
}

// Counts positions from another origin from now on, those of the sample too; false when it is the
// same one.
bool Indexer::moveOrigin(const glm::dvec3& origin) {
  const glm::dvec3 shift = reader_->origin() - origin;
  if (shift == glm::dvec3(0)) return false;
  for (Surfel& surfel : sample_) surfel.position = moved(surfel.position, shift);
  reader_->setOrigin(origin);
  return true;
}

// Refuses what cannot end well, before hours are spent on it. When temporary file and scene will
// not both fit whole, the temporary file gives back what has been read from it. packed_bytes: of a
// surfel.
Status Indexer::checkFreeSpace(double packed_bytes) {
  const double records = double(reader_->recordCount());
  double spilled = plan_.spills ? records * packed_bytes : 0;
  if (mayNeedNeighbours()) spilled += records * kBareOutputBytes;
  SURFEIT_RETURN_IF_ERROR(
      checkRoom(temporary_directory_, 0.9 * spilled,
                "make room, or choose another place for temporary files (--temp)"));
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t available, availableBytes(temporary_directory_));
  gives_space_back_ = double(available) < 1.1 * spilled + records * kUsualOutputBytes;
  return checkOutputRoom();
}

Status Indexer::checkOutputRoom() const {
  const double records = double(reader_->recordCount());
  return checkRoom(outputDirectory(output_), records * kLeastOutputBytes,
                   "make room, or write the scene elsewhere");
}

// All surfels, distributed. The curve needs the bounds of the cloud, and coordinates the origin
// that these ask for: a sample nearly always gives the right ones; when it did not, what was read
// tells the bounds, and all is read again. Bounds about a far origin are rough: that may happen
// twice.
Result<std::unique_ptr<SurfelStore>> Indexer::readInputs() {
  constexpr int kMostPasses = 4;
  std::optional<RootCube> cube;
  if (!sample_.empty() || pinned_) cube = cubeOf(boundsOf(sample_));
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<SurfelStore> store, readInto(cube));
  if (totals_.surfels == 0) {
    return Status::corruption(fmt::format("{}: no valid surfel in {} records",
                                          groups_.inputs.front(), reader_->recordCount()));
  }
  if (pinned_) {
    SURFEIT_RETURN_IF_ERROR(pinned_->status(totals_.surfels, totals_.bounds, reader_->origin()));
  }
  clock_.finish("read");
  for (int pass = 1; store == nullptr; ++pass) {
    sample_ = std::move(totals_.sample);
    const CloudTotals before = std::move(totals_);
    const glm::dvec3 old_origin = reader_->origin();
    const bool is_moved = moveOrigin(originAsked(before.bounds));
    const Bounds3d bounds = movedBounds(before.bounds, old_origin - reader_->origin());
    SURFEIT_ASSIGN_OR_RETURN(store, readInto(rootCube(bounds)));
    clock_.finish("read again");
    const bool is_same =
        totals_.surfels == before.surfels && (is_moved || totals_.content == before.content);
    if (!is_same || (store == nullptr && pass == kMostPasses)) {
      return Status::failed(
          fmt::format("{}: {} surfels when read again, {} before, or other ones: "
                      "an input changed meanwhile",
                      output_, totals_.surfels, before.surfels));
    }
  }
  return store;
}

// Reads all inputs and distributes the surfels along the curve of `cube`, unless that turns out not
// to be the cloud's cube, or the origin not to be the one that the cloud asks for: then no store.
// Without a cube this works as long as there is one bucket.
Result<std::unique_ptr<SurfelStore>> Indexer::readInto(const std::optional<RootCube>& cube) {
  SurfelStore::Plan store_plan;
  std::atomic<bool> distributing{plan_.bucket_count == 1 || cube.has_value()};
  if (plan_.bucket_count > 1 && cube) {
    store_plan.splitters = splittersOf(sample_, *cube, plan_.bucket_count);
  }
  store_plan.block_surfels = plan_.block_surfels;
  store_plan.memory_bytes = plan_.block_memory;
  store_plan.temporary_directory = temporary_directory_;
  store_plan.gives_back = gives_space_back_;
  auto store = std::make_unique<SurfelStore>(std::move(store_plan));
  const bool needs_cube = store->bucketCount() > 1;

  const auto consume = [&](std::span<Surfel> surfels, const Bounds3& bounds) -> Status {
    if (pinned_) pinned_->look(surfels, bounds, reader_->origin());
    if (surfels.empty() || !distributing) return {};
    std::vector<CurveKey>& keys = threadScratch<std::vector<CurveKey>>([] {});
    keys.resize(surfels.size());
    if (needs_cube) {
      if (!contains(*cube, bounds)) {
        distributing = false;
        return {};
      }
      curveKeys(&surfels.front().position, sizeof(Surfel), *cube, keys);
    }
    for (Surfel& surfel : surfels) {
      applySizeRules(surfel, options_.disk_overlap);
      // Positions are told apart by their bits: 0 and -0 are one
      if (options_.repeats == Repeats::kThin) surfel.position += glm::vec3(0);
    }
    return store->add(surfels, keys);
  };
  progress_.beginPhase("read", reader_->recordCount(), "surfels");
  SURFEIT_ASSIGN_OR_RETURN(totals_, reader_->readAll(consume, reading_progress_));
  if (totals_.surfels > 0 && (!distributing || (needs_cube && !(cubeOf(totals_.bounds) == *cube)) ||
                              originAsked(totals_.bounds) != reader_->origin())) {
    return std::unique_ptr<SurfelStore>();
  }
  SURFEIT_RETURN_IF_ERROR(store->finish());
  return store;
}

Result<std::unique_ptr<SceneWriter>> Indexer::createWriter(const std::string& path,
                                                           bool full_precision) {
  const std::optional<NormalRule> rule = normalRule();
  const SceneDescription description = describe(rule);
  return SceneWriter::create(path, description.header(full_precision),
                             description.identity(full_precision));
}

SceneDescription Indexer::describe(const std::optional<NormalRule>& rule) const {
  return {options_,      group_names_, totals_, reader_->origin(), up(), rule ? &*rule : nullptr,
          reader_->crs()};
}

std::string Indexer::provenance() const {
  const std::optional<NormalRule> rule = normalRule();
  return describe(rule).provenance();
}

Status Indexer::build(SceneWriter& writer, SortedSurfelStream& stream, const char* phase) {
  progress_.beginPhase(phase, totals_.surfels - distinct_->leftOut(), "surfels");
  SURFEIT_RETURN_IF_ERROR(buildOctree(stream, writer, plan_.slabs, progress_));
  const std::uint64_t expected = totals_.surfels - distinct_->leftOut();
  if (writer.header().surfel_count != expected) {
    return Status::failed(fmt::format("{}: {} surfels written, expected {}: this is a bug", output_,
                                      writer.header().surfel_count, expected));
  }
  stats_.surfels = writer.header().surfel_count;
  stats_.nodes = writer.header().node_count;
  stats_.node_pages = writer.nodePages();
  stats_.surfel_pages = writer.surfelPages();
  clock_.finish(phase);
  return {};
}

Result<SceneFile> Indexer::buildUnnamed(SortedSurfelStream& stream, const char* phase) {
  SURFEIT_ASSIGN_OR_RETURN(const auto writer, createWriter(unnamedPath(), true));
  SURFEIT_RETURN_IF_ERROR(build(*writer, stream, phase));
  return writer->finishUnnamed(provenance());
}

// Before the scene has its name: with --strict it gets none.
Status Indexer::tellRepeats() {
  stats_.repeated_surfels = distinct_->repeated();
  noteRepeats(stats_, options_, progress_);
  return progress_.isCancelled() ? Status::interrupted() : Status();
}

// An octree over the bare positions.
Result<SceneFile> Indexer::buildPlaces(std::unique_ptr<BucketStream> buckets) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile places, buildUnnamed(*distinct_, "order"));
  stats_.temporary_bytes = buckets->temporaryBytes() + places.fileBytes();
  return places;
}

// Absent where no surfel asks for it.
std::optional<NormalRule> Indexer::normalRule() const {
  if (!estimatesNormals()) return std::nullopt;
  return NormalRule(*options_.normals, up(), reader_->origin(), glm::vec3(totals_.bounds.centre()));
}

Status Indexer::buildWithNeighbours(std::unique_ptr<BucketStream> buckets, SceneWriter& writer) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile places, buildPlaces(std::move(buckets)));
  SURFEIT_RETURN_IF_ERROR(tellRepeats());
  NeighbourBuild how;
  how.disk_overlap = options_.disk_overlap;
  how.threads = threads_;
  how.memory_bytes = plan_.octree_memory;
  how.temporary_directory = temporary_directory_;
  how.up = up();
  how.normals = normalRule();
  how.keeps_places = keeps_places_;
  how.build_unnamed = [&](SortedSurfelStream& stream, const char* phase) {
    return buildUnnamed(stream, phase);
  };
  how.build = [&](SortedSurfelStream& stream) { return build(writer, stream, "build"); };
  SURFEIT_RETURN_IF_ERROR(buildFromNeighbours(std::move(places), how, stats_, clock_, progress_));
  noteThinSurfels(stats_, options_, progress_);
  noteScatteredSurfels(stats_, progress_);
  return {};
}

}  // namespace

Result<SceneFile> indexPlaces(const std::string& input, const std::string& beside,
                              const IndexOptions& options, Progress& progress) {
  Result<SceneFile> places = Status::failed("places: not indexed");
  withThreads(options.threads, [&] {
    places = Indexer({{input}, {}, {}}, beside, options, options.threads, progress).runUnnamed();
  });
  return places;
}

Result<IndexStats> indexFrom(const std::vector<std::string>& inputs, const SourceOpener& opener,
                             const std::string& output, const IndexOptions& given,
                             Progress& progress) {
  return guarded(output, [&]() -> Result<IndexStats> {
    IndexOptions options = given;
    if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kUsualIndexMemory);
    const int threads = indexThreads(options, progress);
    SURFEIT_ASSIGN_OR_RETURN(const GroupPlan groups, planGroups(inputs, options.named, !opener));
    Result<IndexStats> result = Status::failed("index: not run");
    withThreads(threads, [&] {
      result = Indexer(groups, output, options, threads, progress, opener).run();
    });
    return result;
  });
}

Result<IndexStats> indexClouds(const std::vector<std::string>& inputs, const std::string& output,
                               const IndexOptions& options, Progress& progress) {
  return indexFrom(inputs, {}, output, options, progress);
}

}  // namespace surfeit
