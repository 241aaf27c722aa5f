// The up axis among the comments of a cloud: "up z".
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "surfeit/up_axis.h"

namespace surfeit {

inline char upAxisName(UpAxis up) { return "xyz"[static_cast<int>(up)]; }

inline std::string upComment(UpAxis up) { return std::string("up ") + upAxisName(up); }

// What the first comment of that form says; nothing when none does.
inline std::optional<UpAxis> statedUpAxis(std::span<const std::string> comments) {
  for (const std::string& comment : comments) {
    for (const UpAxis up : {UpAxis::kX, UpAxis::kY, UpAxis::kZ}) {
      if (comment == upComment(up)) return up;
    }
  }
  return std::nullopt;
}

// Makes the comments say that axis.
inline void stateUpAxis(UpAxis up, std::vector<std::string>& comments) {
  std::erase_if(comments, [](const std::string& comment) {
    return statedUpAxis(std::span(&comment, 1)).has_value();
  });
  comments.insert(comments.begin(), upComment(up));
}

}  // namespace surfeit
