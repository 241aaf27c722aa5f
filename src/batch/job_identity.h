// What decides about the bytes of a result: two gathers of one identity can be parts of one job.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "batch/gather_job.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/status.h"

namespace surfeit {

// Version, scene, environment, options of the gather and how receivers are read; not the receivers
// themselves, which are known when they have been read.
nlohmann::json jobIdentity(const SceneFile& scene, const GatherJob& job);

// The options that a result is written by, as an identity has them: mode, outputs, and how
// receivers are read. kCorruption when it has none.
Result<GatherOptions> optionsOfJob(const nlohmann::json& identity);

}  // namespace surfeit
