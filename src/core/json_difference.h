// Why two jobs are not one.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace surfeit {

// Where the two differ: "settings/max_solid_angle is 0.05, expected 0.1"; empty: nowhere.
std::string differenceOf(const nlohmann::json& found, const nlohmann::json& expected);

}  // namespace surfeit
