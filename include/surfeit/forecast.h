// What a job needs, by a sample: the job itself is done with some of the records, in a temporary
// folder. Jobs that are not from clouds to a cloud have forecasts of their own beside them
// (forecastIndex, forecastGather, forecastSample, forecastPhotons, forecastRelight, forecastBounce,
// forecastBrick, forecastLookup).
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
  std::uint64_t records = 0, sampled_records = 0;  // points, photons, receivers or surfels
  std::uint64_t input_bytes = 0;
  // The budget; of jobs without one, which hold meshes, the most that this process had until now,
  // which is more where it had done other work before. 0: not known (forecastBySample).
  std::uint64_t memory_bytes = 0;
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
