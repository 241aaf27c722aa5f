// A cloud without the rows that a filter leaves out. The filter is what a user says (--filter), or
// what a format leaves out by itself: withheld points and noise of laser scans.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// Which rows of a file a filter takes: how many, and where some of them stand. 8 KiB at most,
// however many there are.
struct RowSelection {
  std::uint64_t row_count = 0, kept_count = 0;
  std::vector<std::uint64_t> left_out;  // by kind of RowExclusions; one for a filter of the user
  std::uint64_t step = 1;
  std::vector<std::uint64_t> places;  // of kept rows 0, step, 2 step, ... among all rows
};

// Selections of files that are opened again, so that their rows are not counted again. Safe from
// any thread.
class RowSelections {
 public:
  // nullptr when there is none under this key.
  std::shared_ptr<const RowSelection> find(const std::string& key) const;
  void add(const std::string& key, std::shared_ptr<const RowSelection> selection);

 private:
  mutable std::mutex mutex_;
  std::unordered_map<std::string, std::shared_ptr<const RowSelection>> selections_;
};

// `source`, at its first row, without the rows that `filter` does not hold for; with an empty
// filter without those of source->exclusions(). Counts what is left in one pass over the file,
// unless `selections` (which may be nullptr) knows it by `key`. Returns `source` itself when all is
// taken. kInvalidArgument when the filter is none (cloud/rows/row_filter.h).
Result<std::unique_ptr<RowReader>> filterRows(std::unique_ptr<RowReader> source,
                                              const std::string& filter, const std::string& key,
                                              RowSelections* selections);

}  // namespace surfeit
