#include "lookup/baked_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/curve_key.h"
#include "storage/external_sorter.h"

namespace surfeit {
namespace {

constexpr std::size_t kPlaceBytes = sizeof(glm::dvec3) + sizeof(glm::vec3);
// What an entry of the cache costs beside its page.
constexpr std::size_t kEntryBytes = 160;

// The area of a piece of surface in a box, about: of its two longest sides.
double surfaceIn(const Bounds3d& box) {
  std::array<double, 3> sides = {box.extent().x, box.extent().y, box.extent().z};
  std::sort(sides.begin(), sides.end());
  return sides[1] * sides[2];
}

}  // namespace

// A record of the sorter is two keys, and a point as the file has it: position, normal, values.
std::size_t BakedPoints::recordBytes() const { return kPlaceBytes + value_count_ * sizeof(float); }

std::size_t BakedPoints::pageBytes() const {
  return BakedPage::kPoints * recordBytes() +
         BakedPage::kPoints / BakedPage::kRunPoints * sizeof(Bounds3d) + sizeof(BakedPage) +
         kEntryBytes;
}

Result<std::unique_ptr<BakedPoints>> BakedPoints::open(const Options& options, Progress& progress) {
  std::unique_ptr<BakedPoints> points(new BakedPoints);
  SURFEIT_ASSIGN_OR_RETURN(const BrickExtent extent, points->measure(options, progress));

  // Boxes, and pages that threads hold, come first
  const std::uint64_t pages = (points->point_count_ + BakedPage::kPoints - 1) / BakedPage::kPoints;
  const std::uint64_t boxes = pages * sizeof(Bounds3d) * kFanOut / (kFanOut - 1) + sizeof(Bounds3d);
  const std::uint64_t held = std::uint64_t(options.threads) * kHeldPages * points->pageBytes();
  const std::uint64_t least = boxes + 2 * held;
  if (options.hold_bytes < least) {
    return Status::budgetTooSmall(fmt::format(
        "a memory budget of {:.1f} MiB is too small to look up {} points with {} threads: {} MiB "
        "is the least that works",
        double(2 * options.hold_bytes + options.beside_bytes) / (1 << 20), points->point_count_,
        options.threads, ((2 * least + options.beside_bytes) >> 20) + 1));
  }
  points->most_pages_ =
      static_cast<std::size_t>((options.hold_bytes - boxes - held) / points->pageBytes());
  SURFEIT_RETURN_IF_ERROR(points->sortInto(options, extent, progress));
  points->raiseTree();
  return points;
}

// Channels and bounds.
Result<BrickExtent> BakedPoints::measure(const Options& options, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const BrickInput first,
                           BrickInput::open(options.path, {}, options.reading));
  SURFEIT_ASSIGN_OR_RETURN(
      channels_, chooseBrickChannels(first.reader().element(), options.values, options.path));
  for (const BrickChannel& channel : channels_) value_count_ += channel.properties.size();
  for (const std::string& note : first.reader().notes()) {
    progress.note(fmt::format("{}: {}", options.path, note));
  }
  SURFEIT_ASSIGN_OR_RETURN(BrickInput input,
                           BrickInput::open(options.path, channels_, options.reading));
  has_normals_ = input.hasNormals();
  progress.beginPhase("scan", input.reader().element().count, "points");
  BrickExtent extent;
  SURFEIT_RETURN_IF_ERROR(
      input.forEach(options.strict, progress, &skipped_, [&](const BrickInputPoint& point) {
        extent.add(point);
        return Status();
      }));
  point_count_ = extent.points;
  if (point_count_ > 0) return extent;
  return Status::corruption(fmt::format("{}: no valid point in {} records", options.path,
                                        input.reader().element().count));
}

Status BakedPoints::sortInto(const Options& options, const BrickExtent& extent,
                             Progress& progress) {
  const std::size_t record_bytes = kRecordKeyBytes + recordBytes();
  ExternalSorter sorter({.record_bytes = record_bytes,
                         .count = point_count_,
                         .memory_bytes = options.sort_bytes,
                         .temporary_directory = options.temporary_directory});
  SURFEIT_ASSIGN_OR_RETURN(BrickInput input,
                           BrickInput::open(options.path, channels_, options.reading));
  progress.beginPhase("sort", input.reader().element().count, "points");
  // Points with one key are in the order of their bytes, so that the order of the cloud does not
  // show
  const glm::dvec3 middle = extent.least + 0.5 * (extent.greatest - extent.least);
  const RootCube cube = rootCube(Bounds3d{extent.least - middle, extent.greatest - middle});
  std::vector<std::byte> record(record_bytes);
  SURFEIT_RETURN_IF_ERROR(
      input.forEach(options.strict, progress, nullptr, [&](const BrickInputPoint& point) {
        const std::uint64_t keys[2] = {curveKey(glm::vec3(point.position - middle), cube), 0};
        std::byte* to = record.data();
        std::memcpy(to, keys, sizeof keys);
        std::memcpy(to + 16, &point.position, sizeof point.position);
        std::memcpy(to + 16 + sizeof point.position, &point.normal, sizeof point.normal);
        std::memcpy(to + 16 + kPlaceBytes, point.values.data(), point.values.size_bytes());
        return sorter.add(record.data());
      }));
  SURFEIT_RETURN_IF_ERROR(sorter.finish());
  if (sorter.count() != point_count_) {
    return Status::failed(options.path + ": other points when read again: it changed meanwhile");
  }

  SURFEIT_ASSIGN_OR_RETURN(file_, TemporaryBytes::create(options.temporary_directory));
  boxes_.emplace_back();
  AreaMedian areas;
  std::vector<std::byte> page;
  while (sorter.current() != nullptr) {
    if (progress.isCancelled()) return Status::interrupted();
    page.clear();
    for (std::size_t i = 0; i < BakedPage::kPoints && sorter.current() != nullptr; ++i) {
      const std::byte* const point = sorter.current() + kRecordKeyBytes;
      page.insert(page.end(), point, point + recordBytes());
      SURFEIT_RETURN_IF_ERROR(sorter.advance());
    }
    SURFEIT_RETURN_IF_ERROR(addBoxes(page, areas));
    SURFEIT_RETURN_IF_ERROR(file_->append(page));
  }
  temporary_bytes_ = sorter.temporaryBytes() + file_->size();
  if (has_areas_) {
    spacing_ = std::sqrt(areas.median());
  } else {
    spacing_ = extent.size() / double(point_count_);  // on lines
  }
  return file_->flush();
}

Status BakedPoints::addBoxes(std::span<const std::byte> records, AreaMedian& areas) {
  Bounds3d box;
  for (std::size_t at = 0; at < records.size(); at += recordBytes()) {
    glm::dvec3 position;
    std::memcpy(&position, records.data() + at, sizeof position);
    box.add(position);
  }
  boxes_[0].push_back(box);
  const double area = surfaceIn(box) / double(records.size() / recordBytes());
  if (area > 0) areas.add(area);
  has_areas_ = has_areas_ || area > 0;
  return {};
}

void BakedPoints::raiseTree() {
  while (boxes_.back().size() > 1) {
    const std::vector<Bounds3d>& below = boxes_.back();
    std::vector<Bounds3d> level((below.size() + kFanOut - 1) / kFanOut);
    for (std::size_t i = 0; i < below.size(); ++i) level[i / kFanOut].add(below[i]);
    boxes_.push_back(std::move(level));
  }
}

Result<std::shared_ptr<const BakedPage>> BakedPoints::load(std::size_t number) {
  const std::uint64_t first = std::uint64_t{number} * BakedPage::kPoints;
  const auto count =
      static_cast<std::size_t>(std::min<std::uint64_t>(BakedPage::kPoints, point_count_ - first));
  std::vector<std::byte> records(count * recordBytes());
  {
    const std::lock_guard lock(file_mutex_);
    SURFEIT_RETURN_IF_ERROR(file_->readAt(first * recordBytes(), records));
  }
  auto page = std::make_shared<BakedPage>();
  page->positions.resize(count);
  page->normals.resize(count);
  page->values.resize(count * value_count_);
  page->runs.resize((count + BakedPage::kRunPoints - 1) / BakedPage::kRunPoints);
  for (std::size_t i = 0; i < count; ++i) {
    const std::byte* const from = records.data() + i * recordBytes();
    std::memcpy(&page->positions[i], from, sizeof(glm::dvec3));
    std::memcpy(&page->normals[i], from + sizeof(glm::dvec3), sizeof(glm::vec3));
    std::memcpy(&page->values[i * value_count_], from + kPlaceBytes, value_count_ * sizeof(float));
    page->runs[i / BakedPage::kRunPoints].add(page->positions[i]);
  }
  return std::shared_ptr<const BakedPage>(std::move(page));
}

// Two threads that miss one page both read it: rare, since they look up different places.
Result<std::shared_ptr<const BakedPage>> BakedPoints::page(std::size_t number) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = places_.find(number);
    if (found != places_.end()) {
      cache_.splice(cache_.begin(), cache_, found->second);
      return found->second->second;
    }
  }
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const BakedPage> page, load(number));
  const std::lock_guard lock(mutex_);
  ++loads_;
  if (places_.count(number) != 0) return page;
  cache_.emplace_front(number, page);
  places_[number] = cache_.begin();
  while (cache_.size() > most_pages_) {
    places_.erase(cache_.back().first);
    cache_.pop_back();
  }
  return page;
}

}  // namespace surfeit
