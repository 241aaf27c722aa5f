#include "octree/page/encoded_pages.h"

namespace surfeit {

void EncodedPages::add(std::span<const std::byte> stored, std::size_t payload_bytes) {
  bytes.insert(bytes.end(), stored.begin(), stored.end());
  pages.push_back(
      {static_cast<std::uint32_t>(stored.size()), static_cast<std::uint32_t>(payload_bytes)});
}

void EncodedPages::clear() {
  bytes.clear();
  pages.clear();
}

}  // namespace surfeit
