// Payloads of pages that end early: what is left is as it was, and the header says where the packed
// part ends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "storage/byte_coding.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::size_t kPayloadHeaderBytes = 8;

inline std::uint32_t packedBytesOf(std::span<const std::byte> payload) {
  std::uint32_t bytes;
  std::memcpy(&bytes, payload.data() + 4, sizeof bytes);
  return bytes;
}

inline void setPackedBytes(std::vector<std::byte>& payload, std::uint32_t bytes) {
  std::memcpy(payload.data() + 4, &bytes, sizeof bytes);
}

// The payload with the first `bytes` of its packed part alone, and the whole plain one.
inline std::vector<std::byte> withPackedPart(std::span<const std::byte> payload,
                                             std::uint32_t bytes) {
  std::vector<std::byte> cut(payload.begin(), payload.begin() + bytes);
  const auto plain = payload.subspan(packedBytesOf(payload));
  cut.insert(cut.end(), plain.begin(), plain.end());
  setPackedBytes(cut, bytes);
  return cut;
}

// What `decode` says about a payload that ends at every byte of its packed part, in this order and
// each message once in a row; "" where it says nothing. Before each it decodes the sound payload,
// so that what is left in the scratch of the thread are sound values.
inline std::vector<std::string> messagesOfCuts(
    std::span<const std::byte> payload,
    const std::function<Status(std::span<const std::byte>)>& decode) {
  std::vector<std::string> messages;
  for (std::uint32_t bytes = kPayloadHeaderBytes; bytes < packedBytesOf(payload); ++bytes) {
    if (const Status sound = decode(payload); !sound.ok()) return {sound.message()};
    const std::string message = decode(withPackedPart(payload, bytes)).message();
    if (messages.empty() || messages.back() != message) messages.push_back(message);
  }
  return messages;
}

}  // namespace surfeit
