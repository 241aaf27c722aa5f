#include "cloud/particles/prt_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <utility>

#include "cloud/particles/prt_channels.h"
#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/zlib_stream.h"
#include "storage/byte_coding.h"
#include "storage/byte_input.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic("\xC0PRT\r\n\x1A\n", 8);
constexpr std::string_view kSignature = "Extensible Particle Format";
constexpr std::size_t kHeaderBytes = 56;
constexpr std::size_t kMaxHeaderBytes = 1 << 20;
constexpr std::size_t kMaxChannels = 1024, kMinChannelBytes = 44, kMaxChannelBytes = 1024;
constexpr std::size_t kBufferBytes = 256 << 10;

// Types by their number in the file.
constexpr std::array<StoredType, 11> kTypes{
    StoredType::kInt16,   StoredType::kInt32,   StoredType::kInt64,  StoredType::kFloat16,
    StoredType::kFloat32, StoredType::kFloat64, StoredType::kUint16, StoredType::kUint32,
    StoredType::kUint64,  StoredType::kInt8,    StoredType::kUint8};

// Up to the first zero.
std::string textOf(Bytes bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return std::string(text.substr(0, text.find('\0')));
}

class PrtReader final : public CountedRowReader {
 public:
  explicit PrtReader(ByteInput input) : input_(std::move(input)) { path_ = input_.path(); }

  Status open(const RowReaderOptions& options) {
    std::size_t channels_at = 0;
    std::int64_t count = 0;
    SURFEIT_RETURN_IF_ERROR(readHeader(channels_at, count));
    SURFEIT_RETURN_IF_ERROR(readChannels(channels_at, options));
    SURFEIT_ASSIGN_OR_RETURN(ZlibStream stream, ZlibStream::open(input_, data_begin_));
    stream_.emplace(std::move(stream));
    element_.name = "vertex";
    if (count < 0) return countRecords();
    element_.count = static_cast<std::uint64_t>(count);
    return checkCount();
  }

 private:
  Status readHeader(std::size_t& channels_at, std::int64_t& count) {
    std::array<std::byte, kHeaderBytes> bytes;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(0, bytes));
    ByteReader reader(bytes);
    reader.take(kMagic.size());
    const auto header_bytes = reader.get<std::int32_t>();
    const std::string signature = textOf(reader.take(32));
    const auto version = reader.get<std::int32_t>();
    count = reader.get<std::int64_t>();

    if (header_bytes < std::int32_t{kHeaderBytes} ||
        header_bytes > static_cast<std::int32_t>(kMaxHeaderBytes)) {
      return damagedAt(8, fmt::format("header of {} bytes, expected {} to {}", header_bytes,
                                      kHeaderBytes, kMaxHeaderBytes));
    }
    if (signature != kSignature) {
      return damagedAt(12,
                       fmt::format("found {}, expected \"{}\"", quoteText(signature), kSignature));
    }
    if (version != 1 && version != 2) {
      return damagedAt(44, fmt::format("version {}, expected 1 or 2", version));
    }
    if (count < -1) {
      return damagedAt(48, fmt::format("{} particles, expected none or more, or -1", count));
    }
    format_name_ = fmt::format("PRT 1.{}", version - 1);
    channels_at = static_cast<std::size_t>(header_bytes);
    return version == 2 ? readMetadata(channels_at) : Status();
  }

  // Chunks between the fixed header and `end`; texts become comments.
  Status readMetadata(std::size_t end) {
    std::vector<std::byte> bytes(end - kHeaderBytes);
    SURFEIT_RETURN_IF_ERROR(input_.readAt(kHeaderBytes, bytes));
    ByteReader reader(bytes);
    while (reader.remaining() > 0) {
      const std::size_t at = end - reader.remaining();
      const std::string type = textOf(reader.take(4));
      const auto length = reader.get<std::int32_t>();
      if (!reader.ok() || length < 0 || static_cast<std::size_t>(length) > reader.remaining()) {
        return damagedAt(at, fmt::format("metadata of {} bytes, expected at most the {} that are "
                                         "left of the header",
                                         length, reader.remaining()));
      }
      if (type == "Stop") return {};
      const Bytes data = reader.take(static_cast<std::size_t>(length));
      if (type == "Meta") addComment(data);
    }
    if (end == kHeaderBytes) return {};
    return damagedAt(end, "metadata without the chunk Stop");
  }

  // [ channel, a text | name, a text | type i32 | value ]; only texts (type -1) are kept.
  void addComment(Bytes data) {
    const std::string channel = textOf(data);
    if (channel.size() + 1 > data.size()) return;
    data = data.subspan(channel.size() + 1);
    const std::string name = textOf(data);
    if (name.size() + 5 > data.size()) return;
    ByteReader reader(data.subspan(name.size() + 1));
    if (reader.get<std::int32_t>() != -1) return;
    const std::string value = textOf(data.subspan(name.size() + 5));
    comments_.push_back(channel.empty() ? fmt::format("{}: {}", name, value)
                                        : fmt::format("{}.{}: {}", channel, name, value));
  }

  Status readChannels(std::size_t at, const RowReaderOptions& options) {
    std::array<std::byte, 12> counts;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(at, counts));
    ByteReader reader(counts);
    const auto reserved = reader.get<std::int32_t>();
    const auto channels = reader.get<std::int32_t>();
    const auto channel_bytes = reader.get<std::int32_t>();
    if (reserved != 4) return damagedAt(at, fmt::format("found {}, expected 4", reserved));
    if (channels < 1 || channels > std::int32_t{kMaxChannels}) {
      return damagedAt(at + 4,
                       fmt::format("{} channels, expected 1 to {}", channels, kMaxChannels));
    }
    if (channel_bytes < std::int32_t{kMinChannelBytes} ||
        channel_bytes > std::int32_t{kMaxChannelBytes}) {
      return damagedAt(at + 8, fmt::format("{} bytes per channel, expected {} to {}", channel_bytes,
                                           kMinChannelBytes, kMaxChannelBytes));
    }

    // What later versions append to a channel is passed over
    const auto stride = static_cast<std::size_t>(channel_bytes);
    std::vector<std::byte> bytes(stride * static_cast<std::size_t>(channels));
    SURFEIT_RETURN_IF_ERROR(input_.readAt(at + 12, bytes));
    std::vector<PrtChannel> list;
    for (std::size_t begin = 0; begin < bytes.size(); begin += stride) {
      SURFEIT_RETURN_IF_ERROR(
          parseChannel(at + 12 + begin, Bytes(bytes).subspan(begin, stride), list));
    }
    data_begin_ = at + 12 + bytes.size();
    SURFEIT_ASSIGN_OR_RETURN(layout_,
                             PrtLayout::create(list, options.channels, path_, element_, notes_));
    return {};
  }

  Status parseChannel(std::size_t at, Bytes bytes, std::vector<PrtChannel>& list) const {
    ByteReader reader(bytes);
    PrtChannel channel;
    channel.name = textOf(reader.take(32));
    const auto type = reader.get<std::int32_t>();
    const auto arity = reader.get<std::int32_t>();
    const auto offset = reader.get<std::int32_t>();
    if (channel.name.empty()) return damagedAt(at, "a channel without a name");
    if (type < 0 || type >= static_cast<std::int32_t>(kTypes.size())) {
      return damagedAt(at + 32, fmt::format("channel {} of type {}, expected 0 to {}",
                                            quoteText(channel.name), type, kTypes.size() - 1));
    }
    if (arity < 1 || offset < 0) {
      return damagedAt(at + 36, fmt::format("channel {} has {} values at {} of a record",
                                            quoteText(channel.name), arity, offset));
    }
    channel.type = kTypes[static_cast<std::size_t>(type)];
    channel.arity = static_cast<std::size_t>(arity);
    channel.offset = static_cast<std::size_t>(offset);
    list.push_back(std::move(channel));
    return {};
  }

  // What the bytes of the file can code bounds the count.
  Status checkCount() const {
    const std::optional<std::uint64_t> size = input_.size();
    if (!size) return {};
    const std::uint64_t packed = *size - std::min(*size, data_begin_);
    const std::uint64_t most = packed * kMaxDeflateRatio / layout_->recordBytes();
    if (element_.count <= most) return {};
    return damagedAt(48, fmt::format("{} particles of {} bytes, but {} bytes of zlib data code at "
                                     "most {}",
                                     element_.count, layout_->recordBytes(), packed, most));
  }

  Status countRecords() {
    std::vector<std::byte> bytes(kBufferBytes);
    std::uint64_t size = 0;
    while (true) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, stream_->read(bytes));
      if (got == 0) break;
      size += got;
    }
    element_.count = size / layout_->recordBytes();
    if (size % layout_->recordBytes() != 0) {
      return damagedAt(data_begin_, fmt::format("{} bytes of particles, expected a multiple of {}",
                                                size, layout_->recordBytes()));
    }
    notes_.push_back("the file does not state its count: it was counted");
    return stream_->rewind();
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    const std::size_t record_bytes = layout_->recordBytes();
    const std::size_t block = std::max<std::size_t>(1, kBufferBytes / record_bytes);
    records_.resize(std::min(block, count) * record_bytes);
    for (std::size_t done = 0; done < count;) {
      const std::size_t step = std::min(count - done, block);
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                               stream_->read({records_.data(), step * record_bytes}));
      if (got < step * record_bytes) {
        return damagedRow(row() + done + got / record_bytes,
                          fmt::format("the particles end here, expected {}", element_.count));
      }
      layout_->decode(records_.data(), step, rows + done * element_.row_bytes);
      done += step;
    }
    return {};
  }

  Status moveTo(std::uint64_t) override { return stream_->rewind(); }

  Status checkEnd() override {
    std::byte more;
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, stream_->read({&more, 1}));
    if (got > 0) {
      return damagedRow(element_.count, "more data, expected the end of particles");
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t behind,
                             input_.readSome(stream_->offset(), {&more, 1}));
    if (behind > 0) {
      return damagedAt(
          stream_->offset(),
          fmt::format("bytes behind the particles, expected the end of the file: if "
                      "files were joined, make one of each; head -c {} FILE (unpacked, "
                      "if it is compressed) writes the file without them",
                      stream_->offset()));
    }
    return input_.checkUnchanged();
  }

  ByteInput input_;
  std::uint64_t data_begin_ = 0;
  std::optional<PrtLayout> layout_;
  std::optional<ZlibStream> stream_;
  std::vector<std::byte> records_;
};

}  // namespace

bool recognisesPrt(std::string_view first_bytes) { return first_bytes.starts_with(kMagic); }

Result<std::unique_ptr<RowReader>> openPrt(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, Access::kCached));
  auto reader = std::make_unique<PrtReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
