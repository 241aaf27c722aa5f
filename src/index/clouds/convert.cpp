// Rows go through in batches of a MiB:
//
//   reader --take, widen--> rows of the output --move--> --crop--> --thin--> writer
//
// What nothing is done to goes from reader to writer without a copy. Thinning by a grid looks at
// all rows before, in a pass of its own.
#include "surfeit/convert.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <set>
#include <string_view>
#include <utility>

#include "cloud/cloud_formats.h"
#include "cloud/edits/channel_assignment.h"
#include "cloud/edits/row_transform.h"
#include "cloud/edits/row_union.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/program_memory.h"
#include "core/up_comment.h"
#include "index/clouds/grid_thinner.h"
#include "index/notes/merged_comments.h"
#include "index/notes/reader_notes.h"
#include "index/rows/scene_rows.h"
#include "storage/file.h"
#include "storage/output_target.h"

namespace surfeit {
namespace {

constexpr std::size_t kConvertedBytes = 1 << 20;
constexpr std::size_t kMostNamesTold = 12;
// Buffers of readers and writer, and batches.
constexpr std::uint64_t kStreamBytes = std::uint64_t{8} << 20;
constexpr std::uint64_t kConvertMemory = std::uint64_t{2} << 30;

std::string listNames(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMostNamesTold); ++i) text += " " + names[i];
  return names.size() > kMostNamesTold ? text + " ..." : text;
}

bool isPositionName(std::string_view name) {
  return std::find(std::begin(kPositionNames), std::end(kPositionNames), name) !=
         std::end(kPositionNames);
}

// The properties without those that the options drop. kInvalidArgument for names that none has.
Result<std::vector<RowProperty>> chooseProperties(const std::vector<RowProperty>& properties,
                                                  const ConvertOptions& options) {
  const bool keeps = !options.keep.empty();
  const std::vector<std::string>& words = keeps ? options.keep : options.drop;
  if (words.empty()) return properties;
  RowLayout element;
  element.properties = properties;
  const std::vector<RowChannel> channels = channelsOf(element);

  std::vector<bool> is_named(properties.size(), false);
  for (const std::string& word : words) {
    bool is_found = false;
    for (const RowChannel& channel : channels) {
      for (const std::size_t i : channel.properties) {
        if (word != channel.name && word != properties[i].name) continue;
        is_named[i] = is_found = true;
      }
    }
    if (is_found) continue;
    std::vector<std::string> names;
    for (const RowChannel& channel : channels) names.push_back(channel.name);
    return Status::invalidArgument(fmt::format("{}: found no channel {}, expected one of{}",
                                               keeps ? "keep" : "drop", quoteText(word),
                                               listNames(names)));
  }
  std::vector<RowProperty> chosen;
  for (std::size_t i = 0; i < properties.size(); ++i) {
    const bool stays = keeps ? is_named[i] || isPositionName(properties[i].name) : !is_named[i];
    if (stays) chosen.push_back(properties[i]);
  }
  if (chosen.empty()) return Status::invalidArgument("drop: nothing is left to write");
  return chosen;
}

// Tells which packed rows lie in a box.
class Cropper {
 public:
  // kInvalidArgument when the box holds nothing, or rows have no positions.
  static Result<Cropper> create(const CropBox& box, const RowLayout& element) {
    Cropper cropper(box, element.row_bytes);
    for (int axis = 0; axis < 3; ++axis) {
      if (!(box.min[axis] < box.max[axis])) {
        return Status::invalidArgument(
            fmt::format("crop: found {} to {} along {}, expected a box that is not empty",
                        box.min[axis], box.max[axis], kPositionNames[axis]));
      }
      const RowProperty* const property = element.find(kPositionNames[axis]);
      if (property == nullptr) {
        return Status::invalidArgument(
            fmt::format("crop: found no property {}, expected positions", kPositionNames[axis]));
      }
      cropper.properties_[std::size_t(axis)] = *property;
    }
    return cropper;
  }

  // Moves the rows in the box to the front and returns how many there are.
  std::size_t crop(std::byte* rows, std::size_t count) const {
    std::size_t size = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::byte* const row = rows + i * row_bytes_;
      if (!holds(row)) continue;
      if (size != i) std::memcpy(rows + size * row_bytes_, row, row_bytes_);
      ++size;
    }
    return size;
  }

 private:
  Cropper(const CropBox& box, std::size_t row_bytes) : box_(box), row_bytes_(row_bytes) {}

  bool holds(const std::byte* row) const {
    for (int axis = 0; axis < 3; ++axis) {
      const RowProperty& property = properties_[std::size_t(axis)];
      const double value = rowValue(row + property.offset, property.type);
      if (!(value >= box_.min[axis] && value < box_.max[axis])) return false;
    }
    return true;
  }

  CropBox box_;
  std::size_t row_bytes_;
  std::array<RowProperty, 3> properties_;
};

bool isThinning(const ConvertOptions& options) {
  return options.spacing || !options.density.cameras.empty();
}

class Converter {
 public:
  Converter(const std::vector<std::string>& inputs, const std::string& output,
            const ConvertOptions& options, RowTransform transform, Progress& progress)
      : inputs_(inputs),
        output_(output),
        options_(options),
        transform_(std::move(transform)),
        progress_(progress) {}

  Result<ConvertStats> run() {
    SURFEIT_ASSIGN_OR_RETURN(reading_.channels, parseChannelRenames(options_.channels));
    reading_.part = options_.part;
    reading_.filter = options_.filter;
    reading_.selections = std::make_shared<RowSelections>();
    SURFEIT_ASSIGN_OR_RETURN(reading_.color_range,
                             colorRangeFor(inputs_, output_, options_.color_range));
    SURFEIT_RETURN_IF_ERROR(openInputs());
    SURFEIT_RETURN_IF_ERROR(placeRows());
    SURFEIT_RETURN_IF_ERROR(createWriter());
    if (thinner_) SURFEIT_RETURN_IF_ERROR(chooseRows());
    progress_.beginPhase("convert", stats_.records, "records");
    SURFEIT_RETURN_IF_ERROR(convertInputs());
    if (thinner_ && !thinner_->isComplete()) {
      return Status::failed(
          fmt::format("{}: fewer records when read again: an input changed meanwhile", output_));
    }
    tellAssignments();
    if (progress_.isCancelled()) return Status::interrupted();  // before it has a name
    progress_.beginPhase("finish", 0, "records");
    SURFEIT_RETURN_IF_ERROR(writer_->finish());
    stats_.temporary_bytes = writer_->temporaryBytes();
    noteOfWriter();
    SURFEIT_ASSIGN_OR_RETURN(const OutputTarget target, resolveOutput(output_));
    if (!target.is_stream) {
      SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(output_));
      stats_.output_bytes = file.size();
    }
    return std::move(stats_);
  }

 private:
  // Looks at all inputs, of which only the first stays open.
  Status openInputs() {
    for (const std::string& path : inputs_) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openCloud(path, reading_));
      const RowLayout& element = reader->element();
      stats_.records += element.count;
      rows_to_write_ += element.count / options_.every + (element.count % options_.every != 0);
      union_.add(element);
      tellNotes(*reader, progress_);
      merged_.add(path, reader->comments());
      SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
      stats_.input_bytes += file.size();
      if (first_ == nullptr) first_ = std::move(reader);
    }
    for (const std::string& note : merged_.notes(options_.up.has_value())) progress_.note(note);
    return {};
  }

  // All records, one input after the other.
  Status convertInputs() {
    SURFEIT_RETURN_IF_ERROR(convert(*first_));
    if (is_measuring_) {
      SURFEIT_RETURN_IF_ERROR(first_->rewind());
    } else {
      first_.reset();
    }
    for (std::size_t i = 1; i < inputs_.size(); ++i) {
      SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader,
                               openCloud(inputs_[i], reading_));
      SURFEIT_RETURN_IF_ERROR(convert(*reader));
    }
    return {};
  }

  // Which records are kept of those that share a cell.
  Status chooseRows() {
    progress_.beginPhase("measure", stats_.records, "records");
    is_measuring_ = true;
    SURFEIT_RETURN_IF_ERROR(convertInputs());
    is_measuring_ = false;
    for (ChannelAssignment& made : assignments_) made.forget();
    progress_.beginPhase("choose", 0, "records");
    SURFEIT_RETURN_IF_ERROR(thinner_->choose(progress_));
    stats_.placeless_records = thinner_->placeless();
    if (thinner_->placeless() > 0) {
      progress_.note(fmt::format(
          "{}: {} records without a finite position are left out: they lie in no cell of the grid",
          output_, thinner_->placeless()));
    }
    progress_.inform(fmt::format(
        "{}: {} of {} records are kept, one per cell of {}", output_, thinner_->kept(),
        thinner_->measured(),
        options_.spacing ? fmt::format("{}", *options_.spacing) : "the cameras' grids"));
    // Now the writer can tell what it will need; nothing was written yet
    writing_.count = thinner_->kept();
    SURFEIT_ASSIGN_OR_RETURN(writer_, createRowWriter(output_, writing_));
    noteOfWriter();
    return {};
  }

  // Turns up what is to be up.
  Status placeRows() {
    if (!options_.up) return {};
    SURFEIT_ASSIGN_OR_RETURN(const UpAxis from, merged_.turnedFrom(*options_.up));
    if (from == *options_.up) {
      progress_.inform(
          fmt::format("{}: {} is up already: not turned", inputs_[0], upAxisName(from)));
      return {};
    }
    SURFEIT_ASSIGN_OR_RETURN(
        transform_,
        RowTransform::create(RowTransform::behindTurn(options_.transform, from, *options_.up),
                             double(options_.every)));
    return {};
  }

  Status createWriter() {
    SURFEIT_ASSIGN_OR_RETURN(writing_.properties, chooseProperties(union_.properties(), options_));
    for (const std::string& text : options_.assignments) {
      SURFEIT_RETURN_IF_ERROR(ChannelAssignment::declare(text, writing_.properties));
    }
    transform_.widenTypes(writing_.properties);
    if (isThinning(options_)) RowTransform::widenSizes(writing_.properties);
    writing_.comments = merged_.comments();
    if (options_.up) stateUpAxis(*options_.up, writing_.comments);
    if (!options_.crop && !isThinning(options_)) writing_.count = rows_to_write_;
    SURFEIT_RETURN_IF_ERROR(planMemory());
    writing_.progress = &progress_;
    if (!options_.like.empty()) {
      RowReaderOptions as_stored;
      as_stored.filter = "true";  // its rows are not read, so nothing is to be counted
      as_stored.color_range.reset();
      SURFEIT_ASSIGN_OR_RETURN(like_, openRowReader(options_.like, as_stored));
      writing_.like = like_.get();
    } else if (transform_.isIdentity() && inputs_.size() == 1) {
      writing_.like = first_.get();
    }
    // The grid of a volume and the camera of a picture are those of the places that rows had
    SURFEIT_ASSIGN_OR_RETURN(
        assignments_, ChannelAssignment::createAll(options_.assignments, writing_.properties));
    const bool are_set = std::any_of(assignments_.begin(), assignments_.end(),
                                     [](const auto& made) { return made.movesRows(); });
    if (are_set && options_.like.empty()) writing_.like = nullptr;
    if (are_set || !transform_.isIdentity()) {
      MergedComments::forgetCrs(output_, writing_.comments, progress_);
    }
    SURFEIT_ASSIGN_OR_RETURN(writer_, createRowWriter(output_, writing_));
    noteOfWriter();

    const RowLayout& element = writer_->element();
    transform_.bind(element);
    for (const std::string& note : transform_.notes()) {
      progress_.note(fmt::format("{}: {}", output_, note));
    }
    if (options_.crop) {
      SURFEIT_ASSIGN_OR_RETURN(cropper_, Cropper::create(*options_.crop, element));
    }
    if (isThinning(options_)) SURFEIT_RETURN_IF_ERROR(createThinner(element));
    for (const RowProperty& property : element.properties) {
      stats_.properties.push_back(
          fmt::format("{} {}", valueTypeName(property.type), property.name));
    }
    return {};
  }

  Status createThinner(const RowLayout& element) {
    GridThinner::Options thinning;
    thinning.memory_bytes = thinner_bytes_;
    thinning.temporary_directory = temporaryDirectory(options_.temporary_directory, output_);
    if (options_.spacing) {
      thinning.spacing = *options_.spacing;
    } else {
      const UpAxis up = statedUpAxis(writing_.comments).value_or(kDefaultUpAxis);
      SURFEIT_ASSIGN_OR_RETURN(thinning.cameras,
                               CameraSpacing::create(options_.density, up, glm::dvec3(0), 0));
    }
    SURFEIT_ASSIGN_OR_RETURN(thinner_, GridThinner::create(std::move(thinning), element));
    return {};
  }

  void tellAssignments() {
    for (const ChannelAssignment& made : assignments_) {
      progress_.inform(fmt::format("{}: {}", output_, made.describe()));
      if (!made.loss().empty()) progress_.note(fmt::format("{}: {}", output_, made.loss()));
    }
  }

  // What writer and thinner get. A writer that holds what it writes comes first.
  Status planMemory() {
    const std::uint64_t fixed = programBytes(1) + kStreamBytes;
    const std::uint64_t least = fixed + (isThinning(options_) ? GridThinner::kLeastMemory : 0);
    if (options_.memory_bytes < least) {
      return Status::budgetTooSmall(
          fmt::format("a memory budget of {:.1f} MiB is too small to convert: {} MiB is the least "
                      "that works",
                      double(options_.memory_bytes) / (1 << 20), (least >> 20) + 1));
    }
    const std::uint64_t rest = options_.memory_bytes - fixed;
    if (isThinning(options_)) {
      RowLayout row;
      row.properties = writing_.properties;
      packRow(row);
      const std::uint64_t held = heldWriterBytes(output_, rows_to_write_, row.row_bytes);
      thinner_bytes_ = std::max(rest - std::min(rest, held), GridThinner::kLeastMemory);
    }
    writing_.memory_bytes = rest - thinner_bytes_;
    writing_.memory_beside_bytes = fixed + thinner_bytes_;
    return {};
  }

  // What the writer has not said yet.
  void noteOfWriter() {
    for (const std::string& note : writer_->notes()) {
      if (told_.insert(note).second) progress_.note(fmt::format("{}: {}", output_, note));
    }
  }

  void noteAbsent(const std::string& path, const RowCopier& copier) {
    const auto tell = [&](const char* what, const std::vector<std::string>& names) {
      if (!names.empty()) progress_.note(fmt::format("{}: {}:{}", path, what, listNames(names)));
    };
    tell("not there, 0 is written", copier.absent());
    tell("not there, 1 or the largest code is written", copier.full());
    tell("not there, the color is written", copier.colored());
  }

  Status convert(RowReader& reader) {
    const RowLayout& from = reader.element();
    const RowLayout& to = writer_->element();
    if (from.count == 0) return {};
    const RowCopier copier(from, to);
    if (!is_measuring_) noteAbsent(reader.path(), copier);
    const bool keeps_rows = copier.keepsRows() && options_.every == 1 && transform_.isIdentity() &&
                            !cropper_ && !thinner_ && assignments_.empty();
    const std::size_t batch_rows =
        std::max<std::size_t>(1, kConvertedBytes / std::max(from.row_bytes, to.row_bytes));
    for (std::uint64_t record = 0;;) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader.readRows(batch_rows, buffer_));
      if (rows.empty()) return {};
      const std::size_t count = rows.size() / from.row_bytes;
      if (keeps_rows) {
        SURFEIT_RETURN_IF_ERROR(writer_->writeRows(rows));
        stats_.written_records += count;
      } else {
        SURFEIT_RETURN_IF_ERROR(convertRows(copier, rows.data(), from.row_bytes, record, count));
      }
      record += count;
      progress_.advance(count);
      progress_.advanceBytes(rows.size());
    }
  }

  // Rows of the reader, the first of which is `record`.
  Status convertRows(const RowCopier& copier, const std::byte* rows, std::size_t row_bytes,
                     std::uint64_t record, std::size_t count) {
    // Take
    const std::uint64_t every = options_.every;
    const std::uint64_t skipped = (every - record % every) % every;
    const std::size_t taken =
        skipped < count ? static_cast<std::size_t>((count - 1 - skipped) / every + 1) : 0;
    if (!is_measuring_) stats_.skipped_records += count - taken;
    if (taken == 0) return {};
    const std::size_t to_bytes = writer_->element().row_bytes;
    rows_.resize(taken * to_bytes);
    // With one row, how far the next one would be does not matter
    const std::size_t step = taken > 1 ? static_cast<std::size_t>(every) : 1;
    copier.copy(rows + static_cast<std::size_t>(skipped) * row_bytes, step, taken, rows_.data());

    // Move and crop
    transform_.apply(rows_.data(), taken);
    std::size_t kept = cropper_ ? cropper_->crop(rows_.data(), taken) : taken;
    for (ChannelAssignment& made : assignments_) made.apply(rows_.data(), kept);
    if (is_measuring_) return thinner_->measure(rows_.data(), kept);
    stats_.cropped_records += taken - kept;

    // Thin
    if (thinner_) {
      const std::size_t before = kept;
      SURFEIT_ASSIGN_OR_RETURN(kept, thinner_->thin(rows_.data(), kept));
      stats_.thinned_records += before - kept;
    }
    stats_.written_records += kept;
    return writer_->writeRows(std::span(rows_).first(kept * to_bytes));
  }

  const std::vector<std::string>& inputs_;
  const std::string& output_;
  const ConvertOptions& options_;
  RowTransform transform_;
  Progress& progress_;

  RowReaderOptions reading_;
  RowUnion union_;
  MergedComments merged_;
  std::unique_ptr<RowReader> first_;
  std::uint64_t rows_to_write_ = 0;  // without cropping
  std::unique_ptr<RowReader> like_;
  RowWriterOptions writing_;
  std::unique_ptr<RowWriter> writer_;
  std::set<std::string> told_;
  std::optional<Cropper> cropper_;
  std::vector<ChannelAssignment> assignments_;
  std::unique_ptr<GridThinner> thinner_;
  std::uint64_t thinner_bytes_ = 0;
  bool is_measuring_ = false;  // all records for the thinner, nothing is written
  AlignedBuffer buffer_;
  std::vector<std::byte> rows_;
  ConvertStats stats_{.memory_bytes = options_.memory_bytes};
};

Status checkOptions(const std::vector<std::string>& inputs, const ConvertOptions& options) {
  if (inputs.empty()) return Status::invalidArgument("convert: no input cloud");
  if (options.every == 0) return Status::invalidArgument("every is 0, expected 1 or more");
  if (options.spacing) {
    SURFEIT_RETURN_IF_ERROR(GridThinner::checkSpacing(*options.spacing));
    if (options.every > 1) {
      return Status::invalidArgument("found both every and spacing, expected one of them");
    }
  }
  if (!options.density.cameras.empty() && (options.every > 1 || options.spacing)) {
    return Status::invalidArgument("found cameras with every or spacing, expected one of them");
  }
  if (!options.keep.empty() && !options.drop.empty()) {
    return Status::invalidArgument("found channels both to keep and to drop, expected one of them");
  }
  return {};
}

}  // namespace

Result<ConvertStats> convertClouds(const std::vector<std::string>& inputs,
                                   const std::string& output, const ConvertOptions& given,
                                   Progress& progress) {
  ConvertOptions options = given;
  if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kConvertMemory);
  return guarded(output, [&]() -> Result<ConvertStats> {
    SURFEIT_RETURN_IF_ERROR(checkOptions(inputs, options));
    SURFEIT_ASSIGN_OR_RETURN(RowTransform transform,
                             RowTransform::create(options.transform, double(options.every)));
    Converter converter(inputs, output, options, std::move(transform), progress);
    if (!isThinning(options)) return converter.run();
    // What is planned for sorting is that of one thread
    Result<ConvertStats> stats = Status::failed("convert: not run");
    withThreads(1, [&] { stats = converter.run(); });
    return stats;
  });
}

}  // namespace surfeit
