// Receivers are looked up in batches, as many rows as the memory holds: sorted along a curve, so
// that neighbours find the pages of the map that others have read; looked up by all threads; and
// written in their own order.
//
//   rows --decode--> places --sort--> look up (all threads) --> values + rows --> writer

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/edits/row_transform.h"
#include "cloud/edits/rows_with_values.h"
#include "cloud/rows/channels.h"
#include "core/curve_key.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/program_memory.h"
#include "index/rows/scene_rows.h"
#include "lookup/baked_map.h"
#include "lookup/lookup_receivers.h"
#include "storage/output_target.h"
#include "surfeit/lookup.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kUsualMemory = std::uint64_t{1} << 30;
// Readers, the writer, buffers of rows to write.
constexpr std::uint64_t kFixedMemory = std::uint64_t{12} << 20;
constexpr std::uint64_t kLeastRest = std::uint64_t{16} << 20;
constexpr std::size_t kMostBatch = std::size_t{1} << 20;
constexpr std::size_t kChunk = 256;   // receivers that a thread takes at once
constexpr std::size_t kSlice = 4096;  // rows that are written at once

// A receiver of a batch.
struct BatchPlace {
  LookupReceivers::Place place;
  CurveKey key = 0;
  std::uint32_t row = 0;
};

class CloudLookup {
 public:
  CloudLookup(const std::string& map_path, const std::string& receivers_path,
              const std::string& result_path, const LookupOptions& options, int threads,
              Progress& progress)
      : map_path_(map_path),
        receivers_path_(receivers_path),
        result_path_(result_path),
        options_(options),
        threads_(threads),
        progress_(progress) {
    stats_.threads = threads;
    stats_.memory_bytes = options.memory_bytes;
  }

  Result<LookupStats> run() {
    SURFEIT_RETURN_IF_ERROR(planMemory());
    SURFEIT_RETURN_IF_ERROR(openReceivers());
    const auto start = std::chrono::steady_clock::now();
    SURFEIT_ASSIGN_OR_RETURN(
        const BakedMap map,
        BakedMap::open(map_path_, options_,
                       {rest_ / 2, rest_ / 2, threads_, options_.memory_bytes - rest_,
                        temporaryDirectory(options_.temporary_directory, result_path_)},
                       progress_));
    finishPhase("open", start);
    const auto opened = std::chrono::steady_clock::now();
    const RowsWithValues rows(reader_->element(), map.names());
    SURFEIT_RETURN_IF_ERROR(createWriter(rows));
    SURFEIT_RETURN_IF_ERROR(createReturn(map.names()));
    noteReceivers();
    SURFEIT_RETURN_IF_ERROR(lookUpAll(map, rows));
    SURFEIT_RETURN_IF_ERROR(writer_->finish());
    noteOfWriter();
    noteMissing();
    finishPhase("look up", opened);
    map.describe(stats_);
    return std::move(stats_);
  }

 private:
  void finishPhase(const char* name, std::chrono::steady_clock::time_point start) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    stats_.phase_seconds.emplace_back(name, seconds.count());
  }

  // Half for the map, a quarter each for a batch and for a writer that holds what it writes.
  Status planMemory() {
    const std::uint64_t fixed = programBytes(threads_) + kFixedMemory;
    if (options_.memory_bytes < fixed + kLeastRest) {
      return Status::budgetTooSmall(fmt::format(
          "a memory budget of {} MiB is too small to look up: {} MiB is the least that works",
          options_.memory_bytes >> 20, ((fixed + kLeastRest) >> 20) + 1));
    }
    rest_ = options_.memory_bytes - fixed;
    return {};
  }

  Status openReceivers() {
    RowReaderOptions reading;
    SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(options_.channels));
    reading.part = options_.part;
    reading.filter = options_.filter;
    SURFEIT_ASSIGN_OR_RETURN(
        reading.color_range,
        colorRangeFor(std::span(&receivers_path_, 1), result_path_, options_.color_range));
    SURFEIT_ASSIGN_OR_RETURN(reader_, openCloud(receivers_path_, reading));
    SURFEIT_ASSIGN_OR_RETURN(
        receivers_, LookupReceivers::create(reader_->element(), receivers_path_, options_));
    stats_.receivers = reader_->element().count;
    return {};
  }

  Status createWriter(const RowsWithValues& rows) {
    RowWriterOptions writing;
    writing.properties = rows.properties();
    writing.comments = reader_->comments();
    writing.count = stats_.receivers;
    writing.like = reader_.get();
    writing.progress = &progress_;
    writing.memory_bytes = rest_ / 4;
    writing.memory_parts = 4;
    writing.memory_beside_bytes = options_.memory_bytes - rest_;
    SURFEIT_ASSIGN_OR_RETURN(writer_, createRowWriter(result_path_, writing));
    noteOfWriter();
    return {};
  }

  // The way of values from the map's space to that of the receivers.
  Status createReturn(const std::vector<std::string>& names) {
    SURFEIT_ASSIGN_OR_RETURN(back_, RowTransform::create(receivers_->toMap().inverse().matrix()));
    if (back_->isIdentity()) return {};
    RowLayout values;
    for (const std::string& name : names) {
      values.properties.emplace_back();
      values.properties.back().name = name;
    }
    packRow(values);
    back_->bind(values);
    for (const std::string& note : back_->notes()) {
      progress_.note(fmt::format("{}: {}", result_path_, note));
    }
    return {};
  }

  Status lookUpAll(const BakedMap& map, const RowsWithValues& rows) {
    const RowLayout& element = reader_->element();
    const std::size_t value_bytes = map.names().size() * sizeof(float);
    const std::size_t per_row = element.row_bytes + value_bytes + sizeof(BatchPlace) + 1;
    const auto batch_rows = static_cast<std::size_t>(
        std::clamp<std::uint64_t>(rest_ / 4 / per_row, kSlice, kMostBatch));
    progress_.beginPhase("look up", element.count, "receivers");
    for (std::uint64_t record = 0;;) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const Bytes batch, reader_->readRows(batch_rows, buffer_));
      if (batch.empty()) return {};
      const std::size_t count = batch.size() / element.row_bytes;
      SURFEIT_RETURN_IF_ERROR(decodeBatch(batch, record, count));
      SURFEIT_RETURN_IF_ERROR(lookUpBatch(map, count));
      SURFEIT_RETURN_IF_ERROR(writeBatch(rows, batch, count));
      record += count;
    }
  }

  Status decodeBatch(Bytes batch, std::uint64_t first, std::size_t count) {
    const std::size_t row_bytes = reader_->element().row_bytes;
    places_.clear();
    Bounds3d bounds;
    for (std::size_t i = 0; i < count; ++i) {
      BatchPlace place;
      place.row = static_cast<std::uint32_t>(i);
      const std::byte* const row = batch.data() + i * row_bytes;
      if (receivers_->decode(row, first + i, place.place, defects_)) {
        bounds.add(place.place.position);
        places_.push_back(place);
      } else if (options_.strict) {
        return Status::corruption(fmt::format("{}: record {}: {}", receivers_path_, first + i,
                                              receivers_->describeDefect(row)));
      }
    }
    const glm::dvec3 middle = bounds.centre();
    const RootCube cube = rootCube(Bounds3d{bounds.min - middle, bounds.max - middle});
    for (BatchPlace& place : places_) {
      place.key = curveKey(glm::vec3(place.place.position - middle), cube);
    }
    parallelSort(places_.begin(), places_.end(), [](const BatchPlace& a, const BatchPlace& b) {
      return a.key != b.key ? a.key < b.key : a.row < b.row;
    });
    return {};
  }

  Status lookUpBatch(const BakedMap& map, std::size_t count) {
    const std::size_t size = map.names().size();
    values_.assign(count * size, options_.missing);
    is_found_.assign(count, 0);
    std::mutex mutex;
    Status failure;
    std::uint64_t found_count = 0;
    parallelFor((places_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      BakedMap::Reader reader(map);
      Status status;
      std::uint64_t found = 0;
      const std::size_t end = std::min((chunk + 1) * kChunk, places_.size());
      for (std::size_t i = chunk * kChunk; i < end && status.ok(); ++i) {
        if (i % kChunk == 0 && progress_.isCancelled()) status = Status::interrupted();
        if (!status.ok()) break;
        const BatchPlace& at = places_[i];
        const Result<bool> is_found = reader.find(at.place.position, at.place.normal,
                                                  std::span(values_).subspan(at.row * size, size));
        if (!is_found.ok()) status = is_found.status();
        is_found_[at.row] = is_found.ok() && *is_found;
        found += is_found_[at.row];
      }
      progress_.advance(end - chunk * kChunk);
      const std::lock_guard lock(mutex);
      found_count += found;
      if (failure.ok()) failure = std::move(status);
    });
    stats_.missing_receivers += places_.size() - found_count;
    return failure;
  }

  Status writeBatch(const RowsWithValues& rows, Bytes batch, std::size_t count) {
    const std::size_t row_bytes = reader_->element().row_bytes;
    const std::size_t size = values_.size() / count;
    if (!back_->isIdentity()) {
      for (std::size_t i = 0; i < count; ++i) {
        if (is_found_[i] != 0) {
          back_->apply(reinterpret_cast<std::byte*>(&values_[i * size]), 1);
        }
      }
    }
    output_.resize(kSlice * rows.rowBytes());
    for (std::size_t begin = 0; begin < count; begin += kSlice) {
      const std::size_t end = std::min(begin + kSlice, count);
      for (std::size_t i = begin; i < end; ++i) {
        rows.make(batch.data() + i * row_bytes, &values_[i * size],
                  output_.data() + (i - begin) * rows.rowBytes());
      }
      SURFEIT_RETURN_IF_ERROR(
          writer_->writeRows({output_.data(), (end - begin) * rows.rowBytes()}));
    }
    return {};
  }

  void noteReceivers() {
    for (const std::string& note : reader_->notes()) {
      progress_.note(fmt::format("{}: {}", receivers_path_, note));
    }
    if (receivers_->hasNormals()) return;
    progress_.note(fmt::format(
        "{}: {}: values of surfaces of all directions count", receivers_path_,
        options_.reference_positions.empty()
            ? "no normals"
            : "normals are not used, for they are not those of the reference positions (--nref)"));
  }

  void noteOfWriter() {
    for (const std::string& note : writer_->notes()) {
      if (told_.insert(note).second) progress_.note(fmt::format("{}: {}", result_path_, note));
    }
  }

  void noteMissing() {
    stats_.invalid_receivers = defects_.total();
    if (stats_.invalid_receivers > 0) {
      progress_.note(fmt::format("{}: no value ({}) at invalid receivers: {}", receivers_path_,
                                 options_.missing, defects_.describe()));
    }
    if (stats_.missing_receivers == 0) return;
    progress_.note(fmt::format(
        "{}: {} of {} receivers find no value nearby that faces their way: they get {} (--missing "
        "writes another number)",
        map_path_, stats_.missing_receivers, stats_.receivers, options_.missing));
  }

  const std::string &map_path_, &receivers_path_, &result_path_;
  const LookupOptions& options_;
  const int threads_;
  Progress& progress_;
  LookupStats stats_;
  std::uint64_t rest_ = 0;  // of the budget, for map, batches and writer
  std::unique_ptr<RowReader> reader_;
  std::optional<LookupReceivers> receivers_;
  std::unique_ptr<RowWriter> writer_;
  std::optional<RowTransform> back_;
  std::set<std::string> told_;
  SurfelDefects defects_;

  // Of a batch
  AlignedBuffer buffer_;
  std::vector<BatchPlace> places_;
  std::vector<float> values_;
  std::vector<std::uint8_t> is_found_;
  std::vector<std::byte> output_;
};

Status checkOptions(const LookupOptions& options) {
  SURFEIT_RETURN_IF_ERROR(checkSpace(options.from_space, "from-space"));
  SURFEIT_RETURN_IF_ERROR(checkSpace(options.to_space, "to-space"));
  if (!(options.max_distance >= 0) || !std::isfinite(options.max_distance)) {
    return Status::invalidArgument(
        fmt::format("max distance {}: expected 0 or more", options.max_distance));
  }
  if (!(options.filter_width >= 0) || !std::isfinite(options.filter_width)) {
    return Status::invalidArgument(
        fmt::format("filter width {}: expected 0 or more", options.filter_width));
  }
  if (!options.reference_normals.empty() && options.reference_positions.empty()) {
    return Status::invalidArgument("reference normals (--nref) need reference positions (--pref)");
  }
  return {};
}

}  // namespace

Result<LookupStats> lookupCloud(const std::string& map, const std::string& receivers,
                                const std::string& result, const LookupOptions& given,
                                Progress& progress) {
  return guarded(result, [&]() -> Result<LookupStats> {
    LookupOptions options = given;
    if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kUsualMemory);
    SURFEIT_RETURN_IF_ERROR(checkOptions(options));
    SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result, map, "map"));
    const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
    Result<LookupStats> stats = Status::failed("lookup: not run");
    withThreads(threads, [&] {
      stats = CloudLookup(map, receivers, result, options, threads, progress).run();
    });
    return stats;
  });
}

}  // namespace surfeit
