// The lines in front of the points of a text: comments, names of columns, the count of PTS.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/text/xyz_header.h"

namespace surfeit {

// Takes the lines in front of the data, one by one.
class XyzHead {
 public:
  enum class Line { kHead, kData, kUnknown };

  // Lines may begin with words that are no numbers, for the user names columns by number.
  void takeWords() { takes_words_ = true; }
  // What a line is: of the head, the first of the data, or neither.
  Line take(std::string_view line);
  // With the number of columns of the data, 0 when there is none: a comment that names others is
  // none that names columns.
  void end(std::size_t column_count);

  bool hasNames() const { return !header_.names.empty(); }
  const XyzHeader& header() const { return header_; }
  const std::vector<std::string>& comments() const { return comments_; }
  // Of PTS, in front of the points; 0 when there is none.
  std::uint64_t count() const { return count_; }
  bool hasCount() const { return has_count_; }
  // Words of a line that seems to name columns, but no position; empty when there is none.
  const std::vector<std::string>& otherNames() const { return other_names_; }
  // Why the head does not go with the data, as far as it has no effect.
  const std::string& note() const { return note_; }
  // Comments that are too many to be kept.
  std::uint64_t lostComments() const { return lost_comments_; }

 private:
  bool isData(std::string_view line) const;
  bool isDataOf(std::span<const std::string_view> words) const;
  void endNames();
  void keepComment(std::string comment);

  XyzHeader header_;
  std::vector<std::string> comments_, other_names_;
  std::string last_comment_, header_line_, note_;
  bool named_in_comment_ = false, has_count_ = false, has_units_ = false;
  bool takes_words_ = false;
  std::uint64_t count_ = 0, lost_comments_ = 0;
};

}  // namespace surfeit
