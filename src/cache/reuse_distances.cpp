#include "cache/reuse_distances.h"

#include <algorithm>
#include <bit>

#include "core/assert.h"

namespace surfeit {
namespace {

// Slots are renumbered when they run out, which costs a step for every watched page. With four
// times as many slots as pages that is less than a third of a step per touch, and four bits of
// memory.
constexpr std::size_t kSlotsPerPage = 4;

// The lowest bit that is set.
constexpr std::uint32_t lowestBit(std::uint32_t bits) { return bits & (~bits + 1); }

// The bits of a word before that of the slot.
constexpr std::uint64_t bitsBefore(std::uint32_t slot) {
  return (std::uint64_t{1} << slot % 64) - 1;
}

}  // namespace

ReuseDistances::Plan::Plan(PageNumber page_count, std::size_t most_tracked) {
  const std::uint64_t pages = std::max(page_count, PageNumber{1});
  const std::uint64_t most = std::clamp(most_tracked, std::size_t{1}, kMostTracked);
  pages_per_sample = std::uint32_t((pages + most - 1) / most);
  tracked = std::uint32_t((pages + pages_per_sample - 1) / pages_per_sample);
  // A touch needs a slot beside those of all pages
  words = std::uint32_t((kSlotsPerPage * tracked + kWordSlots) / kWordSlots);
}

ReuseDistances::ReuseDistances(PageNumber page_count, std::size_t most_tracked)
    : ReuseDistances(Plan(page_count, most_tracked)) {}

ReuseDistances::ReuseDistances(const Plan& plan)
    : pages_per_sample_(plan.pages_per_sample),
      slot_of_page_(plan.tracked, kNever),
      marks_(plan.words),
      tree_(plan.words + 1) {
  all_.reuses.resize(plan.tracked);
  recent_.reuses.resize(plan.tracked);
}

std::size_t ReuseDistances::memoryBytes(PageNumber page_count, std::size_t most_tracked) {
  const Plan plan(page_count, most_tracked);
  return sizeof(ReuseDistances) +
         plan.tracked * (sizeof(slot_of_page_[0]) + 2 * sizeof(all_.reuses[0])) +
         plan.words * sizeof(marks_[0]) + (plan.words + std::size_t{1}) * sizeof(tree_[0]);
}

void ReuseDistances::touch(PageNumber page) {
  SURFEIT_ASSERT(isSampled(page));
  const std::uint32_t run = page / pages_per_sample_;
  SURFEIT_ASSERT(run < slot_of_page_.size());
  const std::lock_guard lock(mutex_);
  std::uint32_t& slot = slot_of_page_[run];

  // Count the touch by the pages touched since the last one, this page not among them
  ++touches_;
  if (slot == kNever) {
    all_.first += 1;
    recent_.first += 1;
  } else {
    const std::uint32_t distance = marked_ - slotsBefore(slot) - 1;
    all_.reuses[distance] += 1;
    recent_.reuses[distance] += 1;
  }
  if (slot == kNever || slot < window_slot_) ++window_pages_;

  // This is its last touch now
  if (slot != kNever) eraseSlot(slot);
  slot = kNever;
  if (next_slot_ == marks_.size() * kWordSlots) renumberSlots();
  slot = next_slot_++;
  insertSlot(slot);
}

std::uint32_t ReuseDistances::slotsBefore(std::uint32_t slot) const {
  const std::uint32_t word = slot / kWordSlots;
  auto count = std::uint32_t(std::popcount(marks_[word] & bitsBefore(slot)));
  for (std::uint32_t node = word; node > 0; node -= lowestBit(node)) count += tree_[node];
  return count;
}

void ReuseDistances::addToTree(std::uint32_t word, std::uint32_t difference) {
  for (std::uint32_t node = word + 1; node < tree_.size(); node += lowestBit(node)) {
    tree_[node] += difference;
  }
}

void ReuseDistances::insertSlot(std::uint32_t slot) {
  marks_[slot / kWordSlots] |= std::uint64_t{1} << slot % kWordSlots;
  addToTree(slot / kWordSlots, 1);
  ++marked_;
}

void ReuseDistances::eraseSlot(std::uint32_t slot) {
  marks_[slot / kWordSlots] &= ~(std::uint64_t{1} << slot % kWordSlots);
  addToTree(slot / kWordSlots, 0u - 1);  // wraps around to one less
  --marked_;
}

// Moves the marks, in their order, to the first slots.
void ReuseDistances::renumberSlots() {
  // For a while, tree_[word] are the marks before the word
  std::uint32_t before = 0;
  for (std::size_t word = 0; word < marks_.size(); ++word) {
    tree_[word] = before;
    before += std::uint32_t(std::popcount(marks_[word]));
  }
  tree_[marks_.size()] = before;
  const auto renumbered = [this](std::uint32_t slot) {
    const std::uint32_t word = slot / kWordSlots;
    if (word == marks_.size()) return tree_[word];  // the window begins when slots run out
    return tree_[word] + std::uint32_t(std::popcount(marks_[word] & bitsBefore(slot)));
  };
  for (std::uint32_t& slot : slot_of_page_) {
    if (slot != kNever) slot = renumbered(slot);
  }
  window_slot_ = renumbered(window_slot_);
  next_slot_ = marked_;

  // The marks as they are now, and the tree over them: each node adds itself to the next above
  std::fill(tree_.begin(), tree_.end(), 0);
  for (std::uint32_t word = 0; word < marks_.size(); ++word) {
    const std::uint32_t begin = word * kWordSlots;
    const std::uint32_t count = marked_ > begin ? std::min(marked_ - begin, kWordSlots) : 0;
    marks_[word] = count == kWordSlots ? ~std::uint64_t{0} : bitsBefore(count);
    const std::uint32_t node = word + 1;
    tree_[node] += count;
    const std::uint32_t above = node + lowestBit(node);
    if (above < tree_.size()) tree_[above] += tree_[node];
  }
}

MissRatioCurve ReuseDistances::curve(std::uint64_t lookups) const {
  const std::lock_guard lock(mutex_);
  return MissRatioCurve(pages_per_sample_, all_.reuses, all_.first, double(lookups));
}

void ReuseDistances::endWindow(std::uint64_t lookups) {
  const std::lock_guard lock(mutex_);
  for (double& reuses : recent_.reuses) reuses /= 2;
  recent_.first /= 2;
  recent_.lookups = recentLookups(lookups) / 2;
  lookups_before_window_ = std::max(lookups_before_window_, lookups);
  window_slot_ = next_slot_;
  window_pages_ = 0;
}

MissRatioCurve ReuseDistances::recentCurve(std::uint64_t lookups) const {
  const std::lock_guard lock(mutex_);
  return MissRatioCurve(pages_per_sample_, recent_.reuses, recent_.first, recentLookups(lookups));
}

double ReuseDistances::recentLookups(std::uint64_t lookups) const {
  const std::uint64_t in_window =
      std::max(lookups, lookups_before_window_) - lookups_before_window_;
  return recent_.lookups + double(in_window);
}

std::uint64_t ReuseDistances::windowPages() const {
  const std::lock_guard lock(mutex_);
  return std::uint64_t{window_pages_} * pages_per_sample_;
}

std::uint64_t ReuseDistances::touches() const {
  const std::lock_guard lock(mutex_);
  return touches_;
}

}  // namespace surfeit
