#include "cloud/parts/channel_encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "cloud/parts/stored_values.h"

namespace surfeit {
namespace {

bool isTaken(std::span<const PlannedChannel> channels, std::string_view name) {
  return findChannel(channels, name) != nullptr;
}

// Each value of a channel by itself, under the name of its property.
void planScalars(const RowLayout& element, const RowChannel& channel,
                 std::vector<PlannedChannel>& plan, std::vector<std::string>& notes) {
  for (const std::size_t index : channel.properties) {
    const RowProperty& property = element.properties[index];
    const RowChannel scalar{property.name, ChannelKind::kFloat, {index}, property.type};
    if (!keepsProperties(element, scalar, property.name)) {
      notes.push_back(fmt::format("{} is read back under another name", quoteText(property.name)));
    }
    plan.push_back({scalar, property.name});
  }
}

template <typename In, typename Out>
void copyValues(const std::byte* from, std::size_t from_stride, std::size_t count, std::byte* to,
                std::size_t to_stride) {
  for (std::size_t i = 0; i < count; ++i, from += from_stride, to += to_stride) {
    In in;
    std::memcpy(&in, from, sizeof in);
    const Out out = static_cast<Out>(in);
    std::memcpy(to, &out, sizeof out);
  }
}

}  // namespace

std::vector<PlannedChannel> planChannels(const RowLayout& element,
                                         std::span<const ChannelName> names,
                                         std::vector<std::string>& notes) {
  std::vector<PlannedChannel> plan;
  for (const RowChannel& channel : channelsOf(element)) {
    const auto known = std::find_if(names.begin(), names.end(), [&](const ChannelName& name) {
      return name.channel == channel.name;
    });
    const std::string wanted(known != names.end() ? known->name : channel.name);
    if (keepsProperties(element, channel, wanted) && !isTaken(plan, wanted)) {
      plan.push_back({channel, wanted});
    } else if (keepsProperties(element, channel, channel.name) && !isTaken(plan, channel.name)) {
      plan.push_back({channel, channel.name});
    } else {
      planScalars(element, channel, plan, notes);
    }
  }
  return plan;
}

const PlannedChannel* findChannel(std::span<const PlannedChannel> channels, std::string_view name) {
  const auto found =
      std::find_if(channels.begin(), channels.end(),
                   [&](const PlannedChannel& channel) { return channel.name == name; });
  return found != channels.end() ? &*found : nullptr;
}

ChannelEncoder::ChannelEncoder(const RowLayout& element, const RowChannel& channel, ValueType type)
    : element_(element), channel_(channel), type_(type) {
  if (!isCodedColor(channel) || type != ValueType::kFloat32) return;
  const RowProperty& property = element.properties[channel.properties[0]];
  const std::size_t codes = channel.type == ValueType::kUint8 ? 256 : 65536;
  std::vector<std::byte> row(element.row_bytes);
  for (std::size_t code = 0; code < codes; ++code) {
    std::memcpy(row.data() + property.offset, &code, valueTypeBytes(property.type));
    linear_.push_back(static_cast<float>(channelValue(element, channel, 0, row.data())));
  }
}

void ChannelEncoder::encodeColor(const std::byte* rows, std::size_t count, std::byte* to,
                                 std::size_t to_stride) const {
  for (std::size_t i = 0; i < count; ++i, rows += element_.row_bytes, to += to_stride) {
    for (std::size_t c = 0; c < components(); ++c) {
      const RowProperty& property = element_.properties[channel_.properties[c]];
      std::size_t code = 0;
      std::memcpy(&code, rows + property.offset, valueTypeBytes(property.type));
      std::memcpy(to + c * sizeof(float), &linear_[code], sizeof(float));
    }
  }
}

void ChannelEncoder::encode(const std::byte* rows, std::size_t count, std::byte* to,
                            std::size_t to_stride) const {
  if (!linear_.empty()) return encodeColor(rows, count, to, to_stride);
  for (std::size_t c = 0; c < components(); ++c) {
    const RowProperty& property = element_.properties[channel_.properties[c]];
    visitValueType(property.type, [&](auto in) {
      visitValueType(type_, [&](auto out) {
        copyValues<typename decltype(in)::type, typename decltype(out)::type>(
            rows + property.offset, element_.row_bytes, count, to + c * valueBytes(), to_stride);
      });
    });
  }
}

}  // namespace surfeit
