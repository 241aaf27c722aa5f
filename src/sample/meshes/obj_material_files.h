// Material files of OBJ files, for tinyobjloader.
#pragma once

#include <algorithm>
#include <filesystem>
#include <istream>
#include <map>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

// The library's own build has floats, too few digits for places on a map
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include "sample/meshes/obj_lines.h"
#include "storage/byte_input.h"
#include "storage/file.h"
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

// What is not applied of the options of a picture; empty when all is.
inline std::string noteOfOptions(const std::string& name,
                                 const tinyobj::texture_option_t& options) {
  const bool is_moved = options.scale[0] != 1 || options.scale[1] != 1 ||
                        options.origin_offset[0] != 0 || options.origin_offset[1] != 0;
  const bool is_changed = options.brightness != 0 || options.contrast != 1 || options.clamp;
  if (!is_moved && !is_changed) return {};
  return "options " + std::string(is_moved ? "-s and -o" : "-mm and -clamp") + " of texture " +
         name + " are not applied: bake them into the " +
         (is_moved ? "texture coordinates" : "picture");
}

// Where the picture is: in one of the directories, under its path or its name alone. Nowhere: its
// path in the first.
inline std::string findPictureFile(std::string name, const std::vector<std::string>& directories) {
  std::replace(name.begin(), name.end(), '\\', '/');  // written on Windows
  const std::filesystem::path given(name);
  std::error_code ignored;
  for (const std::filesystem::path& path : {given, given.filename()}) {
    for (const std::string& directory : directories) {
      const std::filesystem::path file = std::filesystem::path(directory) / path;
      if (std::filesystem::is_regular_file(file, ignored)) return file.string();
    }
  }
  return (std::filesystem::path(directories.front()) / given).string();
}

// Where a material comes from, and what the parser does not tell of it.
struct MaterialSource {
  std::string directory;
  bool has_kd = false;
};

// Finds material files beside the OBJ file: a name with blanks may be that of one, or of several.
class MaterialFiles final : public tinyobj::MaterialReader {
 public:
  explicit MaterialFiles(std::string directory) : directory_(std::move(directory)) {}

  const Status& status() const { return status_; }
  // By name.
  const std::map<std::string, MaterialSource>& sources() const { return sources_; }
  // What the user should know of the files that were read.
  const std::vector<std::string>& notes() const { return notes_; }
  // The files that were read.
  const std::vector<std::string>& paths() const { return paths_; }

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
    std::error_code ignored;
    for (const std::string& known : paths_) {
      if (std::filesystem::equivalent(known, path, ignored)) return;
    }
    paths_.push_back(path);
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
    if (lines.metals() > 0) {
      notes_.push_back(
          path + ": " + std::to_string(lines.metals()) +
          " materials are metals (Pm), which reflect no diffuse light, and are read as "
          "if they did: make their Kd darker");
    }
    std::set<std::string> repeated = lines.repeatedMaterials();
    for (const auto& [name, has_kd] : lines.materials()) {
      const MaterialSource source{directoryOf(path), has_kd};
      if (!sources_.try_emplace(name, source).second) repeated.insert(name);
    }
    if (repeated.empty()) return;
    const std::string more =
        repeated.size() > 1 ? " (and " + std::to_string(repeated.size() - 1) + " more)" : "";
    notes_.push_back(path + ": material \"" + shown(*repeated.begin()) + "\"" + more +
                     " is defined again: the first definition counts (rename the others)");
  }

  std::string directory_;
  std::map<std::string, MaterialSource> sources_;
  std::vector<std::string> notes_, paths_;
  Status status_;
};

}  // namespace surfeit
