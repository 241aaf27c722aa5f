#include "cloud/scans/las_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "cloud/parts/lost_comments.h"
#include "cloud/parts/spooled_input.h"
#include "cloud/scans/las_crs.h"
#include "cloud/scans/las_encoder.h"
#include "cloud/scans/las_plan.h"
#include "cloud/scans/las_reader.h"
#include "core/assert.h"
#include "core/crs_comment.h"
#include "core/up_comment.h"
#include "storage/byte_coding.h"
#include "storage/byte_output.h"
#include "storage/file.h"
#include "storage/temporary_bytes.h"

namespace surfeit {
namespace {

using Places = LasHeaderPlaces;

constexpr std::size_t kBlockBytes = 256 << 10;
constexpr std::uint64_t kMost32 = std::numeric_limits<std::uint32_t>::max();
constexpr std::string_view kSystem = "OTHER", kSoftware = "Surfeit";

std::size_t headerBytes(unsigned minor) {
  return minor < 3   ? kLasHeaderBytes12
         : minor < 4 ? kLasHeaderBytes13
         : minor < 5 ? kLasHeaderBytes14
                     : kLasHeaderBytes15;
}

class LasWriter final : public RowWriter {
 public:
  LasWriter(ByteOutput output, const RowWriterOptions& options)
      : output_(std::move(output)), comments_(options.comments) {
    element_.name = "vertex";
    element_.properties = options.properties;
    packRow(element_);
    wish_.element = &element_;
    wish_.count = options.count;
  }

  Status open(const RowWriterOptions& options) {
    std::erase(comments_, upComment(UpAxis::kZ));  // which all LAS files have
    std::optional<LasCrsRecord> crs = lasCrsRecord(comments_);
    if (const LasHeader* const like = lasHeaderOf(options.like)) {
      like_ = *like;
      like_element_ = options.like->element();
      wish_.like = &*like_;
      wish_.like_element = &like_element_;
      // Its records of variable length are copied, some of them at the end
      SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(like_->path));
      like_input_.emplace(std::move(input));
    } else {
      wish_.prefers_keys = crs && crs->number == kLasGeoKeysRecord;
      crs_ = std::move(crs);
    }
    noteComments();
    SURFEIT_ASSIGN_OR_RETURN(LasPlan plan, planLas(wish_, output_.path()));
    if (like_ && plan.doubtful.empty()) return begin(std::move(plan), likeGrid());

    // Scale, offset or what fits is only known when all rows have been seen
    if (!like_ && !plan.has_returns) {
      notes_.push_back("no numbers of returns: every point is written as return 1 of 1");
    }
    doubts_ = std::move(plan);
    is_doubted_.resize(doubts_->doubtful.size(), false);
    SURFEIT_ASSIGN_OR_RETURN(TemporaryBytes rows, TemporaryBytes::create(spoolDirectory()));
    rows_.emplace(std::move(rows));
    least_.fill(std::numeric_limits<double>::infinity());
    most_.fill(-std::numeric_limits<double>::infinity());
    return {};
  }

  const RowLayout& element() const override { return element_; }

  std::uint64_t temporaryBytes() const override { return rows_ ? rows_->size() : 0; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = notes_;
    if (!encoder_) return notes;
    notes.insert(notes.end(), encoder_->plan().notes.begin(), encoder_->plan().notes.end());
    if (is_finished_) {
      const std::vector<std::string> found = encoder_->notes();
      notes.insert(notes.end(), found.begin(), found.end());
    }
    return notes;
  }

  Status writeRows(std::span<const std::byte> rows) override {
    if (is_finished_ || rows.size() % element_.row_bytes != 0) {
      return Status::invalidArgument(
          fmt::format("{}: {} bytes to write, expected whole rows of {} bytes before finish",
                      output_.path(), rows.size(), element_.row_bytes));
    }
    if (!rows_) return encode(rows);
    look(rows);
    return rows_->append(rows);
  }

  Status finish() override {
    if (is_finished_) {
      return Status::invalidArgument(fmt::format("{}: finished twice", output_.path()));
    }
    if (rows_) SURFEIT_RETURN_IF_ERROR(writeHeldRows());
    SURFEIT_RETURN_IF_ERROR(copyExtendedRecords());
    SURFEIT_RETURN_IF_ERROR(completeHeader());
    SURFEIT_RETURN_IF_ERROR(output_.commit());
    is_finished_ = true;
    return {};
  }

 private:
  LasGrid likeGrid() const { return {like_->scale, like_->origin}; }

  // Comments that do not tell of coordinates have no place.
  void noteComments() {
    notes_ = notesOfLostComments("LAS", comments_, /* keeps_crs= */ true);
    const bool has_crs = !statedCrs(comments_).empty();
    if (!like_ && has_crs && !crs_) {
      notes_.push_back("the coordinate reference system is not kept: it has no code and no text");
    }
  }

  // Bounds of held rows, and which columns have values that do not fit.
  void look(std::span<const std::byte> rows) {
    const std::size_t row_bytes = element_.row_bytes, count = rows.size() / row_bytes;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const RowProperty& property = doubts_->position[axis];
      for (std::size_t i = 0; i < count; ++i) {
        const double value = rowValue(rows.data() + i * row_bytes + property.offset, property.type);
        if (!std::isfinite(value)) continue;
        least_[axis] = std::min(least_[axis], value);
        most_[axis] = std::max(most_[axis], value);
      }
    }
    for (std::size_t i = 0; i < is_doubted_.size(); ++i) {
      if (is_doubted_[i]) continue;
      is_doubted_[i] =
          !keepsLasValues(doubts_->columns[doubts_->doubtful[i]], rows.data(), row_bytes, count);
    }
  }

  // Encodes what has waited.
  Status writeHeldRows() {
    for (std::size_t i = 0; i < is_doubted_.size(); ++i) {
      if (is_doubted_[i]) wish_.misfits.push_back(doubts_->columns[doubts_->doubtful[i]].property);
    }
    SURFEIT_RETURN_IF_ERROR(rows_->flush());
    const std::uint64_t bytes = rows_->size();
    wish_.count = bytes / element_.row_bytes;
    SURFEIT_ASSIGN_OR_RETURN(LasPlan plan, planLas(wish_, output_.path()));
    LasGrid grid;
    if (like_) {
      grid = likeGrid();
    } else if (least_[0] <= most_[0] && least_[1] <= most_[1] && least_[2] <= most_[2]) {
      const bool is_float =
          std::all_of(plan.position.begin(), plan.position.end(),
                      [](const auto& p) { return p.type == ValueType::kFloat32; });
      grid = chooseLasGrid(least_, most_, *wish_.count, is_float);
    }
    SURFEIT_RETURN_IF_ERROR(begin(std::move(plan), grid));

    const std::size_t block =
        std::max<std::size_t>(1, kBlockBytes / element_.row_bytes) * element_.row_bytes;
    std::vector<std::byte> buffer(block);
    for (std::uint64_t at = 0; at < bytes; at += block) {
      const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(block, bytes - at));
      const std::span<std::byte> rows = std::span(buffer).first(size);
      SURFEIT_RETURN_IF_ERROR(rows_->readAt(at, rows));
      SURFEIT_RETURN_IF_ERROR(encode(rows));
    }
    return {};
  }

  // Writes all that stands before the points, to be completed.
  Status begin(LasPlan plan, const LasGrid& grid) {
    encoder_.emplace(std::move(plan), grid);
    header_.assign(headerBytes(encoder_->plan().minor), std::byte{0});
    if (like_) {
      const std::size_t size =
          std::min({header_.size(), like_->bytes.size(), headerBytes(like_->minor)});
      std::copy_n(like_->bytes.begin(), size, header_.begin());
      if (like_->minor == 0) std::fill_n(header_.begin() + Places::kEncoding - 2, 4, std::byte{0});
    } else {
      put(0, kLasMagic);
      put(Places::kSystem, kSystem);
      put(Places::kSoftware, kSoftware);
    }
    SURFEIT_RETURN_IF_ERROR(output_.append(header_));
    SURFEIT_RETURN_IF_ERROR(copyRecords());
    const std::vector<std::byte>& descriptors = encoder_->plan().descriptors;
    if (!descriptors.empty()) {
      SURFEIT_RETURN_IF_ERROR(
          appendRecord(kLasSpecUser, kLasExtraBytesRecord, "Extra Bytes Record", descriptors));
    }
    if (crs_) {
      SURFEIT_RETURN_IF_ERROR(appendRecord(kLasProjectionUser, crs_->number,
                                           "Coordinate reference system", crs_->data));
    }
    if (output_.size() > kMost32) {
      return Status::invalidArgument(
          fmt::format("{}: {} bytes before the points, expected at most {}", output_.path(),
                      output_.size(), kMost32));
    }
    data_offset_ = output_.size();
    return {};
  }

  Status encode(std::span<const std::byte> rows) {
    const std::size_t row_bytes = element_.row_bytes;
    const std::size_t block = std::max<std::size_t>(1, kBlockBytes / row_bytes);
    while (!rows.empty()) {
      const std::size_t count = std::min(block, rows.size() / row_bytes);
      records_.clear();
      SURFEIT_RETURN_IF_ERROR(
          encoder_->encode(rows.data(), row_bytes, count, output_.path(), records_));
      if (encoder_->count() > kMost32 && encoder_->plan().minor < 4) {
        return Status::invalidArgument(fmt::format(
            "{}: more than {} points, which LAS 1.{} cannot count: write .ply and convert that",
            output_.path(), kMost32, encoder_->plan().minor));
      }
      SURFEIT_RETURN_IF_ERROR(output_.append(records_));
      rows = rows.subspan(count * row_bytes);
    }
    return {};
  }

  // Appends the bytes of a record of `like`.
  Status copyRecord(const LasRecord& record) {
    std::vector<std::byte> block(kBlockBytes);
    for (std::uint64_t done = 0; done < record.bytes;) {
      const std::span part = std::span(block).first(
          static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), record.bytes - done)));
      SURFEIT_RETURN_IF_ERROR(like_input_->readAt(record.offset + done, part));
      SURFEIT_RETURN_IF_ERROR(output_.append(part));
      done += part.size();
    }
    return {};
  }

  // Those of `like` before its points, but for extra bytes, which are described anew.
  Status copyRecords() {
    if (!like_) return {};
    bool is_whole = true;
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<LasRecord> records,
                             findLasRecords(*like_input_, *like_, is_whole));
    for (const LasRecord& record : records) {
      if (record.user == kLasSpecUser && record.number == kLasExtraBytesRecord) continue;
      if (record.is_extended) {
        extended_.push_back(record);
        continue;
      }
      SURFEIT_RETURN_IF_ERROR(copyRecord(record));
      ++record_count_;
    }
    return {};
  }

  Status copyExtendedRecords() {
    std::uint64_t waveforms = 0;
    std::memcpy(&waveforms,
                like_ && like_->minor >= 3 && like_->bytes.size() >= kLasHeaderBytes13
                    ? &like_->bytes[Places::kWaveforms]
                    : reinterpret_cast<const std::byte*>(&waveforms),
                sizeof waveforms);
    extended_offset_ = extended_.empty() ? 0 : output_.size();
    for (const LasRecord& record : extended_) {
      if (record.offset == waveforms) waveforms_offset_ = output_.size();
      SURFEIT_RETURN_IF_ERROR(copyRecord(record));
    }
    return {};
  }

  Status appendRecord(std::string_view user, std::uint16_t number, std::string_view description,
                      std::span<const std::byte> data) {
    std::vector<std::byte> bytes(kLasRecordHeader);
    std::memcpy(&bytes[2], user.data(), user.size());
    const std::uint16_t words[] = {number, static_cast<std::uint16_t>(data.size())};
    std::memcpy(&bytes[18], words, sizeof words);
    std::memcpy(&bytes[22], description.data(), description.size());
    bytes.insert(bytes.end(), data.begin(), data.end());
    ++record_count_;
    return output_.append(bytes);
  }

  template <typename T>
  void put(std::size_t at, const T& value) {
    if constexpr (std::is_arithmetic_v<T>) {
      SURFEIT_CHECK(at + sizeof value <= header_.size());
      std::memcpy(&header_[at], &value, sizeof value);
    } else {
      std::memcpy(&header_[at], value.data(), value.size());
    }
  }

  Status completeHeader() {
    const LasPlan& plan = encoder_->plan();
    put(Places::kVersion, std::uint8_t{1});
    put(Places::kVersion + 1, static_cast<std::uint8_t>(plan.minor));
    put(Places::kHeaderSize, static_cast<std::uint16_t>(header_.size()));
    put(Places::kDataOffset, static_cast<std::uint32_t>(data_offset_));
    put(Places::kRecordCount, record_count_);
    put(Places::kPointFormat, static_cast<std::uint8_t>(plan.point_format));
    put(Places::kRecordBytes, static_cast<std::uint16_t>(plan.record_bytes));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      put(Places::kScale + 8 * axis, encoder_->grid().scale[axis]);
      put(Places::kOrigin + 8 * axis, encoder_->grid().origin[axis]);
      put(Places::kBounds + 16 * axis, encoder_->most()[axis]);
      put(Places::kBounds + 16 * axis + 8, encoder_->least()[axis]);
    }
    if (!like_ && crs_ && crs_->number == kLasWktRecord) {
      put(Places::kEncoding, kLasWellKnownText);
    }
    putCounts();
    if (plan.minor >= 3) put(Places::kWaveforms, waveforms_offset_);
    if (plan.minor >= 4) {
      put(Places::kExtendedOffset, extended_offset_);
      put(Places::kExtendedCount, static_cast<std::uint32_t>(extended_.size()));
    }
    return output_.writeAt(0, header_);
  }

  // Formats from 6 on, and what 32 bits cannot count, have only the later fields.
  void putCounts() {
    const LasPlan& plan = encoder_->plan();
    const auto& returns = encoder_->returns();
    const bool is_old = plan.point_format <= 5 && encoder_->count() <= kMost32;
    put(Places::kCount, static_cast<std::uint32_t>(is_old ? encoder_->count() : 0));
    for (std::size_t i = 0; i < 5; ++i) {
      put(Places::kReturns + 4 * i, static_cast<std::uint32_t>(is_old ? returns[i] : 0));
    }
    if (plan.minor < 4) return;
    put(Places::kCount64, encoder_->count());
    for (std::size_t i = 0; i < returns.size(); ++i) {
      put(Places::kReturns64 + 8 * i, returns[i]);
    }
  }

  ByteOutput output_;
  RowLayout element_, like_element_;
  std::vector<std::string> comments_, notes_;
  LasWish wish_;
  std::optional<LasHeader> like_;
  std::optional<ByteInput> like_input_;
  std::optional<LasCrsRecord> crs_;

  // Rows that wait, and what is found out meanwhile
  std::optional<TemporaryBytes> rows_;
  std::optional<LasPlan> doubts_;
  std::vector<bool> is_doubted_;
  std::array<double, 3> least_{}, most_{};

  // The file
  std::optional<LasEncoder> encoder_;
  std::vector<std::byte> header_, records_;
  std::vector<LasRecord> extended_;
  std::uint32_t record_count_ = 0;
  std::uint64_t data_offset_ = 0, extended_offset_ = 0, waveforms_offset_ = 0;
  bool is_finished_ = false;
};

}  // namespace

Result<std::unique_ptr<RowWriter>> createLas(const std::string& path,
                                             const RowWriterOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput output, ByteOutput::create(path, options.progress));
  auto writer = std::make_unique<LasWriter>(std::move(output), options);
  SURFEIT_RETURN_IF_ERROR(writer->open(options));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
