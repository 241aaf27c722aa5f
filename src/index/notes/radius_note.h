// Sizes that seem to be in another unit than the places, or too small to leave no gaps.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "surfeit/surfel.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {

// A sentence with both lengths and the way out, when half of the radii of `sample`, surfels from
// all over a cloud of `count`, are a hundred times as large as the spacing of neighbours, or a
// hundredth of it; else nothing. The sample alone tells the spacing: on surfaces it is as many
// times closer as the root of how many surfels one of the sample stands for. `names`: of the cloud.
std::string noteOfRadii(std::span<const Surfel> sample, std::uint64_t count,
                        const SizeNames& names);

// A sentence with the way out, when half of the one-sided disks of `sample` are so small beside the
// areas they stand for that disks like them leave gaps however they lie; else nothing.
std::string noteOfGaps(std::span<const Surfel> sample, const SizeNames& names);

}  // namespace surfeit
