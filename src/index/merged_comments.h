// The comments of several clouds that become one.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// All comments of the first cloud, and the names of object groups of the others. One thread at a
// time.
class MergedComments {
 public:
  void add(const std::string& path, std::span<const std::string> comments);

  const std::vector<std::string>& comments() const { return comments_; }

  // Where a cloud says something else than those before it: of the coordinate reference system, the
  // name of a group and, unless all are turned, the axis that is up.
  std::vector<std::string> notes(bool are_turned) const;

  // The axis that is up before `to` is: where a cloud does not say, the other of y and z.
  // kInvalidArgument where clouds differ.
  Result<UpAxis> turnedFrom(UpAxis to) const;

 private:
  struct Up {
    std::string path;
    std::optional<UpAxis> axis;
  };
  std::vector<Up> ups_;
  std::pair<std::string, std::string> crs_;  // of the first cloud that has one, and its path
  std::map<std::uint32_t, std::string> names_;
  std::vector<std::string> comments_, notes_;
};

// What to tell of a cloud whose coordinate reference system is not that of a cloud before it.
std::string noteOfOtherCrs(const std::string& path, std::string_view crs,
                           const std::string& other_path, std::string_view other_crs);

}  // namespace surfeit
