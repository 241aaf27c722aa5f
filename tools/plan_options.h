// What `surfeit plan` of a gather and of an index have in common: kinds of jobs, shards, frames,
// time, and the options of the command that go into the job as they are.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "surfeit/status.h"
#include "tools/command.h"
#include "tools/farm_plan.h"

namespace surfeit {

struct PlanOptions {
  FarmPlan plan;
  bool is_index = false;  // --index, which addPlanCommand has looked for before
  bool is_slurm = false, is_parallel = false, is_make = false, is_openjd = false;
};

// Adds --index, --shards, --frames, the kinds of jobs and --time.
void addPlanOptions(CLI::App& command, PlanOptions& options, CommandContext& context);

// Completes the plan by the parsed command, and checks it. Errors: kInvalidArgument.
Status beginPlan(PlanOptions& options, const CLI::App& command, const CommandContext& context);

// Whether memory or time are to be found, by a sample.
bool needsForecast(const PlanOptions& options);
// Fills in what was not given. A task gets twice the seconds, and five minutes for what all do.
void takeForecast(std::uint64_t memory_bytes, double task_seconds, double merge_seconds,
                  FarmPlan& plan);

// The name of the first frame.
std::string firstName(const FarmPlan& plan, const std::string& name);

// The job, of the kind that was asked for.
std::string jobText(const PlanOptions& options);

// `surfeit plan --index`; plan_command.cpp has the gather.
void addIndexPlan(CLI::App& command, CommandContext& context);

}  // namespace surfeit
