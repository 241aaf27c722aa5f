// --up of all commands that know an axis of the scene.
#pragma once

#include <optional>
#include <string>

#include "surfeit/up_axis.h"
#include "tools/gather_options.h"

namespace surfeit {

// Absent: what `without` says.
inline CLI::Option* addUpOption(CLI::App& command, std::optional<UpAxis>& up,
                                const std::string& description, const std::string& without,
                                const std::string& names = "--up") {
  return command
      .add_option_function<std::string>(
          names, [&up](const std::string& axis) { up = UpAxis(axis[0] - 'x'); }, description)
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->type_name("AXIS")
      ->default_str(without);
}

}  // namespace surfeit
