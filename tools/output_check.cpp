#include "tools/output_check.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "surfeit/mesh_files.h"
#include "surfeit/output.h"

namespace surfeit {
namespace {

constexpr std::string_view kOutputs[] = {"output", "passes", "caustic-photons",
                                         "plot",   "stats",  "cache-series"};

struct Output {
  std::string option, path;
  std::string place;  // of what is not there: its directory and name
  struct ::stat info {};
  bool is_file = false;  // there is a file that would be replaced
};

// The same for all paths that lead there.
std::string placeOf(const std::string& path) {
  const std::filesystem::path file(path);
  std::error_code error;
  const std::filesystem::path directory = std::filesystem::canonical(
      file.has_parent_path() ? file.parent_path() : std::filesystem::path("."), error);
  return error ? path : (directory / file.filename()).string();
}

Status checkAgainst(const Output& output, const std::string& other, std::string_view what) {
  struct ::stat info {};
  if (!output.is_file || ::stat(other.c_str(), &info) != 0) return {};
  if (info.st_dev != output.info.st_dev || info.st_ino != output.info.st_ino) return {};
  return Status::invalidArgument(fmt::format("{}: {} would replace {} {}: give another name",
                                             output.path, output.option, what, other));
}

Status checkAgainstInput(const Output& output, const std::string& input) {
  for (const std::string& file : filesIn(input)) {
    SURFEIT_RETURN_IF_ERROR(checkAgainst(output, file, "its input"));
    if (!output.is_file) continue;  // then a mesh names no such file, and is not read for it
    for (const std::string& named : filesNamedByMesh(file)) {
      SURFEIT_RETURN_IF_ERROR(
          checkAgainst(output, named, fmt::format("a file that is named in {},", file)));
    }
  }
  return {};
}

}  // namespace

std::vector<std::string> filesIn(const std::string& value) {
  constexpr std::string_view kTrajectory = "trajectory ";
  std::vector<std::string> files = {value};
  if (const std::size_t equals = value.find('='); equals != value.npos) {
    files.push_back(value.substr(equals + 1));
  }
  if (value.starts_with(kTrajectory)) files.push_back(value.substr(kTrajectory.size()));
  return files;
}

bool isOutputOption(const CLI::Option& option) {
  const std::vector<std::string>& names = option.get_lnames();
  return std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return std::find(std::begin(kOutputs), std::end(kOutputs), name) != std::end(kOutputs);
  });
}

Status checkOutputs(const CLI::App& command, bool works_in_place) {
  // What is to be written
  std::vector<Output> outputs;
  for (const CLI::Option* const option : command.get_options()) {
    if (option->count() == 0 || !isOutputOption(*option)) continue;
    Output output{"--" + option->get_lnames().front(), option->results().back(), {}, {}, false};
    SURFEIT_ASSIGN_OR_RETURN(const OutputPlace target, findOutput(output.path));
    output.is_file = !target.is_stream && ::stat(target.path.c_str(), &output.info) == 0;
    if (!target.is_stream) output.place = placeOf(target.path);
    for (const Output& earlier : outputs) {
      const bool is_same = !output.place.empty() && output.place == earlier.place;
      if (is_same) {
        return Status::invalidArgument(fmt::format("{}: {} and {} would write the same file",
                                                   output.path, earlier.option, output.option));
      }
      SURFEIT_RETURN_IF_ERROR(checkAgainst(output, earlier.path, earlier.option));
    }
    outputs.push_back(std::move(output));
  }

  // What may be read
  for (const CLI::Option* const option : command.get_options()) {
    if (option->count() == 0 || isOutputOption(*option)) continue;
    for (const Output& output : outputs) {
      const bool is_allowed =
          works_in_place && option->get_positional() && output.option == "--output";
      for (const std::string& input : option->results()) {
        if (is_allowed) continue;
        SURFEIT_RETURN_IF_ERROR(checkAgainstInput(output, input));
      }
    }
  }
  return {};
}

}  // namespace surfeit
