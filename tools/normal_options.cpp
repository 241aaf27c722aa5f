#include "tools/normal_options.h"

#include <fmt/format.h>

#include <string>
#include <string_view>

#include "tools/number_list.h"

namespace surfeit {
namespace {

// "up", "outward", "consistent", "sensor X,Y,Z" or "trajectory FILE".
NormalOrientation parseOrientation(const std::string& text) {
  using Toward = NormalOrientation::Toward;
  if (text == "up") return {Toward::kUp, {}, {}};
  if (text == "outward") return {Toward::kOutward, {}, {}};
  if (text == "consistent") return {Toward::kConsistent, {}, {}};
  constexpr std::string_view kSensor = "sensor", kTrajectory = "trajectory ";
  if (text.starts_with(kTrajectory) && text.size() > kTrajectory.size()) {
    return {Toward::kTrajectory, {}, text.substr(kTrajectory.size())};
  }
  if (!text.starts_with(kSensor)) {
    throw CLI::ValidationError(
        "--orient",
        fmt::format("found \"{}\", expected up, outward, consistent, \"sensor X,Y,Z\" or "
                    "\"trajectory FILE\"",
                    text));
  }
  const auto at =
      parseNumberList<3>("--orient", text.substr(kSensor.size()), "\"sensor X,Y,Z\", a place");
  return {Toward::kSensor, {at[0], at[1], at[2]}, {}};
}

}  // namespace

void addNormalOptions(CLI::App& command, NormalEstimation& estimation) {
  command
      .add_option_function<std::string>(
          "--orient",
          [&estimation](const std::string& text) {
            estimation.orientation = parseOrientation(text);
          },
          "Which way normals point: up (terrain, airborne scans), outward from the middle of the "
          "cloud (round things), consistent with their neighbours (closed surfaces outward, open "
          "ones up), \"sensor X,Y,Z\": to the place that all points were seen from, or, only for "
          "the command normals, \"trajectory FILE\": to the place of the sensor at their gps_time; "
          "FILE is a cloud of the sensor's positions with gps_time")
      ->type_name("up|outward|consistent|\"sensor X,Y,Z\"|\"trajectory FILE\"")
      ->default_str("up");
  command
      .add_option_function<std::string>(
          "--thin",
          [&estimation](const std::string& text) {
            estimation.thin_is_two_sided = text == "two-sided";
          },
          "Points on no surface (foliage, wires): spheres (no normal), or two-sided disks")
      ->check(CLI::IsMember({"spheres", "two-sided"}))
      ->type_name("spheres|two-sided")
      ->default_str("spheres");
}

}  // namespace surfeit
