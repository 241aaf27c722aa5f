#include "lookup/baked_search.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Points whose normals differ by more than 60 degrees belong to another wall, or to the other side
// of this one.
constexpr float kLeastCosine = 0.5f;

double distanceSq(const glm::dvec3& position, const Bounds3d& box) {
  const glm::dvec3 outside =
      glm::max(glm::max(box.min - position, position - box.max), glm::dvec3(0));
  return glm::dot(outside, outside);
}

}  // namespace

BakedSearch::BakedSearch(BakedPoints& points, LookupInterpolation interpolation, double reach)
    : points_(points),
      wanted_(interpolation == LookupInterpolation::kNearest ? 1 : kSmoothPoints + 1),
      reach_sq_(reach * reach),
      sums_(points.valueCount()) {}

// What is not nearer does not count.
double BakedSearch::limitSq() const {
  return found_count_ < wanted_ ? reach_sq_ : found_[found_count_ - 1].distance_sq;
}

Result<bool> BakedSearch::find(const glm::dvec3& position, const glm::vec3& normal,
                               std::span<float> values) {
  position_ = position;
  normal_ = normal;
  has_normal_ = normal != glm::vec3(0) && points_.hasNormals();
  found_count_ = 0;

  // Nearest first, so that the limit shrinks early
  const auto top = static_cast<std::uint32_t>(points_.boxes().size() - 1);
  stack_.assign(1, {distanceSq(position, points_.boxes()[top][0]), top, 0});
  while (!stack_.empty()) {
    const Candidate box = stack_.back();
    stack_.pop_back();
    if (box.distance_sq > limitSq()) continue;
    if (box.level == 0) {
      SURFEIT_RETURN_IF_ERROR(visitPage(box.index));
    } else {
      pushChildren(box);
    }
  }
  if (found_count_ == 0) return false;

  // Weights that end where the next point begins, or at the reach
  std::fill(sums_.begin(), sums_.end(), 0.0);
  double weights = 0;
  const bool has_next = found_count_ > 1 && found_count_ == wanted_;
  const double end = std::sqrt(has_next ? found_[found_count_ - 1].distance_sq : reach_sq_);
  const std::size_t used = has_next ? found_count_ - 1 : found_count_;
  const bool is_flat = !(end > std::sqrt(found_[0].distance_sq)) || !std::isfinite(end);
  for (std::size_t i = 0; i < used; ++i) {
    const double part = is_flat ? 1 : 1 - std::sqrt(found_[i].distance_sq) / end;
    SURFEIT_RETURN_IF_ERROR(addValues(found_[i], part * part));
    weights += part * part;
  }
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = float(sums_[i] / weights);
  return true;
}

void BakedSearch::pushChildren(const Candidate& box) {
  const std::vector<Bounds3d>& children = points_.boxes()[box.level - 1];
  const std::size_t first = box.index * BakedPoints::kFanOut;
  const std::size_t end = std::min(first + BakedPoints::kFanOut, children.size());
  const std::size_t below = stack_.size();
  for (std::size_t i = first; i < end; ++i) {
    const double distance_sq = distanceSq(position_, children[i]);
    if (distance_sq <= limitSq()) stack_.push_back({distance_sq, box.level - 1, i});
  }
  std::stable_sort(
      stack_.begin() + std::ptrdiff_t(below), stack_.end(),
      [](const Candidate& a, const Candidate& b) { return a.distance_sq > b.distance_sq; });
}

Status BakedSearch::visitPage(std::size_t number) {
  SURFEIT_ASSIGN_OR_RETURN(const BakedPage* const page, hold(number));
  for (std::size_t run = 0; run < page->runs.size(); ++run) {
    if (distanceSq(position_, page->runs[run]) > limitSq()) continue;
    const std::size_t first = run * BakedPage::kRunPoints;
    const std::size_t end = std::min(first + BakedPage::kRunPoints, page->positions.size());
    for (std::size_t i = first; i < end; ++i) {
      const glm::dvec3 offset = page->positions[i] - position_;
      const double distance_sq = glm::dot(offset, offset);
      if (distance_sq > limitSq()) continue;
      const glm::vec3& normal = page->normals[i];
      if (has_normal_ && normal != glm::vec3(0) && glm::dot(normal, normal_) < kLeastCosine) {
        continue;
      }
      take(distance_sq, std::uint64_t{number} * BakedPage::kPoints + i);
    }
  }
  return {};
}

// Keeps the nearest in order; of equal ones the first along the curve.
void BakedSearch::take(double distance_sq, std::uint64_t point) {
  const Near near{distance_sq, point};
  if (found_count_ == wanted_) {
    if (!(near < found_[found_count_ - 1])) return;
    --found_count_;
  }
  std::size_t place = found_count_++;
  for (; place > 0 && near < found_[place - 1]; --place) found_[place] = found_[place - 1];
  found_[place] = near;
}

Result<const BakedPage*> BakedSearch::hold(std::size_t number) {
  for (const auto& [held, page] : held_) {
    if (page != nullptr && held == number) return page.get();
  }
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const BakedPage> page, points_.page(number));
  auto& place = held_[next_held_];
  next_held_ = (next_held_ + 1) % held_.size();
  place = {number, std::move(page)};
  return place.second.get();
}

Status BakedSearch::addValues(const Near& near, double weight) {
  SURFEIT_ASSIGN_OR_RETURN(const BakedPage* const page,
                           hold(std::size_t(near.point / BakedPage::kPoints)));
  const float* const values = &page->values[(near.point % BakedPage::kPoints) * sums_.size()];
  for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] += weight * double(values[i]);
  return {};
}

}  // namespace surfeit
