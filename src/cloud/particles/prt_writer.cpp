#include "cloud/particles/prt_writer.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "cloud/parts/channel_encoder.h"
#include "cloud/parts/lost_comments.h"
#include "core/assert.h"
#include "storage/byte_coding.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic("\xC0PRT\r\n\x1A\n", 8);
constexpr std::string_view kSignature = "Extensible Particle Format";
constexpr std::size_t kHeaderBytes = 56, kCountOffset = 48;
constexpr std::size_t kNameBytes = 32;  // with its zero
constexpr std::size_t kBufferBytes = 256 << 10;

constexpr ChannelName kNames[] = {
    {"position", "Position"}, {"normal", "Normal"},   {"radius", "Radius"}, {"color", "Color"},
    {"velocity", "Velocity"}, {"density", "Density"}, {"id", "ID"},
};

// The number of a type in the file.
std::int32_t numberOf(ValueType type) {
  constexpr std::array<std::int32_t, 8> kNumbers{9, 10, 0, 6, 1, 7, 4, 5};
  return kNumbers[static_cast<std::size_t>(type)];
}

class PrtWriter final : public RowWriter {
 public:
  PrtWriter(ByteOutput output, const RowWriterOptions& options) : output_(std::move(output)) {
    element_.name = "vertex";
    element_.properties = options.properties;
    packRow(element_);
  }
  ~PrtWriter() override {
    if (is_ready_) deflateEnd(&zlib_);
  }

  Status open(const RowWriterOptions& options) {
    const std::vector<PlannedChannel> plan = planChannels(element_, kNames, notes_);
    if (findChannel(plan, "Position") == nullptr) {
      return Status::invalidArgument(
          fmt::format("{}: no position, which PRT files must have", output_.path()));
    }
    for (std::string& note : notesOfLostComments("PRT", options.comments)) {
      notes_.push_back(std::move(note));
    }
    SURFEIT_RETURN_IF_ERROR(writeHeader(plan));
    is_ready_ = deflateInit(&zlib_, Z_DEFAULT_COMPRESSION) == Z_OK;
    return is_ready_ ? Status() : Status::failed(output_.path() + ": no memory for zlib");
  }

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }

  Status writeRows(std::span<const std::byte> rows) override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    SURFEIT_CHECK(rows.size() % element_.row_bytes == 0);
    const std::size_t block = std::max<std::size_t>(1, kBufferBytes / record_bytes_);
    for (std::size_t left = rows.size() / element_.row_bytes; left > 0;) {
      const std::size_t step = std::min(left, block);
      records_.resize(step * record_bytes_);
      std::size_t offset = 0;
      for (const ChannelEncoder& encoder : encoders_) {
        encoder.encode(rows.data(), step, records_.data() + offset, record_bytes_);
        offset += encoder.bytes();
      }
      failure_ = deflateBytes(records_, Z_NO_FLUSH);
      SURFEIT_RETURN_IF_ERROR(failure_);
      rows = rows.subspan(step * element_.row_bytes);
      count_ += step;
      left -= step;
    }
    return {};
  }

  Status finish() override {
    SURFEIT_RETURN_IF_ERROR(failure_);
    SURFEIT_RETURN_IF_ERROR(deflateBytes({}, Z_FINISH));
    SURFEIT_RETURN_IF_ERROR(output_.writeAt(kCountOffset, std::as_bytes(std::span(&count_, 1))));
    return output_.commit();
  }

 private:
  static void putText(ByteWriter& writer, std::string_view text, std::size_t bytes) {
    std::vector<std::byte> field(bytes);
    std::memcpy(field.data(), text.data(), text.size());
    writer.putBytes(field);
  }

  Status writeHeader(std::span<const PlannedChannel> plan) {
    std::vector<std::byte> bytes;
    ByteWriter writer(bytes);
    putText(writer, kMagic, kMagic.size());
    writer.put(std::int32_t{kHeaderBytes});
    putText(writer, kSignature, 32);
    writer.put(std::int32_t{1});   // version
    writer.put(std::int64_t{-1});  // the count, until it is known
    writer.put(std::int32_t{4});
    writer.put(static_cast<std::int32_t>(plan.size()));
    writer.put(std::int32_t{44});
    for (const PlannedChannel& planned : plan) {
      if (planned.name.size() >= kNameBytes) {
        return Status::invalidArgument(
            fmt::format("{}: channel {} has a name of {} characters, PRT has at most {}",
                        output_.path(), planned.name, planned.name.size(), kNameBytes - 1));
      }
      const bool is_coded = isCodedColor(planned.channel);
      const ValueType type = is_coded ? ValueType::kFloat32 : planned.channel.type;
      if (is_coded) {
        notes_.push_back("integers that code sRGB become linear float32: " + planned.channel.name);
      }
      encoders_.emplace_back(element_, planned.channel, type);
      putText(writer, planned.name, kNameBytes);
      writer.put(numberOf(type));
      writer.put(static_cast<std::int32_t>(encoders_.back().components()));
      writer.put(static_cast<std::int32_t>(record_bytes_));
      record_bytes_ += encoders_.back().bytes();
    }
    return output_.append(bytes);
  }

  // Compresses `bytes`, a block at most; all of it is out after Z_FINISH.
  Status deflateBytes(Bytes bytes, int flush) {
    zlib_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
    zlib_.avail_in = static_cast<uInt>(bytes.size());
    int result = Z_OK;
    do {
      zlib_.next_out = reinterpret_cast<Bytef*>(packed_.data());
      zlib_.avail_out = static_cast<uInt>(packed_.size());
      result = deflate(&zlib_, flush);
      SURFEIT_CHECK(result != Z_STREAM_ERROR);
      const std::size_t size = packed_.size() - zlib_.avail_out;
      if (size > 0) SURFEIT_RETURN_IF_ERROR(output_.append(Bytes(packed_).first(size)));
    } while (flush == Z_FINISH ? result != Z_STREAM_END : zlib_.avail_out == 0);
    return {};
  }

  ByteOutput output_;
  RowLayout element_;
  std::vector<std::string> notes_;
  std::vector<ChannelEncoder> encoders_;
  std::size_t record_bytes_ = 0;
  std::int64_t count_ = 0;
  std::vector<std::byte> records_, packed_ = std::vector<std::byte>(kBufferBytes);
  z_stream zlib_{};
  bool is_ready_ = false;
  Status failure_;
};

}  // namespace

Result<std::unique_ptr<RowWriter>> createPrt(const std::string& path,
                                             const RowWriterOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput output, ByteOutput::create(path, options.progress));
  auto writer = std::make_unique<PrtWriter>(std::move(output), options);
  SURFEIT_RETURN_IF_ERROR(writer->open(options));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
