// Sets of things that each may face either way, joined by knowing that two face the same way or
// opposite ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace surfeit {

// A union-find with parities. One thread at a time.
class SideForest {
 public:
  explicit SideForest(std::size_t count = 0) { reset(count); }

  void reset(std::size_t count) {
    parents_.resize(count);
    sizes_.assign(count, 1);
    for (std::size_t i = 0; i < count; ++i) parents_[i] = {std::uint32_t(i), false};
  }

  struct Root {
    std::uint32_t index = 0;
    bool is_opposite = false;  // to the root
  };
  Root rootOf(std::uint32_t i) {
    bool is_opposite = false;
    std::uint32_t root = i;
    while (parents_[root].index != root) {
      is_opposite ^= parents_[root].is_opposite;
      root = parents_[root].index;
    }
    // All on the way hang from the root now
    bool rest = is_opposite;
    while (parents_[i].index != root && i != root) {
      const Root parent = parents_[i];
      parents_[i] = {root, rest};
      rest ^= parent.is_opposite;
      i = parent.index;
    }
    return {root, is_opposite};
  }

  std::uint32_t sizeOf(std::uint32_t root) const { return sizes_[root]; }

  // False when they were joined before.
  bool join(std::uint32_t a, std::uint32_t b, bool are_opposite) {
    Root from = rootOf(a), to = rootOf(b);
    if (from.index == to.index) return false;
    if (sizes_[from.index] > sizes_[to.index]) std::swap(from, to);
    const bool parity = (from.is_opposite != to.is_opposite) != are_opposite;
    parents_[from.index] = {to.index, parity};
    sizes_[to.index] += sizes_[from.index];
    return true;
  }

 private:
  std::vector<Root> parents_;
  std::vector<std::uint32_t> sizes_;
};

}  // namespace surfeit
