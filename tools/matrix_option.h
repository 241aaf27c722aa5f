// Options that hold an affine matrix: --transform, --from-space, --to-space.
#pragma once

#include <array>
#include <string>

namespace surfeit {

// The rows of a 3x4 matrix, which acts on column vectors.
using OptionMatrix = std::array<double, 12>;

// 12 numbers row by row, or 16 with 0 0 0 1 at the end; or the name of a file that holds them.
// Throws CLI's usage error, which names the option.
OptionMatrix parseMatrix(const std::string& option, const std::string& text);

}  // namespace surfeit
