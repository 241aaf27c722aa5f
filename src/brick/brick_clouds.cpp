// brickClouds: points are read and sorted along a Morton curve of the finest voxels, swept into the
// voxels of all levels, and these are sorted into the order of the file.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <optional>

#include "brick/brick_input.h"
#include "brick/brick_layout.h"
#include "brick/brick_sweep.h"
#include "brick/brick_writer.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/split_mix.h"
#include "storage/external_sorter.h"
#include "storage/held_bytes.h"
#include "storage/output_target.h"
#include "storage/scratch_folder.h"
#include "surfeit/brick.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kLeastMemory = std::uint64_t{64} << 20;
constexpr std::uint64_t kUsualMemory = std::uint64_t{1} << 30;
// Readers, the writer, cells of the sweep, and the occupancy of clouds without sizes.
constexpr std::uint64_t kFixedMemory = std::uint64_t{32} << 20;
// Edge of the finest voxels over the spacing of the points: 4 points of a surface in each.
constexpr double kVoxelsPerSpacing = 2;
// Of a sample: blocks of 2^4 voxels along each axis, and about so many points.
constexpr int kSampledLevel = 4;
constexpr std::uint64_t kSampledPoints = 1 << 18;

// Where voxels lie: level l has edges of voxel_size * 2^l, and voxel (0, 0, 0) begins at the
// origin, so that maps of parts of a scene fit each other.
struct Lattice {
  double voxel_size = 1;
  std::array<std::int64_t, 3> base = {};  // the voxel of level 0 of Morton cell (0, 0, 0)
  int top_level = 0;

  // As the one place where positions become voxels.
  std::int64_t voxel(double position) const {
    return static_cast<std::int64_t>(std::floor(position / voxel_size));
  }
};

Result<Lattice> makeLattice(const BrickExtent& extent, double voxel_size) {
  Lattice lattice;
  lattice.voxel_size = voxel_size;
  const auto refuse = [&](std::int64_t most) {
    return Status::invalidArgument(fmt::format(
        "voxels of {:.6g}: points lie from ({:.6g} {:.6g} {:.6g}) to ({:.6g} {:.6g} {:.6g}), "
        "expected no more than {} voxels along an axis: give larger ones (--voxel-size)",
        voxel_size, extent.least.x, extent.least.y, extent.least.z, extent.greatest.x,
        extent.greatest.y, extent.greatest.z, most));
  };
  std::array<std::int64_t, 3> least, greatest;
  std::int64_t longest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::size_t>(axis);
    for (const double value : {extent.least[axis], extent.greatest[axis]}) {
      if (std::abs(value / voxel_size) >= static_cast<double>(kLargestBrickCoordinate)) {
        return refuse(kLargestBrickCoordinate);
      }
    }
    least[at] = lattice.voxel(extent.least[axis]);
    greatest[at] = lattice.voxel(extent.greatest[axis]);
    longest = std::max(longest, greatest[at] - least[at] + 1);
  }
  if (longest > kMostBrickVoxels) return refuse(kMostBrickVoxels);
  const auto span = [&](std::size_t axis, int level) {
    return (greatest[axis] >> level) - (least[axis] >> level) + 1;
  };
  while (std::max({span(0, lattice.top_level), span(1, lattice.top_level),
                   span(2, lattice.top_level)}) > kCoarsestVoxels) {
    ++lattice.top_level;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    lattice.base[axis] = least[axis] >> lattice.top_level << lattice.top_level;
  }
  return lattice;
}

class BrickBuild {
 public:
  BrickBuild(const std::vector<std::string>& inputs, const std::string& output,
             const BrickOptions& options, Progress& progress)
      : inputs_(inputs), output_(output), options_(options), progress_(progress) {}

  Result<BrickStats> run() {
    SURFEIT_RETURN_IF_ERROR(open());
    SURFEIT_RETURN_IF_ERROR(phase("scan", [&] { return scan(); }));
    SURFEIT_RETURN_IF_ERROR(phase("sort", [&] { return sortPoints(); }));
    SURFEIT_RETURN_IF_ERROR(phase("sweep", [&] { return sweep(); }));
    SURFEIT_RETURN_IF_ERROR(phase("write", [&] { return write(); }));
    return std::move(stats_);
  }

  // Of the points, those in some blocks of voxels: about `most`.
  void takeSample(std::uint64_t most) { most_points_ = most; }
  std::uint64_t takenPoints() const { return taken_points_; }
  std::uint64_t validPoints() const { return extent_.points; }
  // Of the file, however few points there are: masks of the two upper nodes of every grid.
  std::uint64_t bytesOfGrids() const {
    constexpr std::uint64_t kMasks = 2 * (32 * 32 * 32 + 16 * 16 * 16) / 8;
    std::uint64_t groups = 0;
    for (const BrickGroup& group : groups_) groups += group.voxels > 0 ? 1 : 0;
    return groups * (channels_.size() + 1) * kMasks;
  }

 private:
  template <typename Work>
  Status phase(const char* name, Work work) {
    const auto start = std::chrono::steady_clock::now();
    const Status status = work();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    stats_.phase_seconds.emplace_back(name, seconds.count());
    return status;
  }

  Status open();
  Status scan();
  Status chooseVoxelSize(const AreaMedian& areas);
  void noteChannels() const;
  Status forEach(const char* phase_name,
                 const std::function<Status(const BrickInputPoint&)>& visit);
  Status sortPoints();
  bool isTaken(std::uint64_t morton) const;
  int levelOf(double area) const;
  Status sweep();
  Status write();
  ExternalSorter::Options sorterOptions(std::size_t record_bytes) const;

  const std::vector<std::string>& inputs_;
  const std::string& output_;
  const BrickOptions& options_;
  Progress& progress_;
  BrickStats stats_;
  RowReaderOptions reading_;
  std::vector<BrickChannel> channels_;
  std::size_t value_count_ = 0;
  bool has_sizes_ = true;
  BrickExtent extent_;
  Lattice lattice_;
  std::optional<ExternalSorter> points_, voxels_;
  std::vector<BrickGroup> groups_;
  std::uint64_t most_points_ = 0;  // 0: all
  std::uint64_t taken_points_ = 0;
};

// Opens every input to see that it holds what is wanted.
Status BrickBuild::open() {
  reading_.filter = options_.filter;
  reading_.selections = std::make_shared<RowSelections>();
  reading_.color_range = options_.color_range;
  std::string without_sizes;
  for (const std::string& path : inputs_) {
    if (channels_.empty()) {
      SURFEIT_ASSIGN_OR_RETURN(const BrickInput first, BrickInput::open(path, {}, reading_));
      SURFEIT_ASSIGN_OR_RETURN(
          channels_, chooseBrickChannels(first.reader().element(), options_.channels, path));
    }
    SURFEIT_ASSIGN_OR_RETURN(const BrickInput input, BrickInput::open(path, channels_, reading_));
    stats_.points += input.reader().element().count;
    for (const std::string& note : input.reader().notes()) {
      progress_.note(fmt::format("{}: {}", path, note));
    }
    if (!input.hasSizes() && without_sizes.empty()) without_sizes = path;
    if (!input.hasNormals()) {
      progress_.note(
          fmt::format("{}: no normals: its values count for surfaces of all directions", path));
    }
  }
  has_sizes_ = without_sizes.empty();
  if (!has_sizes_) {
    progress_.note(fmt::format("{}: no area or radius: all points count the same", without_sizes));
  }
  for (const BrickChannel& channel : channels_) {
    value_count_ += channel.properties.size();
    stats_.channels.push_back(channel.name);
  }
  return {};
}

Status BrickBuild::forEach(const char* phase_name,
                           const std::function<Status(const BrickInputPoint&)>& visit) {
  progress_.beginPhase(phase_name, stats_.points, "points");
  const bool is_first = extent_.points == 0;
  for (const std::string& path : inputs_) {
    SURFEIT_ASSIGN_OR_RETURN(BrickInput input, BrickInput::open(path, channels_, reading_));
    SURFEIT_RETURN_IF_ERROR(input.forEach(options_.strict, progress_,
                                          is_first ? &stats_.skipped_points : nullptr, visit));
  }
  return {};
}

Status BrickBuild::scan() {
  AreaMedian areas;
  BrickExtent extent;
  SURFEIT_RETURN_IF_ERROR(forEach("scan", [&](const BrickInputPoint& point) {
    extent.add(point);
    if (has_sizes_) areas.add(point.area);
    return Status();
  }));
  extent_ = extent;
  if (extent_.points == 0) {
    return Status::corruption(
        fmt::format("{}: no valid point in {} records", inputs_.front(), stats_.points));
  }
  noteChannels();
  SURFEIT_RETURN_IF_ERROR(chooseVoxelSize(areas));
  SURFEIT_ASSIGN_OR_RETURN(lattice_, makeLattice(extent_, stats_.voxel_size));
  return {};
}

// A tolerance that the values of a channel hardly reach makes one value of them.
void BrickBuild::noteChannels() const {
  std::size_t at = 0;
  for (const BrickChannel& channel : channels_) {
    float low = extent_.low[at], high = extent_.high[at];
    for (std::size_t i = 0; i < channel.properties.size(); ++i, ++at) {
      low = std::min(low, extent_.low[at]);
      high = std::max(high, extent_.high[at]);
    }
    const double range = static_cast<double>(high) - static_cast<double>(low);
    if (range > 0 && options_.max_error > range / 10) {
      progress_.note(
          fmt::format("{}: values from {:.4g} to {:.4g}: a max error of {:.4g} keeps little of "
                      "them (--max-error)",
                      channel.name, low, high, options_.max_error));
    }
  }
}

Status BrickBuild::chooseVoxelSize(const AreaMedian& areas) {
  if (options_.voxel_size > 0) {
    stats_.voxel_size = options_.voxel_size;
    return {};
  }
  double area = 0;
  if (has_sizes_) {
    area = areas.median();
  } else {
    OccupancyArea occupancy(extent_);
    SURFEIT_RETURN_IF_ERROR(forEach("density", [&](const BrickInputPoint& point) {
      occupancy.add(point.position);
      return Status();
    }));
    area = occupancy.area();
    progress_.note(fmt::format("voxels of {:.4g}, by the density of the points (--voxel-size)",
                               kVoxelsPerSpacing * std::sqrt(area)));
  }
  stats_.voxel_size = kVoxelsPerSpacing * std::sqrt(area);
  return {};
}

ExternalSorter::Options BrickBuild::sorterOptions(std::size_t record_bytes) const {
  return {.record_bytes = record_bytes,
          .memory_bytes = (options_.memory_bytes - kFixedMemory) / 2,
          .temporary_directory = temporaryDirectory(options_.temporary_directory, output_)};
}

// The finest level whose voxels are as large as a point of that area: the points between those of a
// sparse part are holes, not surface without values.
int BrickBuild::levelOf(double area) const {
  const double level = std::ceil(std::log2(std::sqrt(area) / lattice_.voxel_size) - 1e-9);
  return static_cast<int>(std::clamp(level, 0.0, static_cast<double>(lattice_.top_level)));
}

// Blocks that are voxels of a coarser level, and whole leaves of the file: what is in one of them
// is as it is among all others.
bool BrickBuild::isTaken(std::uint64_t morton) const {
  if (most_points_ == 0 || most_points_ >= extent_.points) return true;
  const double part = double(most_points_) / double(extent_.points);
  return double(splitMix(morton >> (3 * kSampledLevel))) < 0x1p64 * part;
}

// Records of points: [Morton cell : 64 | level : 32, area : 32 | normal : 96 | values : 32 each].
Status BrickBuild::sortPoints() {
  const std::size_t bytes = kRecordKeyBytes + 4 * (3 + value_count_);
  points_.emplace(sorterOptions(bytes));
  std::vector<std::byte> record(bytes);
  SURFEIT_RETURN_IF_ERROR(forEach("sort", [&](const BrickInputPoint& point) {
    std::array<std::uint32_t, 3> cell;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::size_t>(axis);
      const std::int64_t place = lattice_.voxel(point.position[axis]) - lattice_.base[at];
      if (place < 0 || place >= std::int64_t{1} << kBrickMortonBits) {
        return Status::corruption(
            fmt::format("{}: has changed while it was read", inputs_.front()));
      }
      cell[at] = static_cast<std::uint32_t>(place);
    }
    const std::uint64_t morton = brickMorton(cell);
    if (!isTaken(morton)) return Status();
    ++taken_points_;
    const std::uint64_t level = has_sizes_ ? static_cast<std::uint64_t>(levelOf(point.area)) : 0;
    const float area = has_sizes_ ? static_cast<float>(point.area) : 1;
    const std::uint64_t second = level << 32 | std::bit_cast<std::uint32_t>(area);
    std::memcpy(&record[0], &morton, 8);
    std::memcpy(&record[8], &second, 8);
    std::memcpy(&record[16], &point.normal, 12);
    std::memcpy(&record[28], point.values.data(), 4 * value_count_);
    return points_->add(record.data());
  }));
  return points_->finish();
}

Status BrickBuild::sweep() {
  progress_.beginPhase("sweep", points_->count(), "points");
  groups_.resize(static_cast<std::size_t>((lattice_.top_level + 1) * kBrickDirections));
  voxels_.emplace(sorterOptions(brickRecordBytes(value_count_)));
  std::vector<std::byte> out(brickRecordBytes(value_count_));
  BrickSweep sweep(
      value_count_, lattice_.top_level, options_.max_error, [&](const BrickVoxel& voxel) {
        VdbCoord at;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          at[axis] =
              static_cast<std::int32_t>((lattice_.base[axis] >> voxel.level) + voxel.cell[axis]);
        }
        const int group = voxel.level * kBrickDirections + voxel.direction;
        groups_[static_cast<std::size_t>(group)].add(at);
        const BrickKey key = brickKey(group, at);
        std::memcpy(&out[0], &key.first, 8);
        std::memcpy(&out[8], &key.second, 8);
        std::memcpy(&out[16], &voxel.weight, 4);
        std::memcpy(&out[20], voxel.values.data(), 4 * value_count_);
        return voxels_->add(out.data());
      });
  std::vector<float> values(value_count_);
  for (std::uint64_t done = 0; points_->current() != nullptr; ++done) {
    if (done % 65536 == 0) {
      if (progress_.isCancelled()) return Status::interrupted();
      progress_.advance(done > 0 ? 65536 : 0);
    }
    const std::byte* record = points_->current();
    std::uint64_t morton = 0, second = 0;
    BrickPoint point;
    std::memcpy(&morton, record, 8);
    std::memcpy(&second, record + 8, 8);
    std::memcpy(&point.normal, record + 16, 12);
    std::memcpy(values.data(), record + 28, 4 * value_count_);
    point.level = static_cast<int>(second >> 32);
    point.weight = std::bit_cast<float>(static_cast<std::uint32_t>(second));
    SURFEIT_RETURN_IF_ERROR(sweep.add(morton, point, values));
    SURFEIT_RETURN_IF_ERROR(points_->advance());
  }
  SURFEIT_RETURN_IF_ERROR(sweep.finish());
  stats_.temporary_bytes += points_->temporaryBytes();
  points_.reset();
  return voxels_->finish();
}

Status BrickBuild::write() {
  progress_.beginPhase("write", voxels_->count() * (channels_.size() + 1), "voxels");
  stats_.temporary_bytes += voxels_->temporaryBytes();
  stats_.level_voxels.resize(static_cast<std::size_t>(lattice_.top_level) + 1);
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    stats_.level_voxels[group / kBrickDirections] += groups_[group].voxels;
  }
  BrickWriter writer(*voxels_, groups_, channels_, lattice_.voxel_size);
  return writer.write(output_, options_.max_error, progress_, stats_.file_bytes);
}

Status checkOptions(const std::vector<std::string>& inputs, const BrickOptions& options) {
  if (inputs.empty()) return Status::invalidArgument("no clouds to make a brick map of");
  if (!(options.max_error >= 0) || !std::isfinite(options.max_error)) {
    return Status::invalidArgument(
        fmt::format("max error {}: expected 0 or more", options.max_error));
  }
  if (!(options.voxel_size >= 0) || !std::isfinite(options.voxel_size)) {
    return Status::invalidArgument(
        fmt::format("voxel size {}: expected more than 0", options.voxel_size));
  }
  if (options.memory_bytes < kLeastMemory) {
    return Status::budgetTooSmall(
        fmt::format("a memory budget of {} MiB is too small: {} MiB is the "
                    "least that works",
                    options.memory_bytes >> 20, kLeastMemory >> 20));
  }
  return {};
}

}  // namespace

Result<BrickStats> brickClouds(const std::vector<std::string>& inputs, const std::string& output,
                               const BrickOptions& given, Progress& progress) {
  return guarded(output, [&]() -> Result<BrickStats> {
    BrickOptions options = given;
    if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kUsualMemory);
    SURFEIT_RETURN_IF_ERROR(checkOptions(inputs, options));
    const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
    std::optional<Result<BrickStats>> result;
    withThreads(threads, [&] { result = BrickBuild(inputs, output, options, progress).run(); });
    if (result->ok()) {
      (*result)->threads = threads;
      (*result)->memory_bytes = options.memory_bytes;
    }
    return std::move(*result);
  });
}

namespace {

double secondsOf(const BrickStats& stats, const std::string& phase) {
  for (const auto& [name, seconds] : stats.phase_seconds) {
    if (name == phase) return seconds;
  }
  return 0;
}

Result<SampleForecast> forecast(const std::vector<std::string>& inputs, const std::string& output,
                                const BrickOptions& options, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder, ScratchFolder::create(temporaryDirectory(
                                                           options.temporary_directory, output)));
  const std::string sample = folder.file("sample.vdb");
  SilentProgress silent(progress);
  SampleForecast forecast;
  BrickStats stats;
  double times = 1;
  std::uint64_t fixed = 0;
  // A few blocks that hold all may all have been left out
  for (const std::uint64_t most : {kSampledPoints, std::uint64_t{0}}) {
    const HeldBytesLog held;
    BrickBuild build(inputs, sample, options, silent);
    build.takeSample(most);
    SURFEIT_ASSIGN_OR_RETURN(stats, build.run());
    forecast.sampled_records = build.takenPoints();
    if (forecast.sampled_records == 0) continue;
    times = double(build.validPoints()) / double(forecast.sampled_records);
    forecast.temporary_bytes = held.spilledOf(times);
    fixed = std::min(build.bytesOfGrids(), stats.file_bytes);
    break;
  }
  forecast.records = stats.points;
  for (const std::string& input : inputs) forecast.input_bytes += fileBytesOf(input);
  forecast.memory_bytes = options.memory_bytes;
  forecast.output_bytes = fixed + std::uint64_t(double(stats.file_bytes - fixed) * times);
  // All is read to sort it as it is to scan it
  const double reading = secondsOf(stats, "scan");
  forecast.seconds = 2 * reading + times * (std::max(0., secondsOf(stats, "sort") - reading) +
                                            secondsOf(stats, "sweep") + secondsOf(stats, "write"));
  return forecast;
}

}  // namespace

Result<SampleForecast> forecastBrick(const std::vector<std::string>& inputs,
                                     const std::string& output, const BrickOptions& given,
                                     Progress& progress) {
  return guarded(output, [&]() -> Result<SampleForecast> {
    BrickOptions options = given;
    if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kUsualMemory);
    SURFEIT_RETURN_IF_ERROR(checkOptions(inputs, options));
    const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
    Result<SampleForecast> result = Status::failed("brick: no forecast");
    withThreads(threads, [&] { result = forecast(inputs, output, options, progress); });
    return result;
  });
}

}  // namespace surfeit
