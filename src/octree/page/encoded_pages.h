// Pages ready to be written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace surfeit {

// Encoded pages, one after the other.
struct EncodedPages {
  struct Page {
    std::uint32_t stored_bytes = 0, payload_bytes = 0;
  };
  std::vector<std::byte> bytes;
  std::vector<Page> pages;

  void add(std::span<const std::byte> stored, std::size_t payload_bytes);
  void clear();
};

}  // namespace surfeit
