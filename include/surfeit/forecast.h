// What a job from clouds to a cloud needs, by a sample: the job itself is done with some of the
// records, in a temporary folder.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

struct SampleForecast {
  std::uint64_t records = 0, sampled_records = 0;
  std::uint64_t input_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // estimates, of all records
  std::uint64_t output_bytes = 0;
  double seconds = 0;  // without the time to read the inputs
};

// Does the job with the clouds `samples`, whose channels are renamed and whose records are filtered
// already, and writes `output`. Returns the bytes of temporary files that it took.
using SampleJob = std::function<Result<std::uint64_t>(
    const std::vector<std::string>& samples, const std::string& output, Progress& progress)>;

// Takes up to 65,536 records from all over the inputs (from the front of those that can only be
// read from front to back), does the job with them, and scales its figures up. Writes nothing but
// in a folder for temporary files, which it removes. Errors: those of the inputs and the job.
SURFEIT_API Result<SampleForecast> forecastBySample(const std::vector<std::string>& inputs,
                                                    const std::string& output,
                                                    const ReadOptions& reading,
                                                    const std::string& temporary_directory,
                                                    const SampleJob& job, Progress& progress);

}  // namespace surfeit
