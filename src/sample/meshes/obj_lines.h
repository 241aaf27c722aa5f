// The lines of OBJ and MTL files, in a form that tinyobjloader takes as it should.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <streambuf>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sample/meshes/obj_vertex_colors.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// A blank within a name, which the parser would end there.
inline constexpr char kNameBlank = '\x01';

// Feeds a parser: lines that a backslash continues are one, names of materials and their files hold
// kNameBlank for blanks, line ends are \n and a byte order mark is gone. Statements of MTL may have
// any case, and the values that they may leave out are there. Vertices are places alone: their
// colors are kept here, since the parser drops all when one is missing. Numbers are looked at,
// since the parser takes what is none as 0 (decimal commas most often): status() then names file
// and line, and reading ends there, as it does when the file cannot be read.
class ObjLines final : public std::streambuf {
 public:
  // `first_lines` come in front of the file's.
  explicit ObjLines(ByteInput input, std::string first_lines = {})
      : input_(std::move(input)), first_lines_(std::move(first_lines)) {}

  const Status& status() const { return status_; }
  std::uint64_t freeFormStatements() const { return free_form_; }
  // In front of the first statement, at most 64; and how many others there are.
  const std::vector<std::string>& comments() const { return comments_; }
  std::uint64_t otherComments() const { return other_comments_; }
  // Material files that are named behind the first use of a material, as statements.
  const std::string& lateLibraries() const { return late_libraries_; }
  ObjVertexColors takeColors() { return std::move(colors_); }
  // Materials that the file defines, and whether they have a Kd; of several of one name the first.
  const std::map<std::string, bool>& materials() const { return materials_; }
  // How many of them are metals (Pm).
  std::uint64_t metals() const { return metals_; }
  // Names that several of its materials have.
  const std::set<std::string>& repeatedMaterials() const { return repeated_; }

 protected:
  int_type underflow() override;

 private:
  bool readPhysicalLine();
  bool readLine();
  void rewriteLine();
  void takeComment(std::string_view text);
  void spellStatement();
  void keepPlace(std::string_view rest);
  void completeColor(std::string_view word, std::string_view rest);
  void dropComment();
  void dropSlashes();
  void noteMaterial(std::string_view word, std::string_view rest);
  bool checkNumbers(std::string_view numbers);

  ByteInput input_;
  Status status_;
  std::uint64_t offset_ = 0;  // in the file, of what follows the buffer
  std::vector<char> buffer_;
  std::size_t begin_ = 0;        // in the buffer: the next line
  std::string physical_, line_;  // as read; what the parser gets
  std::uint64_t number_ = 0;     // of the last line read, from 1
  std::uint64_t free_form_ = 0, other_comments_ = 0, metals_ = 0;
  std::vector<std::string> comments_;
  bool has_statement_ = false;
  ObjVertexColors colors_;
  std::vector<double> values_;  // of the numbers that checkNumbers() saw
  std::map<std::string, bool> materials_;
  std::set<std::string> repeated_;
  bool* has_kd_ = nullptr;  // of the material that is being defined
  std::string first_lines_, late_libraries_;
  bool has_library_ = false, has_early_use_ = false;
  bool is_at_end_ = false;
};

}  // namespace surfeit
