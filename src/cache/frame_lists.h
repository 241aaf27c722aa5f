// Lists of frames in which any frame can be found, taken out and replaced at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace surfeit {

// Every frame is in one list at most. One thread at a time.
class FrameLists {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  explicit FrameLists(std::size_t list_count) : lists_(list_count) {}
  static std::size_t memoryBytes(std::size_t list_count, std::size_t frames) {
    return list_count * sizeof(List) + frames * sizeof(Links);
  }

  // Makes room for that many frames. May throw std::bad_alloc, and has changed nothing then.
  void reserve(std::size_t frames) {
    links_.reserve(frames);  // exactly, where resize would round up
    if (frames > links_.size()) links_.resize(frames);
  }

  std::uint32_t first(std::uint32_t list) const { return lists_[list].first; }
  // Of a frame that is in one.
  std::uint32_t listOf(std::uint32_t frame) const { return links_[frame].list; }

  void append(std::uint32_t frame, std::uint32_t list) {
    List& ends = lists_[list];
    links_[frame] = {ends.last, kNone, list};
    (ends.last == kNone ? ends.first : links_[ends.last].next) = frame;
    ends.last = frame;
  }

  void remove(std::uint32_t frame) {
    const Links& links = links_[frame];
    List& ends = lists_[links.list];
    (links.previous == kNone ? ends.first : links_[links.previous].next) = links.next;
    (links.next == kNone ? ends.last : links_[links.next].previous) = links.previous;
  }

  void moveTo(std::uint32_t frame, std::uint32_t list) {
    remove(frame);
    append(frame, list);
  }

  // Puts `to`, which is in no list, into the place of `from`, which is in none then.
  void replace(std::uint32_t from, std::uint32_t to) {
    const Links& links = links_[to] = links_[from];
    List& ends = lists_[links.list];
    (links.previous == kNone ? ends.first : links_[links.previous].next) = to;
    (links.next == kNone ? ends.last : links_[links.next].previous) = to;
  }

 private:
  struct Links {
    std::uint32_t previous, next, list;
  };
  struct List {
    std::uint32_t first = kNone, last = kNone;
  };

  std::vector<Links> links_;
  std::vector<List> lists_;
};

}  // namespace surfeit
