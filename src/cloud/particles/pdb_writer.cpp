#include "cloud/particles/pdb_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "cloud/parts/lost_comments.h"
#include "cloud/parts/spooled_input.h"
#include "cloud/parts/word_channels.h"
#include "core/assert.h"
#include "storage/byte_coding.h"
#include "storage/byte_output.h"
#include "storage/file.h"
#include "storage/temporary_bytes.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMaxParticles = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kVector = 1, kReal = 2, kInteger = 3;
// Rows of a block of the temporary file: a column of one of them is read at once
constexpr std::size_t kBlockRows = 16 << 10;

constexpr ChannelName kNames[] = {{"color", "Cd"}};

struct PdbColumn {
  std::string name;
  std::uint32_t type = kReal;
  ChannelEncoder encoder;
  std::size_t offset = 0;  // bytes of the columns before it, per row
};

class PdbWriter final : public RowWriter {
 public:
  PdbWriter(ByteOutput output, TemporaryBytes blocks, const RowWriterOptions& options)
      : output_(std::move(output)), blocks_(std::move(blocks)) {
    element_.name = "vertex";
    element_.properties = options.properties;
    packRow(element_);
  }

  std::uint64_t temporaryBytes() const override { return blocks_.size(); }

  Status open(const RowWriterOptions& options) {
    const std::vector<PlannedChannel> plan = planChannels(element_, kNames, notes_);
    if (findChannel(plan, "position") == nullptr) {
      return Status::invalidArgument(
          fmt::format("{}: no position, which PDB files must have", output_.path()));
    }
    for (std::string& note : notesOfLostComments("PDB", options.comments)) {
      notes_.push_back(std::move(note));
    }
    for (const PlannedChannel& planned : plan) {
      if (planned.name != "position") continue;
      addColumn(planned);  // the first, as all programs write it
    }
    for (const PlannedChannel& planned : plan) {
      if (planned.name != "position") addColumn(planned);
    }
    return {};
  }

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }

  Status writeRows(std::span<const std::byte> rows) override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    SURFEIT_CHECK(rows.size() % element_.row_bytes == 0);
    std::size_t left = rows.size() / element_.row_bytes;
    if (left > kMaxParticles - count_) {
      return Status::invalidArgument(fmt::format(
          "{}: more than {} particles, which PDB cannot count", output_.path(), kMaxParticles));
    }
    while (left > 0) {
      const std::size_t step = std::min(left, kBlockRows - open_rows_);
      block_.resize(kBlockRows * bytes_per_row_);
      for (const PdbColumn& column : columns_) {
        const std::size_t bytes = column.encoder.bytes();
        column.encoder.encode(rows.data(), step,
                              block_.data() + column.offset * kBlockRows + open_rows_ * bytes,
                              bytes);
      }
      open_rows_ += step;
      count_ += step;
      left -= step;
      rows = rows.subspan(step * element_.row_bytes);
      if (open_rows_ == kBlockRows) failure_ = endBlock();
      SURFEIT_RETURN_IF_ERROR(failure_);
    }
    return {};
  }

  Status finish() override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    if (open_rows_ > 0) SURFEIT_RETURN_IF_ERROR(endBlock());
    SURFEIT_RETURN_IF_ERROR(blocks_.flush());
    SURFEIT_RETURN_IF_ERROR(writeHeader());
    for (const PdbColumn& column : columns_) SURFEIT_RETURN_IF_ERROR(writeColumn(column));
    return output_.commit();
  }

 private:
  void addColumn(const PlannedChannel& planned) {
    const RowChannel& channel = planned.channel;
    const bool is_real = isReal(channel), is_vector = is_real && channel.properties.size() == 3;
    columns_.push_back({planned.name,
                        is_vector ? kVector
                        : is_real ? kReal
                                  : kInteger,
                        wordEncoder(element_, channel, notes_), bytes_per_row_});
    bytes_per_row_ += columns_.back().encoder.bytes();
  }

  // A block is a whole one, whatever it holds, so that columns are found by arithmetic.
  Status endBlock() {
    open_rows_ = 0;
    return blocks_.append(block_);
  }

  Status writeHeader() {
    std::vector<std::byte> bytes;
    ByteWriter writer(bytes);
    writer.put(std::uint32_t{670});
    writer.put(std::uint32_t{1});
    writer.put(1.0f);  // version
    writer.put(0.0f);  // time
    writer.put(static_cast<std::uint32_t>(count_));
    writer.put(static_cast<std::uint32_t>(columns_.size()));
    writer.putBytes(std::array<std::byte, 36>{});
    return output_.append(bytes);
  }

  Status writeColumn(const PdbColumn& column) {
    const auto value_bytes = static_cast<std::uint32_t>(column.encoder.bytes());
    std::vector<std::byte> bytes;
    ByteWriter writer(bytes);
    writer.put(std::uint16_t{0});
    writer.put(std::uint16_t{1});
    writer.putBytes(std::array<std::byte, 6>{});
    writer.put(column.type);
    writer.put(std::uint32_t{0});
    writer.put(std::uint32_t{0});  // the first particle and the last
    writer.put(static_cast<std::uint32_t>(count_ - std::min<std::uint64_t>(count_, 1)));
    writer.putBytes(std::array<std::byte, 16>{});
    writer.putBytes(std::as_bytes(std::span(column.name.c_str(), column.name.size() + 1)));
    writer.put(column.type);
    writer.put(value_bytes);
    writer.put(static_cast<std::uint32_t>(count_));
    writer.put(std::uint32_t{1});  // blocks
    writer.put(std::uint32_t{0});
    SURFEIT_RETURN_IF_ERROR(output_.append(bytes));

    for (std::uint64_t begin = 0; begin < count_; begin += kBlockRows) {
      const std::size_t rows =
          static_cast<std::size_t>(std::min<std::uint64_t>(kBlockRows, count_ - begin));
      block_.resize(rows * value_bytes);
      SURFEIT_RETURN_IF_ERROR(
          blocks_.readAt(begin * bytes_per_row_ + column.offset * kBlockRows, block_));
      SURFEIT_RETURN_IF_ERROR(output_.append(block_));
    }
    return {};
  }

  ByteOutput output_;
  TemporaryBytes blocks_;
  RowLayout element_;
  std::vector<std::string> notes_;
  std::vector<PdbColumn> columns_;
  std::size_t bytes_per_row_ = 0;
  std::vector<std::byte> block_;
  std::size_t open_rows_ = 0;  // in block_
  std::uint64_t count_ = 0;
  Status failure_;
};

}  // namespace

Result<std::unique_ptr<RowWriter>> createPdb(const std::string& path,
                                             const RowWriterOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput output, ByteOutput::create(path, options.progress));
  SURFEIT_ASSIGN_OR_RETURN(TemporaryBytes blocks, TemporaryBytes::create(spoolDirectory()));
  auto writer = std::make_unique<PdbWriter>(std::move(output), std::move(blocks), options);
  SURFEIT_RETURN_IF_ERROR(writer->open(options));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
