#include "cloud/houdini/bgeo_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "cloud/parts/lost_comments.h"
#include "cloud/parts/word_channels.h"
#include "core/assert.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

constexpr std::size_t kCountOffset = 9, kWordBytes = 4, kBlockBytes = 256 << 10;
constexpr std::uint64_t kMaxPoints = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kFloat = 0, kInteger = 1, kVector = 5;

constexpr ChannelName kNames[] = {
    {"position", "P"}, {"normal", "N"}, {"radius", "pscale"}, {"color", "Cd"}, {"velocity", "v"}};

void putWord(std::vector<std::byte>& bytes, std::uint32_t word, std::size_t size = kWordBytes) {
  for (std::size_t i = size; i > 0; --i) {
    bytes.push_back(static_cast<std::byte>(word >> (8 * (i - 1))));
  }
}

void putText(std::vector<std::byte>& bytes, std::string_view text) {
  for (const char letter : text) bytes.push_back(static_cast<std::byte>(letter));
}

class BgeoWriter final : public RowWriter {
 public:
  BgeoWriter(ByteOutput output, const RowWriterOptions& options) : output_(std::move(output)) {
    element_.name = "vertex";
    element_.properties = options.properties;
    packRow(element_);
  }

  Status open(const RowWriterOptions& options) {
    const std::vector<PlannedChannel> plan = planChannels(element_, kNames, notes_);
    const PlannedChannel* position = findChannel(plan, "P");
    if (position == nullptr) {
      return Status::invalidArgument(
          fmt::format("{}: no position, which BGEO files must have", output_.path()));
    }
    for (std::string& note : notesOfLostComments("BGEO", options.comments)) {
      notes_.push_back(std::move(note));
    }
    return writeHeader(plan, *position);
  }

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }

  Status writeRows(std::span<const std::byte> rows) override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    SURFEIT_CHECK(rows.size() % element_.row_bytes == 0);
    std::size_t left = rows.size() / element_.row_bytes;
    if (left > kMaxPoints - count_) {
      return Status::invalidArgument(fmt::format("{}: more than {} points, which BGEO cannot count",
                                                 output_.path(), kMaxPoints));
    }
    const std::size_t block = std::max<std::size_t>(1, kBlockBytes / record_bytes_);
    for (; left > 0; left -= std::min(left, block)) {
      const std::size_t step = std::min(left, block);
      encodeBlock(rows.data(), step);
      failure_ = output_.append(records_);
      SURFEIT_RETURN_IF_ERROR(failure_);
      rows = rows.subspan(step * element_.row_bytes);
      count_ += step;
    }
    return {};
  }

  Status finish() override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    // Nothing is between these marks of extra data
    constexpr std::byte kEnd[] = {std::byte{0x00}, std::byte{0xff}};
    SURFEIT_RETURN_IF_ERROR(output_.append(kEnd));
    std::vector<std::byte> count;
    putWord(count, static_cast<std::uint32_t>(count_));
    SURFEIT_RETURN_IF_ERROR(output_.writeAt(kCountOffset, count));
    return output_.commit();
  }

 private:
  Status writeHeader(std::span<const PlannedChannel> plan, const PlannedChannel& position) {
    std::vector<std::byte> bytes;
    putText(bytes, "BgeoV");
    const std::uint32_t words[] = {5, 0, 0, 0, 0, static_cast<std::uint32_t>(plan.size() - 1),
                                   0, 0, 0};
    for (const std::uint32_t word : words) putWord(bytes, word);

    addChannel(position);
    record_bytes_ += kWordBytes;  // w
    for (const PlannedChannel& planned : plan) {
      if (&planned == &position) continue;
      const std::size_t values = planned.channel.properties.size();
      const bool is_vector = values == 3 && planned.channel.kind != ChannelKind::kColor;
      putWord(bytes, static_cast<std::uint32_t>(planned.name.size()), 2);
      putText(bytes, planned.name);
      putWord(bytes, static_cast<std::uint32_t>(values), 2);
      putWord(bytes, static_cast<std::uint32_t>(!isReal(planned.channel) ? kInteger
                                                : is_vector              ? kVector
                                                                         : kFloat));
      for (std::size_t i = 0; i < values; ++i) putWord(bytes, 0);  // defaults
      addChannel(planned);
    }
    return output_.append(bytes);
  }

  void addChannel(const PlannedChannel& planned) {
    encoders_.push_back({wordEncoder(element_, planned.channel, notes_), record_bytes_});
    record_bytes_ += encoders_.back().encoder.bytes();
  }

  // Rows to records_, big-endian.
  void encodeBlock(const std::byte* rows, std::size_t count) {
    records_.assign(count * record_bytes_, std::byte{0});
    for (const PlacedEncoder& placed : encoders_) {
      placed.encoder.encode(rows, count, records_.data() + placed.offset, record_bytes_);
    }
    const float w = 1;
    for (std::size_t i = 0; i < count; ++i) {
      std::memcpy(records_.data() + i * record_bytes_ + 3 * kWordBytes, &w, kWordBytes);
    }
    for (std::size_t i = 0; i < records_.size(); i += kWordBytes) {
      std::uint32_t word;
      std::memcpy(&word, &records_[i], kWordBytes);
      word = __builtin_bswap32(word);
      std::memcpy(&records_[i], &word, kWordBytes);
    }
  }

  struct PlacedEncoder {
    ChannelEncoder encoder;
    std::size_t offset = 0;
  };

  ByteOutput output_;
  RowLayout element_;
  std::vector<std::string> notes_;
  std::vector<PlacedEncoder> encoders_;
  std::size_t record_bytes_ = 0;
  std::uint64_t count_ = 0;
  std::vector<std::byte> records_;
  Status failure_;
};

}  // namespace

Result<std::unique_ptr<RowWriter>> createBgeo(const std::string& path,
                                              const RowWriterOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput output, ByteOutput::create(path, options.progress));
  auto writer = std::make_unique<BgeoWriter>(std::move(output), options);
  SURFEIT_RETURN_IF_ERROR(writer->open(options));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
