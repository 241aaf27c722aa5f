// Names of object groups among the comments of a cloud: "group 3 left wall".
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace surfeit {

inline constexpr std::string_view kGroupComment = "group ";

inline std::string groupComment(std::size_t group, std::string_view name) {
  return std::string(kGroupComment) + std::to_string(group) + " " + std::string(name);
}

struct StatedGroupName {
  std::uint32_t group = 0;
  std::string_view name;  // of the comment's own text
};

// What a comment of that form says; nothing for others.
inline std::optional<StatedGroupName> statedGroupName(std::string_view comment) {
  if (!comment.starts_with(kGroupComment)) return std::nullopt;
  comment.remove_prefix(kGroupComment.size());
  StatedGroupName stated;
  const char* const end = comment.data() + comment.size();
  const auto [stop, error] = std::from_chars(comment.data(), end, stated.group);
  if (error != std::errc() || stop == end || *stop != ' ') return std::nullopt;
  stated.name = comment.substr(static_cast<std::size_t>(stop - comment.data()) + 1);
  return stated;
}

}  // namespace surfeit
