#include "index/notes/mixed_clouds.h"

#include <fmt/format.h>

#include <algorithm>

namespace surfeit {
namespace {

// What a cloud lacks of what others have.
struct Lack {
  bool radiosity = false, albedo = false;
  const char *what, *consequence, *advice;
};

constexpr Lack kLacks[] = {
    {true, true, "colors", "they send and reflect no light",
     "--set \"radiosity = 0.5\" --set \"albedo = 0.5\""},
    {true, false, "radiosity", "they send no light", "--set \"radiosity = 0.5\""},
    {false, true, "albedo", "they reflect no light in bounces", "--set \"albedo = 0.5\""},
};

std::string noteOf(const Lack& lack, std::span<const MixedCloud> clouds,
                   const std::vector<const MixedCloud*>& lacking) {
  std::uint64_t all = 0, dark = 0;
  for (const MixedCloud& cloud : clouds) all += cloud.records;
  for (const MixedCloud* cloud : lacking) dark += cloud->records;
  const auto other = std::find_if(clouds.begin(), clouds.end(), [&](const MixedCloud& cloud) {
    return lack.radiosity ? cloud.channels.radiosity : cloud.channels.albedo;
  });
  const std::string more =
      lacking.size() > 1 ? fmt::format(" and {} more", lacking.size() - 1) : "";
  return fmt::format(
      "{}{}: {} of {} records have no {}, which {} has: {}; surfeit convert CLOUD -o OUT {} gives "
      "them some",
      lacking.front()->path, more, dark, all, lack.what, other->path, lack.consequence,
      lack.advice);
}

}  // namespace

std::vector<std::string> notesOfDarkClouds(std::span<const MixedCloud> clouds) {
  const auto has = [&](bool CloudChannels::*channel) {
    return std::any_of(clouds.begin(), clouds.end(),
                       [&](const MixedCloud& cloud) { return cloud.channels.*channel; });
  };
  const bool has_radiosity = has(&CloudChannels::radiosity);
  const bool has_albedo = has(&CloudChannels::albedo);
  std::vector<std::string> notes;
  for (const Lack& lack : kLacks) {
    std::vector<const MixedCloud*> lacking;
    for (const MixedCloud& cloud : clouds) {
      const bool no_radiosity = has_radiosity && !cloud.channels.radiosity;
      const bool no_albedo = has_albedo && !cloud.channels.albedo;
      if (cloud.records > 0 && no_radiosity == lack.radiosity && no_albedo == lack.albedo) {
        lacking.push_back(&cloud);
      }
    }
    if (!lacking.empty()) notes.push_back(noteOf(lack, clouds, lacking));
  }
  return notes;
}

}  // namespace surfeit
