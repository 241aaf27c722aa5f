// Errors of estimates against the truth, in the figures that the benches print.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace surfeit {

struct ErrorFigures {
  double mean = 0;  // of the truth
  double bias = 0;  // mean error
  double rmse = 0;
  double p95 = 0, max = 0;  // of magnitudes
};

// Of `count` estimates, at least one: errorOf(i) is estimate less truth, truthOf(i) the truth.
template <typename ErrorOf, typename TruthOf>
ErrorFigures summariseErrors(std::size_t count, ErrorOf errorOf, TruthOf truthOf) {
  ErrorFigures figures;
  std::vector<double> magnitudes;
  magnitudes.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double error = errorOf(i);
    figures.mean += truthOf(i);
    figures.bias += error;
    figures.rmse += error * error;
    magnitudes.push_back(std::abs(error));
  }
  const double n = double(count);
  figures.mean /= n;
  figures.bias /= n;
  figures.rmse = std::sqrt(figures.rmse / n);
  std::sort(magnitudes.begin(), magnitudes.end());
  figures.p95 = magnitudes[std::size_t(0.95 * (n - 1))];
  figures.max = magnitudes.back();
  return figures;
}

}  // namespace surfeit
