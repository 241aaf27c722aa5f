#include "cloud/rows/filtered_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "cloud/rows/row_filter.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxPlaces = 1024;
constexpr std::size_t kBlockBytes = 1 << 20;  // of the source that are read at once

// What of a row decides whether it is taken.
class RowChooser {
 public:
  static Result<RowChooser> create(const RowReader& source, const std::string& filter) {
    RowChooser chooser;
    if (!filter.empty()) {
      const std::span<const RowProperty> properties = source.element().properties;
      Result<RowFilter> condition = RowFilter::create(filter, properties);
      if (!condition.ok()) {
        const Status& status = condition.status();
        return Status::invalidArgument(fmt::format("{}: {}", source.path(), status.message()));
      }
      if (!condition->isTrue()) chooser.conditions_.push_back(std::move(*condition));
      chooser.is_wanted_ = true;
      return chooser;
    }
    const RowExclusions exclusions = source.exclusions();
    for (const RowExclusions::Kind& kind : exclusions.kinds) {
      SURFEIT_ASSIGN_OR_RETURN(RowFilter condition,
                               RowFilter::create(kind.condition, exclusions.properties));
      chooser.conditions_.push_back(std::move(condition));
    }
    return chooser;
  }

  bool takesAll() const { return conditions_.empty(); }
  std::size_t kindCount() const { return conditions_.size(); }

  // For each of `count` rows, at most kFilterRows, 0 where it is taken and else one more than the
  // number of its kind.
  void choose(const std::byte* rows, std::size_t row_bytes, std::size_t count,
              std::uint8_t* kinds) {
    std::fill_n(kinds, count, std::uint8_t{0});
    std::uint8_t holds[kFilterRows];
    for (std::size_t kind = 0; kind < conditions_.size(); ++kind) {
      conditions_[kind].test(rows, row_bytes, count, workspace_, holds);
      for (std::size_t i = 0; i < count; ++i) {
        if (kinds[i] == 0 && (holds[i] != 0) != is_wanted_) {
          kinds[i] = static_cast<std::uint8_t>(kind + 1);
        }
      }
    }
  }

 private:
  std::vector<RowFilter> conditions_;
  bool is_wanted_ = false;  // whether rows are taken that a condition holds for
  RowFilter::Workspace workspace_;
};

std::size_t blockRows(const RowLayout& element) {
  return std::max<std::size_t>(1, kBlockBytes / element.row_bytes);
}

void addPlace(std::uint64_t row, RowSelection& selection) {
  if (selection.kept_count++ % selection.step != 0) return;
  if (selection.places.size() == kMaxPlaces) {
    // Every second place is enough from now on; this one is the next of them
    for (std::size_t i = 0; 2 * i < kMaxPlaces; ++i) selection.places[i] = selection.places[2 * i];
    selection.places.resize(kMaxPlaces / 2);
    selection.step *= 2;
  }
  selection.places.push_back(row);
}

Result<RowSelection> selectRows(RowReader& source, RowChooser& chooser) {
  RowSelection selection;
  selection.left_out.resize(chooser.kindCount());
  const std::size_t row_bytes = source.element().row_bytes;
  AlignedBuffer buffer;
  std::uint8_t kinds[kFilterRows];
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes rows,
                             source.readRows(blockRows(source.element()), buffer));
    if (rows.empty()) break;
    const std::size_t count = rows.size() / row_bytes;
    for (std::size_t begin = 0; begin < count; begin += kFilterRows) {
      const std::size_t size = std::min(kFilterRows, count - begin);
      chooser.choose(rows.data() + begin * row_bytes, row_bytes, size, kinds);
      for (std::size_t i = 0; i < size; ++i) {
        if (kinds[i] == 0) {
          addPlace(selection.row_count + begin + i, selection);
        } else {
          ++selection.left_out[kinds[i] - 1u];
        }
      }
    }
    selection.row_count += count;
  }
  SURFEIT_RETURN_IF_ERROR(source.rewind());
  return selection;
}

std::string describe(const RowSelection& selection, const RowExclusions& exclusions,
                     const std::string& filter) {
  const std::uint64_t left_out = selection.row_count - selection.kept_count;
  std::string text = fmt::format("{} of {} points {} left out", left_out, selection.row_count,
                                 left_out == 1 ? "is" : "are");
  if (!filter.empty()) return text + fmt::format(" by the filter {}", quoteText(filter));
  std::string_view separator = ": ";
  for (std::size_t i = 0; i < selection.left_out.size(); ++i) {
    if (selection.left_out[i] == 0) continue;
    text += fmt::format("{}{} {}", std::exchange(separator, ", "), selection.left_out[i],
                        exclusions.kinds[i].name);
  }
  return text + "; --filter true keeps them";
}

class FilteredReader final : public RowReader {
 public:
  FilteredReader(std::unique_ptr<RowReader> source, RowChooser chooser,
                 std::shared_ptr<const RowSelection> selection, std::string note)
      : source_(std::move(source)),
        chooser_(std::move(chooser)),
        selection_(std::move(selection)),
        note_(std::move(note)),
        element_(source_->element()) {
    element_.count = selection_->kept_count;
  }

  const std::string& path() const override { return source_->path(); }
  std::string formatName() const override { return source_->formatName(); }
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override { return source_->comments(); }
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = source_->notes();
    notes.push_back(note_);
    return notes;
  }
  const RowReader& file() const override { return source_->file(); }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    if (max_rows == 0) {
      return Status::invalidArgument(fmt::format("{}: no rows asked for", path()));
    }
    const auto wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, element_.count - next_));
    buffer.reserve(wanted * element_.row_bytes);
    failure_ = take(wanted, buffer.data());
    SURFEIT_RETURN_IF_ERROR(failure_);
    return Bytes(buffer.data(), wanted * element_.row_bytes);
  }

  Status rewind() override {
    failure_ = source_->rewind();
    forget();
    return failure_;
  }

  bool isSeekable() const override { return source_->isSeekable(); }

  Status seekRow(std::uint64_t row) override {
    if (!isSeekable() || row > element_.count) {
      return Status::invalidArgument(fmt::format("{}: seek to row {} of {}{}", path(), row,
                                                 element_.count,
                                                 isSeekable() ? "" : ", which cannot be sought"));
    }
    failure_ = moveTo(row);
    return failure_;
  }

 private:
  void forget() {
    next_ = 0;
    rows_ = {};
    begin_ = kinds_begin_ = kinds_end_ = 0;
  }

  // Copies the next `wanted` rows that are taken, or passes over them when `to` is nullptr.
  Status take(std::uint64_t wanted, std::byte* to) {
    const std::size_t row_bytes = element_.row_bytes;
    while (wanted > 0) {
      SURFEIT_RETURN_IF_ERROR(look());
      const std::uint8_t* const kinds = kinds_ + (begin_ - kinds_begin_);
      const std::size_t seen = kinds_end_ - begin_;
      const auto run = static_cast<std::size_t>(std::find(kinds, kinds + seen, 0) - kinds);
      begin_ += run;
      if (run == seen) continue;
      std::size_t count = 0;
      while (count < seen - run && count < wanted && kinds[run + count] == 0) ++count;
      if (to != nullptr) {
        std::memcpy(to, rows_.data() + begin_ * row_bytes, count * row_bytes);
        to += count * row_bytes;
      }
      begin_ += count;
      next_ += count;
      wanted -= count;
    }
    return {};
  }

  // Makes sure that it is known which rows from begin_ on are taken, at least of one.
  Status look() {
    const std::size_t row_bytes = element_.row_bytes;
    if (begin_ < kinds_end_) return {};
    if (begin_ * row_bytes == rows_.size()) {
      SURFEIT_ASSIGN_OR_RETURN(rows_, source_->readRows(blockRows(element_), block_));
      begin_ = 0;
      if (rows_.empty()) {
        return Status::corruption(fmt::format(
            "{}: found {} rows that the filter takes, expected {}: the file has changed since it "
            "was opened",
            path(), next_, element_.count));
      }
    }
    kinds_begin_ = begin_;
    kinds_end_ = std::min(begin_ + kFilterRows, rows_.size() / row_bytes);
    chooser_.choose(rows_.data() + begin_ * row_bytes, row_bytes, kinds_end_ - begin_, kinds_);
    return {};
  }

  // On from here where that is not farther than from the last known place before the row.
  Status moveTo(std::uint64_t row) {
    const std::uint64_t place = row / selection_->step;
    if (failure_.ok() && next_ <= row && row - next_ <= row % selection_->step) {
      return take(row - next_, nullptr);
    }
    forget();
    if (place >= selection_->places.size()) {  // the end
      next_ = row;
      return source_->seekRow(selection_->row_count);
    }
    next_ = place * selection_->step;
    SURFEIT_RETURN_IF_ERROR(source_->seekRow(selection_->places[static_cast<std::size_t>(place)]));
    return take(row - next_, nullptr);
  }

  std::unique_ptr<RowReader> source_;
  RowChooser chooser_;
  std::shared_ptr<const RowSelection> selection_;
  std::string note_;
  RowLayout element_;
  Status failure_;
  std::uint64_t next_ = 0;  // of the rows that are taken

  AlignedBuffer block_;
  Bytes rows_;             // of the source, in block_
  std::size_t begin_ = 0;  // of these the first that is left
  // What is known of rows_[kinds_begin_, kinds_end_)
  std::size_t kinds_begin_ = 0, kinds_end_ = 0;
  std::uint8_t kinds_[kFilterRows] = {};
};

}  // namespace

std::shared_ptr<const RowSelection> RowSelections::find(const std::string& key) const {
  const std::lock_guard lock(mutex_);
  const auto found = selections_.find(key);
  return found != selections_.end() ? found->second : nullptr;
}

void RowSelections::add(const std::string& key, std::shared_ptr<const RowSelection> selection) {
  const std::lock_guard lock(mutex_);
  selections_[key] = std::move(selection);
}

Result<std::unique_ptr<RowReader>> filterRows(std::unique_ptr<RowReader> source,
                                              const std::string& filter, const std::string& key,
                                              RowSelections* selections) {
  SURFEIT_ASSIGN_OR_RETURN(RowChooser chooser, RowChooser::create(*source, filter));
  if (chooser.takesAll() || source->element().count == 0) return source;
  std::shared_ptr<const RowSelection> selection =
      selections != nullptr ? selections->find(key) : nullptr;
  if (selection == nullptr || selection->row_count != source->element().count) {
    SURFEIT_ASSIGN_OR_RETURN(RowSelection selected, selectRows(*source, chooser));
    selection = std::make_shared<const RowSelection>(std::move(selected));
    if (selections != nullptr) selections->add(key, selection);
  }
  if (selection->kept_count == selection->row_count) return source;
  std::string note = describe(*selection, source->exclusions(), filter);
  return std::unique_ptr<RowReader>(std::make_unique<FilteredReader>(
      std::move(source), std::move(chooser), std::move(selection), std::move(note)));
}

}  // namespace surfeit
