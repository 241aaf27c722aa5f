#include "octree/build/built_slab_bytes.h"

#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace surfeit {
namespace {

// What the bytes begin with; the arrays follow.
struct SlabHead {
  std::uint64_t surfels = 0, page_bytes = 0, pages = 0, nodes = 0, siblings = 0, roots = 0;
  std::uint32_t is_giant = 0, begins = 0, ends = 0, reserved = 0;
};

template <typename T>
void append(std::span<const T> values, std::vector<std::byte>& bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto begin = reinterpret_cast<const std::byte*>(values.data());
  bytes.insert(bytes.end(), begin, begin + values.size_bytes());
}

// Fills `values` with `count` of them from the front of `bytes`; false when there are fewer.
template <typename T>
bool take(std::uint64_t count, Bytes& bytes, std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (count > bytes.size() / sizeof(T)) return false;
  values.resize(static_cast<std::size_t>(count));
  const std::size_t size = values.size() * sizeof(T);
  if (size > 0) std::memcpy(static_cast<void*>(values.data()), bytes.data(), size);
  bytes = bytes.subspan(size);
  return true;
}

}  // namespace

void encodeBuiltSlab(const BuiltSlab& slab, std::vector<std::byte>& bytes) {
  SlabHead head;
  head.surfels = slab.surfel_count;
  head.page_bytes = slab.surfel_pages.bytes.size();
  head.pages = slab.surfel_pages.pages.size();
  head.nodes = slab.nodes.size();
  head.siblings = slab.siblings.size();
  head.roots = slab.roots.size();
  if (slab.giant) {
    head.is_giant = 1;
    head.begins = slab.giant->begins ? 1 : 0;
    head.ends = slab.giant->ends ? 1 : 0;
  }
  bytes.clear();
  append(std::span<const SlabHead>(&head, 1), bytes);
  append(std::span<const std::byte>(slab.surfel_pages.bytes), bytes);
  append(std::span<const EncodedPages::Page>(slab.surfel_pages.pages), bytes);
  append(std::span<const LevelNode>(slab.nodes), bytes);
  append(std::span<const BuiltSlab::Siblings>(slab.siblings), bytes);
  append(std::span<const BuiltSlab::Root>(slab.roots), bytes);
}

Status decodeBuiltSlab(Bytes bytes, BuiltSlab& slab) {
  slab.clear();
  SlabHead head;
  const auto refuse = [] { return Status::corruption("parts of a slab do not fill its bytes"); };
  if (bytes.size() < sizeof head) return refuse();
  std::memcpy(&head, bytes.data(), sizeof head);
  bytes = bytes.subspan(sizeof head);
  slab.surfel_count = static_cast<std::size_t>(head.surfels);
  slab.giant.reset();
  if (head.is_giant != 0) slab.giant = GiantPiece{head.begins != 0, head.ends != 0};
  const bool fits = take(head.page_bytes, bytes, slab.surfel_pages.bytes) &&
                    take(head.pages, bytes, slab.surfel_pages.pages) &&
                    take(head.nodes, bytes, slab.nodes) &&
                    take(head.siblings, bytes, slab.siblings) &&
                    take(head.roots, bytes, slab.roots) && bytes.empty();
  return fits ? Status() : refuse();
}

}  // namespace surfeit
