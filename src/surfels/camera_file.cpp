// Texts of cameras (surfeit/camera_density.h).
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "storage/file.h"
#include "surfeit/camera_density.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostCameras = 100'000;
constexpr std::uint64_t kMostBytes = std::uint64_t{32} << 20;

// The numbers of a line; their count, or -1 where something is none or there are too many.
int readNumbers(std::string_view line, std::array<double, 7>& numbers) {
  constexpr std::string_view kSeparators = " ,\t\r";
  int count = 0;
  for (;;) {
    line.remove_prefix(std::min(line.find_first_not_of(kSeparators), line.size()));
    if (line.empty()) return count;
    const std::string_view word = line.substr(0, line.find_first_of(kSeparators));
    double number = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    const bool is_number =
        error == std::errc() && end == word.data() + word.size() && std::isfinite(number);
    if (!is_number || count == int(numbers.size())) return -1;
    numbers[std::size_t(count++)] = number;
    line.remove_prefix(word.size());
  }
}

}  // namespace

Result<std::vector<DensityCamera>> readDensityCameras(const std::string& path, double fov_degrees) {
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  if (file.size() > kMostBytes) {
    return Status::corruption(
        fmt::format("{}: found {} bytes, expected a text of cameras", path, file.size()));
  }
  std::string text(std::size_t(file.size()), '\0');
  SURFEIT_RETURN_IF_ERROR(file.readAt(0, std::as_writable_bytes(std::span(text))));

  std::vector<DensityCamera> cameras;
  std::size_t number = 0;
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
    ++number;
    if (!line.empty() && line.front() == '#') continue;
    std::array<double, 7> n{};
    const int count = readNumbers(line, n);
    if (count == 0) continue;
    if ((count != 6 && count != 7) || cameras.size() == kMostCameras) {
      return Status::corruption(fmt::format(
          "{}: line {}: expected eye and look-at, six numbers, or seven with the field of view, of "
          "at most {} cameras",
          path, number, kMostCameras));
    }
    DensityCamera camera;
    camera.eye = {n[0], n[1], n[2]};
    camera.look_at = {n[3], n[4], n[5]};
    camera.fov_degrees = count == 7 ? n[6] : fov_degrees;
    cameras.push_back(camera);
  }
  if (cameras.empty()) return Status::corruption(fmt::format("{}: found no camera", path));
  return cameras;
}

}  // namespace surfeit
