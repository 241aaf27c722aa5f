#include "index/notes/merged_comments.h"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "core/crs_comment.h"
#include "core/group_comment.h"
#include "core/up_comment.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostCrsChars = 60;  // of well-known text: its name stands in front

}  // namespace

std::string FirstCrs::compare(const std::string& path, std::span<const std::string> comments) {
  const std::string_view crs = statedCrs(comments);
  if (crs_.empty()) {
    crs_ = crs;
    path_ = path;
    return {};
  }
  if (crs.empty() || isSameCrs(crs, crs_)) return {};
  return fmt::format(
      "{}: the coordinate reference system is {}, but {} in {}: positions are taken as they are",
      path, crs.substr(0, kMostCrsChars), crs_.substr(0, kMostCrsChars), path_);
}

void MergedComments::add(const std::string& path, std::span<const std::string> comments) {
  const bool is_first = ups_.empty();
  ups_.push_back({path, statedUpAxis(comments)});
  if (is_first) comments_.assign(comments.begin(), comments.end());

  if (std::string note = crs_.compare(path, comments); !note.empty()) {
    notes_.push_back(std::move(note));
  }

  for (const std::string& comment : comments) {
    const std::optional<StatedGroupName> stated = statedGroupName(comment);
    if (!stated) continue;
    const auto [known, is_new] = names_.emplace(stated->group, stated->name);
    if (is_new && !is_first) comments_.push_back(comment);
    if (is_new || known->second == stated->name) continue;
    notes_.push_back(
        fmt::format("{}: group {} is \"{}\", but \"{}\" in a cloud before it, and keeps that name",
                    path, stated->group, stated->name, known->second));
  }
}

std::vector<std::string> MergedComments::notes(bool are_turned) const {
  std::vector<std::string> notes = notes_;
  if (are_turned) return notes;
  for (const Up& up : ups_) {
    const UpAxis axis = up.axis.value_or(kDefaultUpAxis);
    const UpAxis first = ups_.front().axis.value_or(kDefaultUpAxis);
    if (axis == first) continue;
    notes.push_back(
        fmt::format("{}: {} is up, but {} in {}: nothing is turned, and the output has the latter",
                    up.path, upAxisName(axis), upAxisName(first), ups_.front().path));
  }
  return notes;
}

void MergedComments::forgetCrs(const std::string& path, std::vector<std::string>& comments,
                               Progress& progress) {
  const std::string crs(statedCrs(comments));
  if (crs.empty()) return;
  std::erase_if(comments, [](const auto& comment) { return comment.starts_with(kCrsComment); });
  if (const std::string degrees = noteOfDegrees(crs); !degrees.empty()) {
    progress.note(fmt::format("{}: {}", path, degrees));
  }
  progress.note(fmt::format(
      "{}: the coordinate reference system {} is not kept, because positions are moved or scaled",
      path, crs.substr(0, kMostCrsChars)));
}

Result<UpAxis> MergedComments::turnedFrom(UpAxis to) const {
  const UpAxis other = to == UpAxis::kY ? UpAxis::kZ : UpAxis::kY;
  const UpAxis first = ups_.front().axis.value_or(other);
  for (const Up& up : ups_) {
    const UpAxis axis = up.axis.value_or(other);
    if (axis == first) continue;
    return Status::invalidArgument(fmt::format(
        "{}: {} is up, but {} in {}, expected one axis, because all clouds are turned alike: "
        "convert them one by one with --up {}, then merge the results",
        up.path, upAxisName(axis), upAxisName(first), ups_.front().path, upAxisName(to)));
  }
  return first;
}

}  // namespace surfeit
