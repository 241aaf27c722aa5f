#include "tools/camera_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "tools/number_checks.h"
#include "tools/number_list.h"

namespace surfeit {
namespace {

constexpr const char* kDensityGroup = "Density by cameras";
constexpr const char* kCameraWords =
    "eye and look-at, six numbers, or seven with the field of view in degrees";

DensityCamera parseCamera(const std::string& text, double fov_degrees) {
  constexpr std::string_view kSeparators = " ,\t";
  int words = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins = i == 0 || kSeparators.find(text[i - 1]) != std::string_view::npos;
    words += begins && kSeparators.find(text[i]) == std::string_view::npos ? 1 : 0;
  }
  std::array<double, 7> n{};
  if (words == 7) {
    n = parseNumberList<7>("--camera", text, kCameraWords);
  } else {
    const auto places = parseNumberList<6>("--camera", text, kCameraWords);
    std::copy(places.begin(), places.end(), n.begin());
    n[6] = fov_degrees;
  }
  DensityCamera camera;
  camera.eye = {n[0], n[1], n[2]};
  camera.look_at = {n[3], n[4], n[5]};
  camera.fov_degrees = n[6];
  return camera;
}

}  // namespace

void parseSize(const std::string& text, int& width, int& height) {
  const char* const end = text.data() + text.size();
  int columns = 0, rows = 0;
  auto [at, error] = std::from_chars(text.data(), end, columns);
  bool ok = error == std::errc() && at != end && (*at == 'x' || *at == 'X');
  if (ok) {
    const auto second = std::from_chars(at + 1, end, rows);
    ok = second.ec == std::errc() && second.ptr == end && columns > 0 && rows > 0;
  }
  if (!ok) {
    throw CLI::ValidationError(
        "--size", fmt::format("found \"{}\", expected WIDTHxHEIGHT, for example 1280x960", text));
  }
  width = columns;
  height = rows;
}

PixelWindow parseCrop(const std::string& text) {
  constexpr const char* kExpected =
      "x0,y0,x1,y1, whole numbers: columns x0 to x1 - 1, rows y0 to "
      "y1 - 1, such as 400,0,800,300";
  const auto n = parseNumberList<4>("--crop", text, kExpected);
  constexpr double kMost = 1 << 30;
  const bool are_whole = std::all_of(n.begin(), n.end(), [](double number) {
    return number == std::floor(number) && std::abs(number) <= kMost;
  });
  if (!are_whole || n[0] >= n[2] || n[1] >= n[3]) {
    throw CLI::ValidationError("--crop", fmt::format("found \"{}\", expected {}", text, kExpected));
  }
  return {int(n[0]), int(n[1]), int(n[2]), int(n[3])};
}

Result<CameraDensity> DensityArguments::cameraDensity() const {
  CameraDensity result = density;
  for (const std::string& text : cameras) result.cameras.push_back(parseCamera(text, fov_degrees));
  for (const std::string& file : files) {
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<DensityCamera> more,
                             readDensityCameras(file, fov_degrees));
    result.cameras.insert(result.cameras.end(), more.begin(), more.end());
  }
  if (!result.cameras.empty()) return result;
  for (const CLI::Option* option : details) {
    if (option->count() == 0) continue;
    return Status::invalidArgument(fmt::format(
        "{}: found no camera, expected --camera or --camera-file with it", option->get_name()));
  }
  return result;
}

std::vector<CLI::Option*> addDensityOptions(CLI::App& app, DensityArguments& arguments) {
  const auto detail = [&arguments](CLI::Option* option) {
    arguments.details.push_back(option);
    return option->group(kDensityGroup);
  };
  CLI::Option* const camera =
      app.add_option_function<std::vector<std::string>>(
             "--camera",
             [&arguments](const std::vector<std::string>& texts) {
               for (const std::string& text : texts) parseCamera(text, arguments.fov_degrees);
               arguments.cameras = texts;
             },
             "Camera that decides the density: eye and look-at, then perhaps the field of view. In "
             "view surfels are as large as --pixels, out of view coarser (--max-solid-angle); what "
             "is hidden counts as in view. Repeatable: the finest of all cameras")
          ->type_name("\"EX EY EZ LX LY LZ [FOV]\"")
          ->type_size(1)
          ->expected(1)
          ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
          ->group(kDensityGroup);
  CLI::Option* const file =
      app.add_option("--camera-file", arguments.files,
                     "Text with such a camera a line; blank lines and # comments are skipped")
          ->type_name("FILE")
          ->allow_extra_args(false)
          ->group(kDensityGroup);
  CameraDensity& density = arguments.density;
  detail(app.add_option("--pixels", density.pixels,
                        "Edge of a surfel in view, in pixels: 1.5 gives half as many as 1"))
      ->type_name("P")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1e4));
  detail(app.add_option("--max-solid-angle", density.max_solid_angle,
                        "Largest solid angle of a surfel out of view, from the nearest place in "
                        "view, steradians: the measure of gather's option of that name"))
      ->type_name("SR")
      ->capture_default_str()
      ->check(CLI::Range(1e-9, 1.0));
  detail(app.add_option("--stereo", density.stereo,
                        "Every camera is two eyes, that far apart, which look in parallel"))
      ->type_name("DISTANCE")
      ->check(kPositiveNumber.description(""));
  detail(app.add_option("--fov", arguments.fov_degrees,
                        "Vertical field of view of cameras without their own, degrees"))
      ->type_name("DEGREES")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 170.0));
  detail(
      app.add_option_function<std::string>(
          "--size",
          [&density](const std::string& text) { parseSize(text, density.width, density.height); },
          "Pixels of the cameras' pictures (default 1280x960)"))
      ->type_name("WxH");
  return {camera, file};
}

void addCameraCropOption(CLI::App& app, DensityArguments& arguments) {
  CameraDensity& density = arguments.density;
  CLI::Option* const crop = app.add_option_function<std::string>(
      "--crop", [&density](const std::string& text) { density.crop = parseCrop(text); },
      "Only these pixels of the cameras' pictures are in view, the others are out of view: columns "
      "x0 to x1 - 1, rows y0 to y1 - 1, from the top left");
  crop->type_name("x0,y0,x1,y1")->group(kDensityGroup);
  arguments.details.push_back(crop);
}

}  // namespace surfeit
