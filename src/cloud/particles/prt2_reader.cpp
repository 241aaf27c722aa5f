#include "cloud/particles/prt2_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <utility>

#include "cloud/particles/prt_channels.h"
#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/zlib_stream.h"
#include "storage/byte_coding.h"
#include "storage/byte_input.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic("\xC0PRT2\r\n\x1A", 8);
constexpr std::uint32_t kRevision = 3;
constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 12, kParticleHeaderBytes = 8;
// Bounds of what is read into memory; real files stay far below
constexpr std::uint64_t kMaxChannelsBytes = 64 << 10, kMaxMetadataBytes = 4 << 10;
constexpr std::uint64_t kMaxStreamHeaderBytes = 1 << 10;
constexpr std::size_t kMaxFileChunks = 1 << 16;

std::uint64_t takeVarint(ByteReader& reader) {
  std::uint64_t value = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const auto byte = reader.get<std::uint8_t>();
    value |= std::uint64_t{byte & 0x7Fu} << shift;
    if ((byte & 0x80u) == 0) return value;
  }
  reader.take(reader.remaining() + 1);  // longer than any number: the reader turns bad
  return 0;
}

std::string takeText(ByteReader& reader) {
  const std::uint64_t size = takeVarint(reader);
  const Bytes bytes =
      reader.take(static_cast<std::size_t>(std::min<std::uint64_t>(size, reader.remaining() + 1)));
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// "float32", "3 * float32"
bool parseType(std::string_view text, StoredType& type, std::size_t& arity) {
  arity = 1;
  const std::size_t star = text.find('*');
  if (star != std::string_view::npos) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + star, arity);
    if (error != std::errc() || arity < 1 || arity > kMaxPrtArity) return false;
    if (std::string_view(end, text.data() + star).find_first_not_of(' ') != text.npos) return false;
    text.remove_prefix(star + 1);
  }
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  for (int i = 0; i <= static_cast<int>(StoredType::kFloat64); ++i) {
    type = static_cast<StoredType>(i);
    if (text == storedTypeName(type)) return true;
  }
  return false;
}

// Records whose bytes stand by place in the record, then by record, back as records.
void untranspose(const std::byte* bytes, std::size_t record_bytes, std::size_t count,
                 std::byte* records) {
  // Blocks of records that stay in the first cache, while all their bytes are put in
  constexpr std::size_t kBlock = 256;
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t end = std::min(begin + kBlock, count);
    for (std::size_t place = 0; place < record_bytes; ++place) {
      const std::byte* from = bytes + place * count;
      for (std::size_t i = begin; i < end; ++i) records[i * record_bytes + place] = from[i];
    }
  }
}

// A chunk Part.
struct Stream {
  bool is_found = false;
  bool is_transposed = false, is_deflated = false;
  std::uint64_t begin = 0, end = 0;  // of its particle chunks
};

class Prt2Reader final : public CountedRowReader {
 public:
  explicit Prt2Reader(ByteInput input) : input_(std::move(input)) { path_ = input_.path(); }

  Status open(const RowReaderOptions& options) {
    element_.name = "vertex";
    std::array<std::byte, kHeaderBytes> bytes;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(0, bytes));
    ByteReader reader(Bytes(bytes).subspan(kMagic.size()));
    const auto revision = reader.get<std::uint32_t>();
    if (revision != kRevision) {
      return damagedAt(kMagic.size(), fmt::format("revision {}, expected {}", revision, kRevision));
    }
    format_name_ = "PRT 2";
    SURFEIT_RETURN_IF_ERROR(readFileChunks(options));
    if (!stream_.is_found) {
      return Status::corruption(
          fmt::format("{}: no particle stream {}", path_, quoteText(options.part)));
    }
    return checkCount();
  }

 private:
  Status readFileChunks(const RowReaderOptions& options) {
    std::uint64_t at = kHeaderBytes;
    for (std::size_t chunks = 0;; ++chunks) {
      // Its name and length; files end between chunks
      std::array<std::byte, kChunkHeaderBytes> bytes;
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input_.readSome(at, bytes));
      if (got == 0 && chunks > 0) return {};
      if (got < bytes.size() || chunks == kMaxFileChunks) {
        return damagedAt(at, got < bytes.size()
                                 ? std::string("file ends early, expected a chunk")
                                 : fmt::format("more than {} chunks", kMaxFileChunks));
      }
      ByteReader reader(bytes);
      const Bytes name_bytes = reader.take(4);
      const std::string name(reinterpret_cast<const char*>(name_bytes.data()), 4);
      const auto length = reader.get<std::uint64_t>();
      at += kChunkHeaderBytes;
      if (!fits(at, length)) {
        return damagedAt(at - 8, fmt::format("chunk {} of {} bytes, more than the file has",
                                             quoteText(name), length));
      }

      // What it holds
      if ((chunks == 0) != (name == "Chan")) {
        return damagedAt(
            at - kChunkHeaderBytes,
            fmt::format("chunk {}, expected Chan as the first and only there", quoteText(name)));
      }
      if (name == "Chan") SURFEIT_RETURN_IF_ERROR(readChannels(at, length, options));
      if (name == "Meta") SURFEIT_RETURN_IF_ERROR(readMetadata(at, length));
      if (name == "Part") SURFEIT_RETURN_IF_ERROR(readStream(at, length, options));
      if (name == "PrtO") {
        return Status::corruption(
            path_ +
            ": its positions are relative to particle chunks (PrtO), which is not read: "
            "save it as PRT 1, or without position offsets");
      }
      at += length;
    }
  }

  // Whether the file can hold `length` bytes at `at`, as far as its size is known.
  bool fits(std::uint64_t at, std::uint64_t length) const {
    const std::optional<std::uint64_t> size = input_.size();
    if (!size) return length < std::uint64_t{1} << 62;
    return at <= *size && length <= *size - at;
  }

  Status readChunk(std::uint64_t at, std::uint64_t length, std::vector<std::byte>& bytes) {
    bytes.resize(static_cast<std::size_t>(length));
    return input_.readAt(at, bytes);
  }

  Status readChannels(std::uint64_t at, std::uint64_t length, const RowReaderOptions& options) {
    if (length > kMaxChannelsBytes) {
      return damagedAt(at, fmt::format("chunk Chan of {} bytes, expected at most {}", length,
                                       kMaxChannelsBytes));
    }
    std::vector<std::byte> bytes;
    SURFEIT_RETURN_IF_ERROR(readChunk(at, length, bytes));
    ByteReader reader(bytes);
    const std::uint64_t count = takeVarint(reader);
    std::vector<PrtChannel> channels;
    std::size_t record_bytes = 0;
    for (std::uint64_t i = 0; i < count && reader.ok(); ++i) {
      PrtChannel channel;
      channel.name = takeText(reader);
      const std::string type = takeText(reader);
      const std::uint64_t size = takeVarint(reader);
      if (!reader.ok()) break;
      if (!parseType(type, channel.type, channel.arity) ||
          size != channel.arity * storedBytes(channel.type)) {
        return damagedAt(at, fmt::format("channel {} of type {} takes {} bytes, expected numbers",
                                         quoteText(channel.name), quoteText(type), size));
      }
      channel.offset = record_bytes;
      record_bytes += static_cast<std::size_t>(size);
      channels.push_back(std::move(channel));
    }
    if (!reader.ok() || reader.remaining() > 0) {
      return damagedAt(
          at, fmt::format("chunk Chan of {} bytes does not hold {} channels", length, count));
    }
    SURFEIT_ASSIGN_OR_RETURN(
        layout_, PrtLayout::create(channels, options.channels, path_, element_, notes_));
    return {};
  }

  // Texts become comments.
  Status readMetadata(std::uint64_t at, std::uint64_t length) {
    if (length > kMaxMetadataBytes) return {};
    std::vector<std::byte> bytes;
    SURFEIT_RETURN_IF_ERROR(readChunk(at, length, bytes));
    ByteReader reader(bytes);
    const std::string name = takeText(reader);
    const std::string type = takeText(reader);
    if (type != "string") return {};
    const std::string value = takeText(reader);
    if (reader.ok()) comments_.push_back(name + ": " + value);
    return {};
  }

  Status readStream(std::uint64_t at, std::uint64_t length, const RowReaderOptions& options) {
    std::vector<std::byte> bytes;
    SURFEIT_RETURN_IF_ERROR(readChunk(at, std::min(length, kMaxStreamHeaderBytes), bytes));
    ByteReader reader(bytes);
    const std::string name = takeText(reader);
    const std::string compression = takeText(reader);
    const auto particles = reader.get<std::int64_t>();
    const auto chunks = reader.get<std::int64_t>();
    if (!reader.ok() || particles < 0 || chunks < 0) {
      return damagedAt(at, fmt::format("stream {} of {} particles in {} chunks: it was not "
                                       "completed",
                                       quoteText(name), particles, chunks));
    }
    if (name != options.part) {
      notes_.push_back(
          fmt::format("stream {} with {} particles is not read", quoteText(name), particles));
      return {};
    }
    if (stream_.is_found) return damagedAt(at, "a second stream " + quoteText(name));
    stream_.is_transposed = compression.starts_with("transpose");
    stream_.is_deflated = compression.ends_with("zlib");
    if (compression != "uncompressed" && compression != "zlib" && compression != "transpose" &&
        compression != "transpose-zlib") {
      return damagedAt(at, fmt::format("particles are compressed with {}, which is not read: save "
                                       "it with zlib, or as PRT 1",
                                       quoteText(compression)));
    }
    element_.count = static_cast<std::uint64_t>(particles);
    stream_.begin = at + (bytes.size() - reader.remaining());
    stream_.end = at + length;
    stream_.is_found = true;
    return moveTo(0);
  }

  // What its bytes can code bounds the count.
  Status checkCount() const {
    const std::uint64_t ratio = stream_.is_deflated ? kMaxDeflateRatio : 1;
    const std::uint64_t bytes = stream_.end - stream_.begin;
    const std::uint64_t most =
        std::min(bytes, ~std::uint64_t{0} / kMaxDeflateRatio) * ratio / layout_->recordBytes();
    if (element_.count <= most) return {};
    return damagedAt(stream_.begin - 16,
                     fmt::format("{} particles of {} bytes, but {} bytes hold at most {}",
                                 element_.count, layout_->recordBytes(), bytes, most));
  }

  // Decodes the next particle chunk to records_.
  Status readParticleChunk(std::uint64_t row) {
    std::array<std::byte, kParticleHeaderBytes> header;
    const std::uint64_t at = next_chunk_;
    if (stream_.end - at < header.size()) {
      return damagedRow(row, fmt::format("its stream ends at byte {}, expected {} particles",
                                         stream_.end, element_.count));
    }
    SURFEIT_RETURN_IF_ERROR(input_.readAt(at, header));
    ByteReader reader(header);
    const auto length = reader.get<std::uint32_t>();
    const auto count = reader.get<std::uint32_t>();
    const std::uint64_t bytes = std::uint64_t{count} * layout_->recordBytes();
    const bool is_plausible =
        stream_.is_deflated ? bytes <= length * kMaxDeflateRatio : bytes == length;
    if (length > stream_.end - at - header.size() || bytes > kMaxPrt2ChunkBytes ||
        length > kMaxPrt2ChunkBytes || !is_plausible || count > element_.count - row) {
      return damagedAt(at, fmt::format("particle chunk of {} bytes with {} particles of {} bytes, "
                                       "expected at most {} particles, {} bytes decoded and the "
                                       "{} bytes left of its stream",
                                       length, count, layout_->recordBytes(), element_.count - row,
                                       kMaxPrt2ChunkBytes, stream_.end - at - header.size()));
    }
    next_chunk_ = at + header.size() + length;
    chunk_records_ = count;
    chunk_done_ = 0;
    return decodeChunk(at, length);
  }

  Status decodeChunk(std::uint64_t at, std::size_t length) {
    const std::size_t bytes = chunk_records_ * layout_->recordBytes();
    stored_.resize(length);
    SURFEIT_RETURN_IF_ERROR(input_.readAt(at + kParticleHeaderBytes, stored_));
    if (stream_.is_deflated) {
      records_.resize(bytes);
      if (!inflateWhole(stored_, records_)) {
        return damagedAt(at, fmt::format("particle chunk is not {} bytes of zlib data that code {}",
                                         length, bytes));
      }
    } else {
      std::swap(stored_, records_);
    }
    if (stream_.is_transposed) {
      stored_.resize(bytes);
      untranspose(records_.data(), layout_->recordBytes(), chunk_records_, stored_.data());
      std::swap(stored_, records_);
    }
    return {};
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    for (std::size_t done = 0; done < count;) {
      // Chunks without particles are legal; each takes bytes of the stream, so that this ends
      while (chunk_done_ == chunk_records_) {
        SURFEIT_RETURN_IF_ERROR(readParticleChunk(row() + done));
      }
      const std::size_t step = std::min(count - done, chunk_records_ - chunk_done_);
      layout_->decode(records_.data() + chunk_done_ * layout_->recordBytes(), step,
                      rows + done * element_.row_bytes);
      chunk_done_ += step;
      done += step;
    }
    return {};
  }

  Status moveTo(std::uint64_t) override {
    next_chunk_ = stream_.begin;
    chunk_records_ = chunk_done_ = 0;
    return {};
  }

  Status checkEnd() override {
    if (next_chunk_ != stream_.end) {
      return damagedRow(element_.count, fmt::format("{} more bytes at {}, expected the end of the "
                                                    "particles",
                                                    stream_.end - next_chunk_, next_chunk_));
    }
    return input_.checkUnchanged();
  }

  ByteInput input_;
  Stream stream_;
  std::optional<PrtLayout> layout_;
  std::uint64_t next_chunk_ = 0;
  std::size_t chunk_records_ = 0, chunk_done_ = 0;
  std::vector<std::byte> stored_, records_;
};

}  // namespace

bool recognisesPrt2(std::string_view first_bytes) { return first_bytes.starts_with(kMagic); }

Result<std::unique_ptr<RowReader>> openPrt2(const std::string& path,
                                            const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, Access::kCached));
  auto reader = std::make_unique<Prt2Reader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
