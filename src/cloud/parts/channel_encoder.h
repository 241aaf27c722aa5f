// Rows become typed channels: what writers of such formats share. A plan says which channels there
// are and what they are called; an encoder stores the values of one of them.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"

namespace surfeit {

// How a format calls a channel of cloud/rows/channels.h.
struct ChannelName {
  std::string_view channel, name;
};

struct PlannedChannel {
  RowChannel channel;
  std::string name;  // in the file
};

// The channels of `element`, in its order, under the names of `names` where there is one. Triples
// that a reader of the file would call differently are written value by value, so that all keep
// their names; those that cannot are told in `notes`.
std::vector<PlannedChannel> planChannels(const RowLayout& element,
                                         std::span<const ChannelName> names,
                                         std::vector<std::string>& notes);

// The channel of that name, or nullptr.
const PlannedChannel* findChannel(std::span<const PlannedChannel> channels, std::string_view name);

// Immutable and safe from any thread.
class ChannelEncoder {
 public:
  // Stores the values of `channel` as `type`. Integers out of its range wrap.
  ChannelEncoder(const RowLayout& element, const RowChannel& channel, ValueType type);

  std::size_t valueBytes() const { return valueTypeBytes(type_); }
  std::size_t components() const { return channel_.properties.size(); }
  std::size_t bytes() const { return components() * valueBytes(); }

  // Stores those of `count` packed rows at `to`, one after another, rows to_stride bytes apart, in
  // host byte order.
  void encode(const std::byte* rows, std::size_t count, std::byte* to, std::size_t to_stride) const;

 private:
  void encodeColor(const std::byte* rows, std::size_t count, std::byte* to,
                   std::size_t to_stride) const;

  RowLayout element_;
  RowChannel channel_;
  ValueType type_;
  std::vector<float> linear_;  // of coded colors, by code
};

}  // namespace surfeit
