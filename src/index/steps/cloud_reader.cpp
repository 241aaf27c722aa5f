#include "index/steps/cloud_reader.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <optional>

#include "core/first_failure.h"
#include "core/group_comment.h"
#include "core/parallel.h"
#include "core/thread_scratch.h"
#include "core/up_comment.h"
#include "index/notes/mixed_clouds.h"
#include "index/rows/row_fetcher.h"
#include "index/rows/scene_rows.h"
#include "octree/neighbours/given_areas.h"
#include "surfeit/group_names.h"

namespace surfeit {
namespace {

// Places that a sample is taken from; few records at each, because neighbours say the same.
constexpr std::uint64_t kLeastPlaces = 2048, kMostPlaces = 16384;
// The provenance of a scene has 64 KiB, and escapes take room.
constexpr std::size_t kMostCrsBytes = 16 << 10;

// What the decoding threads of one input share.
class InputPass {
 public:
  InputPass(const SurfelSource& source, const CloudReader::Consumer& consume,
            std::uint64_t sample_step, std::optional<std::uint8_t> group, Progress& progress)
      : source_(source),
        consume_(consume),
        sample_step_(sample_step),
        group_(group),
        progress_(progress) {}

  void decode(const RowFetcher::Rows& rows);

  // The first of the file, by record.
  FirstFailure& failure() { return failure_; }
  CloudTotals& totals() { return totals_; }
  const SurfelDefects& defects() const { return defects_; }

 private:
  Status decodePart(Bytes rows, std::uint64_t first_record, CloudTotals& totals,
                    SurfelDefects& defects);

  const SurfelSource& source_;
  const CloudReader::Consumer& consume_;
  const std::uint64_t sample_step_;
  const std::optional<std::uint8_t> group_;
  Progress& progress_;
  FirstFailure failure_;
  std::mutex mutex_;  // guards what is below
  CloudTotals totals_;
  SurfelDefects defects_;
};

Status InputPass::decodePart(Bytes rows, std::uint64_t first_record, CloudTotals& totals,
                             SurfelDefects& defects) {
  std::vector<Surfel>& surfels = threadScratch<std::vector<Surfel>>([] {});
  surfels.resize(kReadBatch);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                           source_.decodeRows(rows, first_record, surfels, defects));
  const std::span<Surfel> batch = std::span(surfels).first(count);
  if (group_) {
    for (Surfel& surfel : batch) surfel.group = *group_;
  }
  totals.add(batch);
  const std::uint64_t phase = first_record % sample_step_;
  for (std::size_t i = phase == 0 ? 0 : sample_step_ - phase; i < count; i += sample_step_) {
    totals.sample.push_back(batch[i]);
  }
  return consume_(batch, totals.bounds);
}

void InputPass::decode(const RowFetcher::Rows& rows) {
  const std::size_t row_bytes = source_.rowBytes();
  const std::size_t row_count = rows.bytes.size() / row_bytes;
  CloudTotals totals;
  SurfelDefects defects;
  // What comes before a failure goes on: it may hold the first one
  for (std::size_t begin = 0; begin < row_count && rows.first_record + begin < failure_.place();
       begin += kReadBatch) {
    const std::size_t count = std::min(kReadBatch, row_count - begin);
    const Bytes part = rows.bytes.subspan(begin * row_bytes, count * row_bytes);
    const std::uint64_t first_record = rows.first_record + begin;
    failure_.note(decodePart(part, first_record, totals, defects), first_record);
  }
  const std::lock_guard lock(mutex_);
  totals_.add(totals);
  defects_.add(defects);
  progress_.advance(row_count);
  progress_.advanceBytes(rows.bytes.size());
}

CloudChannels unionOf(const CloudChannels& a, const CloudChannels& b) {
  return {a.normal || b.normal,   a.radius || b.radius,
          a.area || b.area,       a.radiosity || b.radiosity,
          a.albedo || b.albedo,   a.two_sided || b.two_sided,
          a.group || b.group,     a.long_side || b.long_side,
          a.opacity || b.opacity, a.tint || b.tint};
}

}  // namespace

void CloudTotals::add(std::span<const Surfel> added) {
  for (const Surfel& surfel : added) {
    missing_both += surfel.radius <= 0 && surfel.area <= 0 ? 1 : 0;
    missing_area += surfel.radius > 0 && surfel.area == 0 ? 1 : 0;
    covering += surfel.radius > 0 && surfel.area < 0 ? 1 : 0;
    const bool finds_radius = findsRadius(surfel);
    missing_radius += finds_radius ? 1 : 0;
    radius_from_area += surfel.radius <= 0 && surfel.area > 0 && !finds_radius ? 1 : 0;
    spheres += surfel.isSphere() ? 1 : 0;
    const float albedo = std::max({surfel.albedo.x, surfel.albedo.y, surfel.albedo.z});
    bright += albedo > 1 ? 1 : 0;
    largest_albedo = std::max(largest_albedo, albedo);
    bounds.add(surfel.position);
    // The same as ever where nothing has a tint
    content += XXH3_64bits(&surfel, surfel.isTinted() ? sizeof surfel : offsetof(Surfel, tint));
  }
  surfels += added.size();
}

void CloudTotals::add(const CloudTotals& other) {
  if (!other.bounds.isEmpty()) bounds.add(other.bounds);
  surfels += other.surfels;
  skipped += other.skipped;
  content += other.content;
  channels = unionOf(channels, other.channels);
  missing_both += other.missing_both;
  missing_area += other.missing_area;
  covering += other.covering;
  missing_radius += other.missing_radius;
  radius_from_area += other.radius_from_area;
  spheres += other.spheres;
  bright += other.bright;
  largest_albedo = std::max(largest_albedo, other.largest_albedo);
  sample.insert(sample.end(), other.sample.begin(), other.sample.end());
}

Result<CloudReader> CloudReader::open(const std::vector<std::string>& inputs, bool strict,
                                      std::size_t read_bytes, const RowReaderOptions& reading,
                                      const SourceOpener& opener) {
  CloudReader reader;
  reader.inputs_ = inputs;
  reader.reading_ = reading;
  reader.reading_.access = Access::kDirect;
  reader.opener_ = opener ? opener : SourceOpener(openCloudSource);
  reader.strict_ = strict;
  reader.read_bytes_ = read_bytes;
  for (const std::string& path : inputs) {
    SURFEIT_ASSIGN_OR_RETURN(const auto source, reader.opener_(path, strict, reading));
    reader.records_.push_back(source->recordCount());
    reader.channels_.push_back(source->channels());
    if (source->hasFloatPositions()) reader.float_inputs_.push_back(path);
    reader.record_count_ += source->recordCount();
    reader.is_seekable_ = reader.is_seekable_ && source->isSeekable();
    for (const std::string& note : source->notes()) {
      reader.notes_.push_back(fmt::format("{}: {}", path, note));
    }
    reader.addGroupNames(*source);
    const UpAxis up = source->up();
    if (reader.up_.value_or(up) != up) {
      reader.notes_.push_back(fmt::format("{}: {} is up, but {} in {}: the scene has that (--up)",
                                          path, upAxisName(up), upAxisName(*reader.up_),
                                          inputs[0]));
    }
    if (!reader.up_) reader.up_ = up;
    std::string other_crs = reader.crs_.compare(source->path(), source->comments());
    if (!other_crs.empty()) reader.notes_.push_back(std::move(other_crs));
    std::vector<std::string>& advice = reader.albedo_advice_;
    if (std::string text = source->albedoAdvice();
        !text.empty() && std::find(advice.begin(), advice.end(), text) == advice.end()) {
      advice.push_back(std::move(text));
    }
    if (reader.size_names_.property.empty()) reader.size_names_ = source->sizeNames();
    const CloudChannels channels = source->channels();
    reader.lacks_sizes_ = reader.lacks_sizes_ || !channels.radius || source->hasCoverage();
    if (opener) {
      reader.file_bytes_ += source->recordCount() * source->rowBytes();
      continue;
    }
    SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
    reader.file_bytes_ += file.size();
  }
  if (const std::size_t bytes = reader.crs_.crs().size(); bytes > kMostCrsBytes) {
    reader.notes_.push_back(
        fmt::format("the coordinate reference system has {} bytes of text, and a scene keeps {} at "
                    "most: it is not kept",
                    bytes, kMostCrsBytes));
  }
  for (std::string& note : notesOfDarkClouds(reader.clouds())) {
    reader.notes_.push_back(std::move(note));
  }
  return reader;
}

std::string CloudReader::crs() const {
  return crs_.crs().size() <= kMostCrsBytes ? crs_.crs() : std::string();
}

std::string CloudReader::albedoAdvice() const {
  constexpr std::size_t kMost = 3;
  std::string text;
  for (std::size_t i = 0; i < std::min(albedo_advice_.size(), kMost); ++i) {
    text += albedo_advice_[i] + "; ";
  }
  return text;
}

std::vector<MixedCloud> CloudReader::clouds() const {
  std::vector<MixedCloud> clouds;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    clouds.push_back({inputs_[i], channels_[i], records_[i]});
  }
  return clouds;
}

void CloudReader::addGroupNames(const SurfelSource& source) {
  auto& names = group_names_.emplace_back();
  if (!source.channels().group) return;
  for (const std::string& comment : source.comments()) {
    const std::optional<StatedGroupName> stated = statedGroupName(comment);
    if (!stated) continue;
    if (stated->group < kMaxGroups && checkGroupName(stated->name).ok()) {
      names.emplace_back(stated->group, stated->name);
      continue;
    }
    notes_.push_back(fmt::format(
        "{}: comment \"{}\" names no group: expected a number from 0 to {} and a name such as lamp",
        source.path(), comment.substr(0, 80), kMaxGroups - 1));
  }
}

std::map<std::uint32_t, std::string> CloudReader::groupNames(
    std::vector<std::string>& notes) const {
  std::map<std::uint32_t, std::string> names;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    if (!groups_.empty() && groups_[i]) continue;
    for (const auto& [group, name] : group_names_[i]) {
      const auto [known, is_new] = names.emplace(group, name);
      if (is_new || known->second == name) continue;
      notes.push_back(
          fmt::format("{}: group {} is \"{}\", but \"{}\" in a cloud before it, and keeps that "
                      "name (index --group gives clouds names)",
                      inputs_[i], group, name, known->second));
    }
  }
  const auto named = names.find(0);
  for (std::size_t i = 0; named != names.end() && i < inputs_.size(); ++i) {
    if (channels_[i].group || (!groups_.empty() && groups_[i])) continue;
    notes.push_back(
        fmt::format("{}: no object groups, so its surfels are of group 0, which is \"{}\" in "
                    "another cloud (index --group gives it a name of its own)",
                    inputs_[i], named->second));
  }
  return names;
}

Result<std::vector<Surfel>> CloudReader::sample(std::uint64_t buckets) const {
  const std::uint64_t places = std::clamp(8 * buckets, kLeastPlaces, kMostPlaces);
  const std::size_t run_size = static_cast<std::size_t>(kSampleSurfels / places);
  const std::uint64_t step = std::max<std::uint64_t>(run_size, record_count_ / places);
  std::vector<Surfel> all, run(run_size);
  AlignedBuffer buffer;
  std::uint64_t record = step / 2;  // counted on from input to input
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    if (record >= records_[i]) {
      record -= records_[i];
      continue;
    }
    // Bad records are refused, if they are to be, when all are read: then the first one is named
    SURFEIT_ASSIGN_OR_RETURN(const auto source, opener_(inputs_[i], /* strict= */ false, reading_));
    source->setOrigin(origin_);
    for (; record < records_[i]; record += step) {
      SURFEIT_RETURN_IF_ERROR(source->seekRow(record));
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, source->readRows(run_size, buffer));
      SurfelDefects defects;
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                               source->decodeRows(rows, record, run, defects));
      all.insert(all.end(), run.begin(), run.begin() + static_cast<std::ptrdiff_t>(count));
    }
    record -= records_[i];
  }
  return all;
}

Result<CloudTotals> CloudReader::read(const Records& records, const Consumer& consume,
                                      Progress& progress) const {
  CloudTotals totals;
  std::uint64_t first = 0;  // record of the input
  for (std::size_t i = 0; i < inputs_.size(); first += records_[i++]) {
    totals.channels = unionOf(totals.channels, channels_[i]);
    if (!groups_.empty() && groups_[i]) totals.channels.group = true;
    const std::uint64_t begin = std::clamp(records.begin, first, first + records_[i]) - first;
    const std::uint64_t end = std::clamp(records.end, first, first + records_[i]) - first;
    // An empty input is opened where a part begins, so that what is wrong with it is told
    if (begin == end && (records_[i] > 0 || records.begin > 0)) continue;
    SURFEIT_ASSIGN_OR_RETURN(const CloudTotals added,
                             readInput(i, {begin, end}, consume, progress));
    totals.add(added);
  }
  return totals;
}

Result<CloudTotals> CloudReader::readInput(std::size_t input, const Records& records,
                                           const Consumer& consume, Progress& progress) const {
  const std::uint64_t sample_step = std::max<std::uint64_t>(1, record_count_ / kSampleSurfels);
  const std::string& path = inputs_[input];
  const std::optional<std::uint8_t> group = groups_.empty() ? std::nullopt : groups_[input];
  SURFEIT_ASSIGN_OR_RETURN(const auto source, opener_(path, strict_, reading_));
  source->setOrigin(origin_);
  InputPass pass(*source, consume, sample_step, group, progress);
  // Small inputs are read in parts too, so that all threads have some
  const std::uint64_t part_rows =
      (records.end - records.begin) / (4 * RowFetcher::kSlots) + kReadBatch;
  // What lies behind the last record that the source knows of shows too
  const std::uint64_t end = records.end == source->recordCount() ? ~std::uint64_t{0} : records.end;
  RowFetcher fetcher(*source,
                     static_cast<std::size_t>(
                         std::min<std::uint64_t>(read_bytes_, part_rows * source->rowBytes())),
                     records.begin, end);
  std::array<RowFetcher::Rows, RowFetcher::kSlots> fetched;  // by slot
  const auto fetch = [&]() -> std::optional<std::size_t> {
    if (progress.isCancelled()) pass.failure().note(Status::interrupted());
    if (pass.failure().happened()) return std::nullopt;
    const RowFetcher::Rows rows = fetcher.next();
    if (rows.bytes.empty()) return std::nullopt;
    fetched[rows.slot] = rows;
    return rows.slot;
  };
  const PipelineStage decode = {PipelineStage::Mode::kParallel, [&](std::size_t slot) {
                                  const RowFetcher::Rows rows = fetched[slot];
                                  pass.decode(rows);
                                  fetcher.giveBack(rows);
                                }};
  runPipeline(RowFetcher::kSlots, fetch, {&decode, 1});
  SURFEIT_RETURN_IF_ERROR(pass.failure().status());
  SURFEIT_RETURN_IF_ERROR(fetcher.status());
  if (group && source->channels().group && records.begin == 0) {
    progress.note(fmt::format("{}: groups of its own are left out: it has a name (--group)", path));
  }
  pass.totals().skipped = pass.defects().total();
  if (const std::string defects = pass.defects().describe(); !defects.empty()) {
    progress.note(fmt::format("{}: skipped {}", path, defects));
  }
  return pass.totals();
}

std::uint64_t CloudReader::memoryBytes(std::size_t read_bytes, int threads) {
  // A batch, grouped by bucket with its words, and a packed block
  constexpr std::uint64_t kThreadBytes = kReadBatch * (2 * sizeof(Surfel) + 16) + (512 << 10);
  return RowFetcher::kSlots * std::uint64_t{read_bytes} +
         static_cast<std::uint64_t>(threads) * kThreadBytes + 3 * kSampleSurfels * sizeof(Surfel);
}

std::vector<std::string> CloudReader::notesOfFloats(const CloudTotals& totals) const {
  std::vector<std::string> notes;
  const double step = floatStep(movedBounds(totals.bounds, origin_));
  const double spacing = double(totals.bounds.longestSide()) / std::sqrt(double(totals.surfels));
  // No more than quantizing moves, or one place
  if (spacing == 0 || step <= 1e-3 * spacing) return notes;
  for (const std::string& path : float_inputs_) {
    notes.push_back(fmt::format(
        "{}: positions are floats, which stand {:.2g} apart so far from 0, beside a spacing of "
        "about {:.2g}: write the cloud with doubles, or near 0",
        path, step, spacing));
  }
  return notes;
}

}  // namespace surfeit
