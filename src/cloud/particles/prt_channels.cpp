#include "cloud/particles/prt_channels.h"

#include <fmt/format.h>

#include <algorithm>

namespace surfeit {
namespace {

// Records of a block stay in the first cache while its channels are copied one by one.
constexpr std::size_t kBlockBytes = 16 << 10;

}  // namespace

Result<PrtLayout> PrtLayout::create(std::span<const PrtChannel> channels,
                                    std::span<const ChannelRename> renames, const std::string& path,
                                    RowLayout& element, std::vector<std::string>& notes) {
  PrtLayout layout;
  for (const PrtChannel& channel : channels) {
    // The end of the record; neither product nor sum can overflow
    const std::size_t limit = kMaxPrtRecordBytes;
    const std::size_t bytes = storedBytes(channel.type) * std::min(channel.arity, kMaxPrtArity);
    if (channel.arity == 0 || channel.arity > kMaxPrtArity || bytes > limit ||
        channel.offset > limit - bytes) {
      return Status::corruption(
          fmt::format("{}: channel {}: {} values of type {} at byte {} of a record, expected 1 to "
                      "{} in records of at most {} bytes",
                      path, quoteText(channel.name), channel.arity, storedTypeName(channel.type),
                      channel.offset, kMaxPrtArity, limit));
    }
    layout.record_bytes_ = std::max(layout.record_bytes_, channel.offset + bytes);

    // Its properties, unless it is dropped
    const std::size_t to = element.row_bytes;
    SURFEIT_RETURN_IF_ERROR(addChannel(channel.name, channel.arity,
                                       guessChannelKind(channel.name, channel.arity),
                                       plyTypeOf(channel.type), renames, path, element));
    if (element.row_bytes == to) continue;
    layout.copies_.push_back({{channel.type, false, channel.arity, 0}, channel.offset, to});
    if (channel.type == StoredType::kInt64 || channel.type == StoredType::kUint64) {
      notes.push_back(fmt::format("{} becomes float64, exact up to 2^53: {}",
                                  storedTypeName(channel.type), quoteText(channel.name)));
    }
  }
  if (layout.copies_.empty()) {
    return Status::corruption(fmt::format("{}: no channels, expected at least one", path));
  }
  for (Copy& copy : layout.copies_) copy.place.stride = layout.record_bytes_;
  layout.row_bytes_ = element.row_bytes;
  return layout;
}

void PrtLayout::decode(const std::byte* records, std::size_t count, std::byte* rows) const {
  const std::size_t block_records = std::max<std::size_t>(1, kBlockBytes / record_bytes_);
  while (count > 0) {
    const std::size_t block = std::min(count, block_records);
    for (const Copy& copy : copies_) {
      decodeStored(copy.place, records + copy.from, block, rows + copy.to, row_bytes_);
    }
    records += block * record_bytes_;
    rows += block * row_bytes_;
    count -= block;
  }
}

}  // namespace surfeit
