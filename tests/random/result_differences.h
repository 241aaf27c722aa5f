// How far results are from others at the same receivers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "gather/rules/receiver.h"

namespace surfeit {

struct ResultDifferences {
  double rms = 0, bias = 0, worst = 0;  // of occlusion
  std::size_t worst_receiver = 0;
  double irradiance_rms = 0;    // over the mean irradiance of what is expected, mean of rgb
  double irradiance_worst = 0;  // over that as well
};

// Neither is empty; results are as many as expected ones. Where any is not a number, so is rms.
inline ResultDifferences differencesOf(std::span<const GatherResult> results,
                                       std::span<const GatherResult> expected) {
  const auto gray = [](const GatherResult& result) {
    return double(result.irradiance.x + result.irradiance.y + result.irradiance.z) / 3;
  };
  ResultDifferences found;
  const double count = double(results.size());
  double mean = 0;
  for (const GatherResult& result : expected) mean += gray(result) / count;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const double error = double(results[i].occlusion) - double(expected[i].occlusion);
    const double light = mean > 0 ? (gray(results[i]) - gray(expected[i])) / mean : 0;
    found.bias += error / count;
    found.rms += error * error / count;
    found.irradiance_rms += light * light / count;
    found.irradiance_worst = std::max(found.irradiance_worst, std::abs(light));
    if (!(std::abs(error) <= found.worst)) {
      found.worst = std::abs(error);
      found.worst_receiver = i;
    }
  }
  found.rms = std::sqrt(found.rms);
  found.irradiance_rms = std::sqrt(found.irradiance_rms);
  return found;
}

// The value that a part of all are not above: .5 is the median.
inline double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double place = std::ceil(part * double(values.size())) - 1;
  return values[std::size_t(std::clamp(place, 0., double(values.size() - 1)))];
}

}  // namespace surfeit
