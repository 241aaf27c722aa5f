// Material files of OBJ files, for tinyobjloader.
#pragma once

#include <algorithm>
#include <filesystem>
#include <istream>
#include <map>
#include <string>
#include <utility>
#include <vector>

// The library's own build has floats, too few digits for places on a map
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include "sample/obj_lines.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// The words of a line without line end, then of another one.
inline std::vector<std::string> splitAt(const std::string& text, char separator) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    if (end > begin) parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

inline std::string shown(std::string name) {
  std::replace(name.begin(), name.end(), kNameBlank, ' ');
  return name;
}

// Finds material files beside the OBJ file: a name with blanks may be that of one, or of several.
class MaterialFiles final : public tinyobj::MaterialReader {
 public:
  explicit MaterialFiles(std::string directory) : directory_(std::move(directory)) {}

  const Status& status() const { return status_; }

  bool operator()(const std::string& names, std::vector<tinyobj::material_t>* materials,
                  std::map<std::string, int>* ids, std::string* warnings,
                  std::string* errors) override {
    std::vector<std::string> found;
    if (const std::string whole = find(shown(names)); !whole.empty()) {
      found.push_back(whole);
    } else {
      std::string missing;
      for (const std::string& name : splitAt(names, kNameBlank)) {
        if (const std::string part = find(name); !part.empty()) {
          found.push_back(part);
        } else {
          missing += "material file \"" + name + "\" not found\n";
        }
      }
      if (found.empty()) missing = "material file \"" + shown(names) + "\" not found\n";
      *warnings += missing;
    }
    for (const std::string& path : found) load(path, materials, ids, warnings, errors);
    return true;  // else the parser adds words of its own
  }

 private:
  // Where the file is; empty: nowhere. Paths of another machine are left out.
  std::string find(const std::string& name) const {
    const std::filesystem::path directory(directory_), given(name);
    std::error_code ignored;
    for (const std::filesystem::path& path : {directory / given, directory / given.filename()}) {
      if (std::filesystem::is_regular_file(path, ignored)) return path.string();
    }
    return {};
  }

  void load(const std::string& path, std::vector<tinyobj::material_t>* materials,
            std::map<std::string, int>* ids, std::string* warnings, std::string* errors) {
    Result<ByteInput> input = ByteInput::open(path);
    if (!input.ok()) {
      status_ = input.status();
      return;
    }
    ObjLines lines(std::move(*input));
    std::istream stream(&lines);
    std::string warned, failed;  // it replaces what is there
    tinyobj::LoadMtl(ids, materials, &stream, &warned, &failed);
    *warnings += warned;
    *errors += failed;
    if (!lines.status().ok()) status_ = lines.status();
  }

  std::string directory_;
  Status status_;
};

}  // namespace surfeit
