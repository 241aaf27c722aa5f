// The comments of several clouds that become one.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// The coordinate reference system of the first cloud that states one.
class FirstCrs {
 public:
  // A note when the comments of a later cloud state another one; else empty.
  std::string compare(const std::string& path, std::span<const std::string> comments);

  // Empty where none does.
  const std::string& crs() const { return crs_; }

 private:
  std::string crs_, path_;
};

// All comments of the first cloud, and the names of object groups of the others. One thread at a
// time.
class MergedComments {
 public:
  void add(const std::string& path, std::span<const std::string> comments);

  const std::vector<std::string>& comments() const { return comments_; }

  // Where a cloud says something else than those before it: of the coordinate reference system, the
  // name of a group and, unless all are turned, the axis that is up.
  std::vector<std::string> notes(bool are_turned) const;

  // Where the positions of `path` are moved: takes the coordinate reference system out of its
  // comments, and tells it, and that degrees were taken for lengths.
  static void forgetCrs(const std::string& path, std::vector<std::string>& comments,
                        Progress& progress);

  // The axis that is up before `to` is: where a cloud does not say, the other of y and z.
  // kInvalidArgument where clouds differ.
  Result<UpAxis> turnedFrom(UpAxis to) const;

 private:
  struct Up {
    std::string path;
    std::optional<UpAxis> axis;
  };
  std::vector<Up> ups_;
  FirstCrs crs_;
  std::map<std::uint32_t, std::string> names_;
  std::vector<std::string> comments_, notes_;
};

}  // namespace surfeit
