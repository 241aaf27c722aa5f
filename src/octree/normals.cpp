#include "surfeit/normals.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <new>
#include <vector>

#include "core/curve_key.h"
#include "core/job_limits.h"
#include "core/program_memory.h"
#include "core/seconds_since.h"
#include "io/cloud_formats.h"
#include "io/surfel_names.h"
#include "io/up_comment.h"
#include "octree/index_places.h"
#include "octree/index_plan.h"
#include "octree/scene_rows.h"
#include "octree/surface_search.h"

namespace surfeit {
namespace {

constexpr std::size_t kRowsPerThread = 8192;
// Besides its bytes in the input and the output, of a row: its place, twice, with what is found.
constexpr std::size_t kPlaceBytes =
    2 * sizeof(Surfel) + sizeof(SurfaceAt) + sizeof(std::pair<CurveKey, std::uint32_t>) + 1;
// Neighbours that lie farther off their plane than this, in spacings, lie all around; those of a
// surface with noise of half a spacing lie half a spacing off.
constexpr float kThinThickness = 0.75f;

PlyProperty floatProperty(const char* name) {
  PlyProperty property;
  property.name = name;
  return property;
}

// Where places of rows lie, counted from an origin as those of the octree.
struct PlaceReader {
  std::array<PlyProperty, 3> properties;
  glm::dvec3 origin{0};

  glm::vec3 place(const std::byte* row) const {
    glm::dvec3 position;
    for (int i = 0; i < 3; ++i) {
      const PlyProperty& property = properties[std::size_t(i)];
      position[i] = plyValue(row + property.offset, property.type);
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
             Progress& progress)
      : input_(input), output_(output), options_(options), progress_(progress) {
    stats_.memory_bytes =
        options.memory_bytes > 0 ? options.memory_bytes : defaultMemoryBytes(kUsualIndexMemory);
    threads_ = options.threads > 0 ? options.threads : defaultThreadCount();
  }

  Result<NormalsStats> run() {
    const auto start = std::chrono::steady_clock::now();
    SURFEIT_RETURN_IF_ERROR(openInput());
    SURFEIT_RETURN_IF_ERROR(indexInput());
    stats_.index_seconds = secondsSince(start);
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
    const PlyElement& element = reader_->element();
    for (std::size_t i = 0; i < 3; ++i) {
      const PlyProperty* const property = element.find(kPositionNames[i]);
      if (property == nullptr) {
        return Status::corruption(fmt::format("{}: no property {}", input_, kPositionNames[i]));
      }
      places_.properties[i] = *property;
    }
    up_ = options_.up.value_or(statedUpAxis(reader_->comments()).value_or(kDefaultUpAxis));
    return {};
  }

  Status indexInput() {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, indexPlaces(input_, output_, indexing_, progress_));
    stats_.temporary_bytes = scene.fileBytes();
    places_.origin = scene.header().origin;
    centre_ = scene.header().bounds.centre();

    const std::uint64_t beside =
        programBytes(threads_) + PagedOctree::fixedBytes(scene, threads_) +
        std::uint64_t(threads_) *
            (SurfaceSearch::memoryBytes() +
             kRowsPerThread * (2 * reader_->element().row_bytes + kPlaceBytes));
    const std::uint64_t caches =
        std::min<std::uint64_t>(stats_.memory_bytes - std::min(stats_.memory_bytes, beside),
                                PagedOctree::unlimitedCacheBytes(scene));
    SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                             PagedOctree::planMemory(scene, caches, threads_));
    SURFEIT_ASSIGN_OR_RETURN(octree_, PagedOctree::create(std::move(scene), memory));
    for (int i = 0; i < threads_; ++i) searches_.emplace_back(*octree_);
    return {};
  }

  Status createWriter() {
    const PlyElement& element = reader_->element();
    RowWriterOptions writing;
    std::vector<std::string> found = {"nx", "ny", "nz", "normal_confidence"};
    if (options_.with_sizes) found.insert(found.end(), {"radius", "area"});
    if (options_.thin_is_two_sided) found.emplace_back("two_sided");
    for (const PlyProperty& property : element.properties) {
      if (std::find(found.begin(), found.end(), property.name) == found.end()) {
        writing.properties.push_back(property);
      } else {
        progress_.note(fmt::format("{}: {} is replaced by what is found", input_, property.name));
      }
    }
    const std::vector<PlyProperty> kept = writing.properties;
    for (const std::string& name : found) {
      writing.properties.push_back(floatProperty(name.c_str()));
      if (name == "two_sided") writing.properties.back().type = PlyType::kUint8;
    }
    writing.comments = reader_->comments();
    writing.count = element.count;
    writing.like = reader_.get();
    writing.progress = &progress_;
    SURFEIT_ASSIGN_OR_RETURN(writer_, createRowWriter(output_, writing));
    noteOfWriter();
    for (const PlyProperty& property : kept) {
      copies_.push_back({property.offset, writer_->element().find(property.name)->offset,
                         plyTypeBytes(property.type)});
    }
    return {};
  }

  Status writeRows() {
    progress_.beginPhase("normals", reader_->element().count, "points");
    const std::size_t most = kRowsPerThread * std::size_t(threads_);
    const std::size_t row_bytes = reader_->element().row_bytes;
    for (;;) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader_->readRows(most, buffer_));
      if (rows.empty()) return {};
      const std::size_t count = rows.size() / row_bytes;
      SURFEIT_RETURN_IF_ERROR(findSurfaces(rows, count));
      const std::size_t to_bytes = writer_->element().row_bytes;
      packed_.resize(count * to_bytes);
      for (std::size_t i = 0; i < count; ++i) {
        pack(rows.data() + i * row_bytes, i, packed_.data() + i * to_bytes);
      }
      SURFEIT_RETURN_IF_ERROR(writer_->writeRows(packed_));
      stats_.points += count;
      progress_.advance(count);
    }
  }

  // Of the rows' places, into surfaces_, by all threads.
  Status findSurfaces(Bytes rows, std::size_t count) {
    const std::size_t row_bytes = reader_->element().row_bytes;
    surfels_.resize(count);
    surfaces_.assign(count, {});
    is_place_.assign(count, false);
    glm::vec3 last(centre_);
    for (std::size_t i = 0; i < count; ++i) {
      const glm::vec3 place = places_.place(rows.data() + i * row_bytes);
      is_place_[i] = isFinite(place);
      if (is_place_[i]) last = place;
      surfels_[i].position = last;  // what is no place must not widen the box of the others
      surfels_[i].flags = kSurfelSphere;
    }
    // Along the curve, so that those that follow each other are close in any order of the file
    order_.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
      order_.emplace_back(curveKey(surfels_[i].position, octree_->file().header().cube), i);
    }
    std::sort(order_.begin(), order_.end());
    sorted_.clear();
    for (const auto& [key, i] : order_) sorted_.push_back(surfels_[i]);
    return findOnThreads(
        searches_, sorted_, [&](std::size_t i) { return is_place_[order_[i].second] != 0; },
        [&](std::size_t i, const SurfaceAt& found) { surfaces_[order_[i].second] = found; });
  }

  glm::vec3 oriented(const glm::vec3& normal, const glm::vec3& place) const {
    float toward = 0;
    switch (options_.orientation.toward) {
      case NormalOrientation::Toward::kUp:
        toward = normal[int(up_)];
        break;
      case NormalOrientation::Toward::kSensor:
        toward = glm::dot(normal, glm::vec3(options_.orientation.sensor - places_.origin) - place);
        break;
      case NormalOrientation::Toward::kOutward:
        toward = glm::dot(normal, place - centre_);
        break;
    }
    return toward < 0 ? -normal : normal;
  }

  void pack(const std::byte* row, std::size_t i, std::byte* to) {
    for (const Copy& copy : copies_) std::memcpy(to + copy.to, row + copy.from, copy.bytes);
    const SurfaceAt& surface = surfaces_[i];
    const bool is_thin =
        !is_place_[i] || surface.normal == glm::vec3(0) || surface.thickness > kThinThickness;
    glm::vec3 normal = oriented(surface.normal, surfels_[i].position);
    if (is_thin) {
      ++stats_.without;
      if (!options_.thin_is_two_sided) normal = glm::vec3(0);
    } else {
      stats_.mean_confidence += double(surface.confidence);
    }
    const float radius = std::sqrt(IndexOptions().overlap) * surface.radius;
    const float values[] = {normal.x, normal.y, normal.z, surface.confidence, radius, surface.area};
    const std::size_t count = options_.with_sizes ? 6 : 4;
    std::byte* const found = to + writer_->element().find("nx")->offset;
    std::memcpy(found, values, count * sizeof(float));
    if (options_.thin_is_two_sided) found[count * sizeof(float)] = std::byte{is_thin};
  }

  void noteOfWriter() {
    for (const std::string& note : writer_->notes()) {
      if (std::find(told_.begin(), told_.end(), note) != told_.end()) continue;
      progress_.note(fmt::format("{}: {}", output_, note));
      told_.push_back(note);
    }
  }

  void tell() {
    const std::uint64_t with = stats_.points - stats_.without;
    if (with > 0) stats_.mean_confidence /= double(with);
    if (stats_.without == 0) return;
    progress_.inform(fmt::format(
        "{}: {} of {} points lie on no surface: they {}", output_, stats_.without, stats_.points,
        options_.thin_is_two_sided ? "are seen from both sides" : "get no normal and are spheres"));
  }

  struct Copy {
    std::size_t from, to, bytes;
  };

  const std::string& input_;
  const std::string& output_;
  const NormalsOptions& options_;
  Progress& progress_;
  int threads_ = 1;
  UpAxis up_ = kDefaultUpAxis;
  IndexOptions indexing_;  // of the places
  std::unique_ptr<RowReader> reader_;
  PlaceReader places_;
  glm::vec3 centre_{0};  // from the origin
  std::unique_ptr<PagedOctree> octree_;
  std::vector<SurfaceSearch> searches_;  // by thread
  std::unique_ptr<RowWriter> writer_;
  std::vector<Copy> copies_;
  std::vector<std::string> told_;
  AlignedBuffer buffer_;
  std::vector<Surfel> surfels_, sorted_;  // places of rows; the same along the curve
  std::vector<std::pair<CurveKey, std::uint32_t>> order_;
  std::vector<SurfaceAt> surfaces_;
  std::vector<char> is_place_;
  std::vector<std::byte> packed_;
  NormalsStats stats_;
};

Status checkOptions(const NormalsOptions& options) {
  const glm::dvec3& sensor = options.orientation.sensor;
  if (!std::isfinite(sensor.x + sensor.y + sensor.z)) {
    return Status::invalidArgument("sensor: a coordinate is not finite");
  }
  return {};
}

}  // namespace

Result<NormalsStats> estimateNormals(const std::string& input, const std::string& output,
                                     const NormalsOptions& options, Progress& progress) {
  try {
    SURFEIT_RETURN_IF_ERROR(checkOptions(options));
    return NormalsJob(input, output, options, progress).run();
  } catch (const std::bad_alloc&) {
    return Status::failed(
        fmt::format("{}: the system gave no more memory; try a smaller --memory", output));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", output, error.what()));
  }
}

}  // namespace surfeit
