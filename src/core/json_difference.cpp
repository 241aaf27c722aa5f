#include "core/json_difference.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace surfeit {

std::string differenceOf(const nlohmann::json& found, const nlohmann::json& expected) {
  const nlohmann::json flat_found = found.flatten(), flat_expected = expected.flatten();
  const auto valueOf = [](const nlohmann::json& flat, const std::string& key) {
    return flat.contains(key) ? flat.at(key).dump() : std::string("absent");
  };
  for (const nlohmann::json* one : {&flat_expected, &flat_found}) {
    for (const auto& [key, value] : one->items()) {
      const std::string is = valueOf(flat_found, key), should = valueOf(flat_expected, key);
      if (is != should) return fmt::format("{} is {}, expected {}", key.substr(1), is, should);
    }
  }
  return {};
}

}  // namespace surfeit
