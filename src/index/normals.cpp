#include "surfeit/normals.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"
#include "core/curve_key.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/program_memory.h"
#include "core/seconds_since.h"
#include "core/up_comment.h"
#include "index/index_places.h"
#include "index/rows/scene_rows.h"
#include "index/steps/index_plan.h"
#include "index/trajectory.h"
#include "octree/neighbours/normal_rule.h"
#include "octree/neighbours/surface_search.h"
#include "storage/external_sorter.h"
#include "storage/output_target.h"

namespace surfeit {
namespace {

// Places that a thread searches at once, and rows that are read at once.
constexpr std::size_t kPlacesPerThread = 8192, kRows = 8192;

// A place along the curve: rows may come in any order, and neighbours are found fast where places
// come beside each other.
struct OrderedPlace {
  std::uint64_t key = 0, row = 0;
  glm::vec3 place{0};
  glm::vec3 sensor{0};  // with a trajectory; no padding: records are written as bytes
};
static_assert(sizeof(OrderedPlace) == 40);

// What was found, by row.
struct FoundRow {
  std::uint64_t row = 0, reserved = 0;
  glm::vec3 normal{0};
  float confidence = 0, area = 0;
  std::uint32_t is_thin = 1, is_two_sided = 0, unused = 0;
};
static_assert(sizeof(FoundRow) == 48);

// A row that has no place.
constexpr FoundRow kNoPlace;

constexpr std::size_t kPlaceBytes = sizeof(OrderedPlace) + sizeof(Surfel) + sizeof(FoundRow);

RowProperty floatProperty(const char* name) {
  RowProperty property;
  property.name = name;
  return property;
}

// Where places of rows lie, counted from an origin as those of the octree.
struct PlaceReader {
  std::array<RowProperty, 3> properties;
  glm::dvec3 origin{0};

  glm::vec3 place(const std::byte* row) const {
    glm::dvec3 position;
    for (int i = 0; i < 3; ++i) {
      const RowProperty& property = properties[std::size_t(i)];
      position[i] = rowValue(row + property.offset, property.type);
    }
    return glm::vec3(position - origin);
  }
};

bool isFinite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

class NormalsJob {
 public:
  NormalsJob(const std::string& input, const std::string& output, const NormalsOptions& options,
             int threads, Progress& progress)
      : input_(input), output_(output), options_(options), progress_(progress), threads_(threads) {
    stats_.memory_bytes =
        options.memory_bytes > 0 ? options.memory_bytes : defaultMemoryBytes(kUsualIndexMemory);
  }

  Result<NormalsStats> run() {
    const auto start = std::chrono::steady_clock::now();
    SURFEIT_RETURN_IF_ERROR(openInput());
    SURFEIT_RETURN_IF_ERROR(indexInput());
    stats_.index_seconds = secondsSince(start);
    SURFEIT_RETURN_IF_ERROR(orderRows());
    SURFEIT_RETURN_IF_ERROR(findNormals());
    octree_.reset();
    SURFEIT_RETURN_IF_ERROR(createWriter());
    SURFEIT_RETURN_IF_ERROR(writeRows());
    SURFEIT_RETURN_IF_ERROR(writer_->finish());
    noteOfWriter();
    tell();
    stats_.seconds = secondsSince(start);
    return stats_;
  }

 private:
  Status openInput() {
    indexing_.memory_bytes = stats_.memory_bytes;
    indexing_.threads = threads_;
    indexing_.temporary_directory = options_.temporary_directory;
    indexing_.channels = options_.channels;
    indexing_.part = options_.part;
    indexing_.filter = options_.filter;
    indexing_.color_range = options_.color_range;
    SURFEIT_ASSIGN_OR_RETURN(const RowReaderOptions reading, readingOf(indexing_));
    SURFEIT_ASSIGN_OR_RETURN(reader_, openCloud(input_, reading));
    const RowLayout& element = reader_->element();
    for (std::size_t i = 0; i < 3; ++i) {
      const RowProperty* const property = element.find(kPositionNames[i]);
      if (property == nullptr) {
        return Status::corruption(fmt::format("{}: no property {}", input_, kPositionNames[i]));
      }
      places_.properties[i] = *property;
    }
    return openTrajectory();
  }

  Status openTrajectory() {
    const NormalOrientation& orientation = options_.estimation.orientation;
    if (orientation.toward != NormalOrientation::Toward::kTrajectory) return {};
    const RowProperty* const time = reader_->element().find("gps_time");
    if (time == nullptr) {
      return Status::invalidArgument(fmt::format(
          "{}: no property gps_time, by which a trajectory is looked up; --channels NAME=gps_time "
          "takes another",
          input_));
    }
    time_ = *time;
    SURFEIT_ASSIGN_OR_RETURN(trajectory_, Trajectory::read(orientation.trajectory, progress_));
    return {};
  }

  Status indexInput() {
    // Neighbours agree on sides over the whole cloud, so an octree of normals is needed
    if (options_.estimation.orientation.toward == NormalOrientation::Toward::kConsistent) {
      indexing_.normals = options_.estimation;
      indexing_.up = options_.up;
      if (reader_->element().find("nx") != nullptr) {
        // In front: of two that name the same the first counts
        indexing_.channels = dropsOf(reader_->element(), "normal") +
                             (indexing_.channels.empty() ? "" : "," + indexing_.channels);
      }
    }
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, indexPlaces(input_, output_, indexing_, progress_));
    stats_.temporary_bytes = scene.fileBytes();
    places_.origin = scene.header().origin;

    const UpAxis up =
        options_.up.value_or(statedUpAxis(reader_->comments()).value_or(kDefaultUpAxis));
    rule_.emplace(options_.estimation, up, places_.origin,
                  glm::vec3(scene.header().bounds.centre()));
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t third, planMemory(scene));
    SURFEIT_ASSIGN_OR_RETURN(
        const PagedOctree::Memory memory,
        PagedOctree::planMemory(
            scene, std::min<std::uint64_t>(third, PagedOctree::unlimitedCacheBytes(scene)),
            threads_));
    SURFEIT_ASSIGN_OR_RETURN(octree_, PagedOctree::create(std::move(scene), memory));
    return {};
  }

  // What each of both sorters and the caches get; fewer threads where that is too little.
  Result<std::uint64_t> planMemory(const SceneFile& scene) {
    const std::uint64_t rows = kRows * std::uint64_t{reader_->element().row_bytes + 64};
    const int wanted = threads_;
    for (;; --threads_) {
      const std::uint64_t beside =
          programBytes(threads_) + PagedOctree::fixedBytes(scene, threads_) +
          PagedOctree::leafRunBytes(scene) + rows +
          std::uint64_t(threads_) * (SurfaceSearch::memoryBytes() + kPlacesPerThread * kPlaceBytes);
      const std::uint64_t least = beside + 3 * ExternalSorter::kLeastMemory;
      if (stats_.memory_bytes >= least) {
        if (threads_ < wanted) {
          progress_.inform(fmt::format("{} of {} threads: a budget of {} MiB feeds no more",
                                       threads_, wanted, stats_.memory_bytes >> 20));
        }
        sorter_bytes_ = (stats_.memory_bytes - beside) / 3;
        return sorter_bytes_;
      }
      if (threads_ > 1) continue;
      return Status::budgetTooSmall(
          fmt::format("--memory of {} MiB is too small for normals: {} MiB is the least that works",
                      stats_.memory_bytes >> 20, (least + (1 << 20) - 1) >> 20));
    }
  }

  ExternalSorter::Options sorting(std::size_t record_bytes) const {
    return {.record_bytes = record_bytes,
            .memory_bytes = sorter_bytes_,
            .temporary_directory = temporaryDirectory(options_.temporary_directory, output_)};
  }

  // The next rows; none at the end.
  Result<Bytes> readRows() {
    if (progress_.isCancelled()) return Status::interrupted();
    return reader_->readRows(kRows, buffer_);
  }

  // The places of all rows along the curve, into places_in_order_.
  Status orderRows() {
    progress_.beginPhase("sort", reader_->element().count, "points");
    places_in_order_.emplace(sorting(sizeof(OrderedPlace)));
    const RootCube& cube = octree_->file().header().cube;
    const std::size_t row_bytes = reader_->element().row_bytes;
    for (std::uint64_t row = 0;;) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, readRows());
      if (rows.empty()) break;
      for (std::size_t at = 0; at < rows.size(); at += row_bytes, ++row) {
        OrderedPlace ordered{0, row, places_.place(rows.data() + at), {}};
        if (!isFinite(ordered.place)) continue;
        ordered.key = curveKey(ordered.place, cube);
        if (trajectory_) ordered.sensor = sensorAt(rows.data() + at);
        SURFEIT_RETURN_IF_ERROR(places_in_order_->add(ordered));
      }
      progress_.advance(rows.size() / row_bytes);
    }
    return places_in_order_->finish();
  }

  // Where the sensor was when it saw the point of a row.
  glm::vec3 sensorAt(const std::byte* row) {
    const double time = rowValue(row + time_.offset, time_.type);
    if (!trajectory_->covers(time)) ++stats_.outside_trajectory;
    return glm::vec3(trajectory_->at(time) - places_.origin);
  }

  // Normals of all places, into found_rows_, by row.
  Status findNormals() {
    progress_.beginPhase("normals", places_in_order_->count(), "points");
    found_rows_.emplace(sorting(sizeof(FoundRow)));
    // Neighbours have agreed on the normals of the octree
    const SurfaceNeeds needs{
        .size = options_.with_sizes, .plane = true, .normal = !rule_->needsSides()};
    std::vector<SurfaceSearch> searches;
    for (int i = 0; i < threads_; ++i) searches.emplace_back(*octree_);
    std::vector<OrderedPlace> batch;
    std::vector<Surfel> surfels;
    std::vector<FoundRow> found;
    while (places_in_order_->current() != nullptr) {
      if (progress_.isCancelled()) return Status::interrupted();
      batch.clear(), surfels.clear();
      const std::size_t most = kPlacesPerThread * std::size_t(threads_);
      while (batch.size() < most && places_in_order_->current() != nullptr) {
        std::memcpy(&batch.emplace_back(), places_in_order_->current(), sizeof(OrderedPlace));
        SURFEIT_RETURN_IF_ERROR(places_in_order_->advance());
        surfels.emplace_back().position = batch.back().place;
        surfels.back().flags = kSurfelSphere;
      }
      found.resize(batch.size());
      SURFEIT_RETURN_IF_ERROR(findOnThreads(
          searches, surfels, [&](std::size_t) { return needs; },
          [&](std::size_t i, const SurfaceAt& surface) { found[i] = foundAt(batch[i], surface); },
          progress_));
      for (const FoundRow& row : found) {
        SURFEIT_RETURN_IF_ERROR(found_rows_->add(row));
      }
      progress_.advance(batch.size());
    }
    stats_.temporary_bytes += places_in_order_->temporaryBytes();
    places_in_order_.reset();
    return found_rows_->finish();
  }

  FoundRow foundAt(const OrderedPlace& at, const SurfaceAt& surface) const {
    const FoundNormal found = rule_->needsTrajectory() ? rule_->at(at.place, surface, at.sensor)
                                                       : rule_->at(at.place, surface);
    FoundRow row;
    row.row = at.row;
    row.normal = found.normal;
    if (rule_->needsSides() && found.normal != glm::vec3(0)) row.normal = surface.own_normal;
    row.confidence = surface.confidence;
    row.area = surface.area;
    row.is_thin = found.is_thin;
    row.is_two_sided = found.is_two_sided;
    return row;
  }

  Status createWriter() {
    const RowLayout& element = reader_->element();
    RowWriterOptions writing;
    std::vector<std::string> found = {"nx", "ny", "nz", "normal_confidence"};
    if (options_.with_sizes) found.push_back("area");
    if (options_.estimation.thin_is_two_sided) found.emplace_back("two_sided");
    for (const RowProperty& property : element.properties) {
      if (std::find(found.begin(), found.end(), property.name) == found.end()) {
        writing.properties.push_back(property);
      } else {
        progress_.note(fmt::format("{}: {} is replaced by what is found", input_, property.name));
      }
    }
    const std::vector<RowProperty> kept = writing.properties;
    for (const std::string& name : found) {
      writing.properties.push_back(floatProperty(name.c_str()));
      if (name == "two_sided") writing.properties.back().type = ValueType::kUint8;
    }
    writing.comments = reader_->comments();
    writing.count = element.count;
    writing.like = reader_.get();
    writing.progress = &progress_;
    SURFEIT_ASSIGN_OR_RETURN(writer_, createRowWriter(output_, writing));
    noteOfWriter();
    for (const RowProperty& property : kept) {
      copies_.push_back({property.offset, writer_->element().find(property.name)->offset,
                         valueTypeBytes(property.type)});
    }
    return {};
  }

  Status writeRows() {
    SURFEIT_RETURN_IF_ERROR(reader_->rewind());
    progress_.beginPhase("write", reader_->element().count, "points");
    const std::size_t from_bytes = reader_->element().row_bytes;
    const std::size_t to_bytes = writer_->element().row_bytes;
    std::vector<std::byte> packed;
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, readRows());
      if (rows.empty()) break;
      const std::size_t count = rows.size() / from_bytes;
      packed.resize(count * to_bytes);
      for (std::size_t i = 0; i < count; ++i) {
        SURFEIT_ASSIGN_OR_RETURN(const FoundRow found, takeFound());
        pack(rows.data() + i * from_bytes, found, packed.data() + i * to_bytes);
      }
      SURFEIT_RETURN_IF_ERROR(writer_->writeRows(packed));
      progress_.advance(count);
    }
    stats_.temporary_bytes += found_rows_->temporaryBytes();
    if (found_rows_->current() == nullptr) return {};
    return Status::failed(fmt::format("{}: fewer points when read again", input_));
  }

  // Of the next row.
  Result<FoundRow> takeFound() {
    FoundRow found;
    const std::uint64_t row = stats_.points++;
    const std::byte* const current = found_rows_->current();
    if (current != nullptr) std::memcpy(&found, current, sizeof found);
    if (current == nullptr || found.row != row) return kNoPlace;
    SURFEIT_RETURN_IF_ERROR(found_rows_->advance());
    return found;
  }

  void pack(const std::byte* row, const FoundRow& found, std::byte* to) {
    for (const Copy& copy : copies_) std::memcpy(to + copy.to, row + copy.from, copy.bytes);
    if (found.is_thin != 0) {
      ++stats_.without;
    } else {
      stats_.mean_confidence += double(found.confidence);
    }
    const float values[] = {found.normal.x, found.normal.y, found.normal.z, found.confidence,
                            found.area};
    const std::size_t count = options_.with_sizes ? 5 : 4;
    std::byte* const at = to + writer_->element().find("nx")->offset;
    std::memcpy(at, values, count * sizeof(float));
    if (options_.estimation.thin_is_two_sided) {
      at[count * sizeof(float)] = std::byte(found.is_two_sided);
    }
  }

  void noteOfWriter() {
    for (const std::string& note : writer_->notes()) {
      if (std::find(told_.begin(), told_.end(), note) != told_.end()) continue;
      progress_.note(fmt::format("{}: {}", output_, note));
      told_.push_back(note);
    }
  }

  void tell() {
    if (stats_.outside_trajectory > 0) {
      progress_.note(fmt::format(
          "{}: {} points were seen before or after the trajectory: its nearest end stands for the "
          "sensor",
          input_, stats_.outside_trajectory));
    }
    const std::uint64_t with = stats_.points - stats_.without;
    if (with > 0) stats_.mean_confidence /= double(with);
    if (stats_.without == 0) return;
    progress_.inform(fmt::format(
        "{}: {} of {} points lie on no surface: they {}", output_, stats_.without, stats_.points,
        options_.estimation.thin_is_two_sided ? "are seen from both sides"
                                              : "get no normal and are spheres"));
  }

  struct Copy {
    std::size_t from, to, bytes;
  };

  const std::string& input_;
  const std::string& output_;
  const NormalsOptions& options_;
  Progress& progress_;
  int threads_ = 1;
  IndexOptions indexing_;  // of the places
  std::unique_ptr<RowReader> reader_;
  PlaceReader places_;
  RowProperty time_;  // with a trajectory
  std::optional<Trajectory> trajectory_;
  std::optional<NormalRule> rule_;
  std::uint64_t sorter_bytes_ = 0;  // of each
  std::unique_ptr<PagedOctree> octree_;
  std::optional<ExternalSorter> places_in_order_, found_rows_;
  std::unique_ptr<RowWriter> writer_;
  std::vector<Copy> copies_;
  std::vector<std::string> told_;
  AlignedBuffer buffer_;
  NormalsStats stats_;
};

}  // namespace

Result<NormalsStats> estimateNormals(const std::string& input, const std::string& output,
                                     const NormalsOptions& options, Progress& progress) {
  return guarded(output, [&]() -> Result<NormalsStats> {
    SURFEIT_RETURN_IF_ERROR(NormalRule::check(options.estimation));
    const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
    Result<NormalsStats> result = Status::failed("normals: not run");
    withThreads(threads,
                [&] { result = NormalsJob(input, output, options, threads, progress).run(); });
    return result;
  });
}

}  // namespace surfeit
