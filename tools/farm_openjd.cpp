// The job for farms that take Open Job Description templates, specification 2023-09.
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tools/farm_plan.h"
#include "tools/frames.h"

namespace surfeit {
namespace {

// Strings of JSON are strings of YAML.
std::string yamlString(const std::string& text) { return nlohmann::json(text).dump(); }

// Lines below `data: |`, 10 blanks deep.
std::string indented(const std::string& lines) {
  std::string text;
  for (std::size_t begin = 0; begin < lines.size();) {
    const std::size_t end = lines.find('\n', begin);
    const std::string line = lines.substr(begin, end - begin);
    text += line.empty() ? "\n" : "          " + line + "\n";
    begin = end + 1;
  }
  return text;
}

// A name of the job has at most 128 characters, and {{ begins a value.
std::string jobName(const FarmPlan& plan) {
  const std::string file = std::filesystem::path(plan.result).filename().string();
  const bool fits = file.size() <= 100 && file.find("{{") == file.npos;
  const std::string command = plan.is_index ? "surfeit index" : "surfeit gather";
  return fits ? command + " " + file : command;
}

std::string hostOf(const FarmPlan& plan) {
  return fmt::format(
      "    hostRequirements:\n"
      "      amounts:\n"
      "        - name: amount.worker.vcpu\n"
      "          min: {}\n"
      "        - name: amount.worker.memory # MiB\n"
      "          min: {}\n"
      "      attributes:\n"
      "        - name: attr.worker.os.family\n"
      "          anyOf: [linux]\n",
      plan.threads, plan.memory_mib + 64);
}

// The integer parameters of a step.
std::string spaceOf(const FarmPlan& plan, bool has_shards) {
  std::string text;
  const auto add = [&text](const char* name, const std::string& range) {
    text += fmt::format(
        "        - name: {}\n"
        "          type: INT\n"
        "          range: \"{}\"\n",
        name, range);
  };
  // Values are in rising order: the place of the frame, not the frame
  if (!plan.frames.empty()) add("Frame", fmt::format("1-{}", plan.frames.size()));
  if (has_shards) add("Shard", fmt::format("1-{}", plan.shards));
  return text.empty() ? text : "    parameterSpace:\n      taskParameterDefinitions:\n" + text;
}

std::string scriptOf(std::uint64_t minutes, const std::string& args, const std::string& script) {
  std::string text =
      "    script:\n"
      "      actions:\n"
      "        onRun:\n"
      "          command: bash\n"
      "          args: [\"{{Task.File.Run}}\", \"{{Param.Directory}}\"" +
      args + "]\n";
  if (minutes > 0) text += fmt::format("          timeout: {}\n", 60 * minutes);
  return text +
         "          cancelation:\n"
         "            mode: NOTIFY_THEN_TERMINATE\n"
         "            notifyPeriodInSeconds: 30\n"
         "      embeddedFiles:\n"
         "      - name: Run\n"
         "        type: TEXT\n"
         "        data: |\n" +
         indented(script);
}

// "Gather"
std::string stepName(std::string pass) {
  pass[0] = static_cast<char>(pass[0] - 'a' + 'A');
  return pass;
}

// A step for each pass, behind the one before, and the merge.
std::string stepsOf(const FarmPlan& plan) {
  const std::string head = planFunctions(plan);
  const std::string frame = plan.frames.empty() ? "" : ", \"{{Task.Param.Frame}}\"";
  const std::string frame_index = plan.frames.empty() ? "0" : "$(($2 - 1))";
  const std::string shard = plan.frames.empty() ? "$2" : "$3";
  std::string text, before;
  const auto begin = [&](const std::string& name) {
    text += "  - name: " + name + "\n";
    if (!before.empty()) text += "    dependencies:\n      - dependsOn: " + before + "\n";
    before = name;
    text += hostOf(plan);
  };
  for (const std::string& pass : plan.passes()) {
    begin(stepName(pass));
    if (FarmPlan::isSingle(pass)) {
      text +=
          spaceOf(plan, false) +
          scriptOf(plan.merge_minutes, frame,
                   head + std::string(runTaskFunction()) + "\ncd \"$1\" || exit\n" +
                       fmt::format("runTask {} \"$(({} * shards + 1))\" 3\n", pass, frame_index));
      continue;
    }
    text += spaceOf(plan, true) +
            scriptOf(plan.minutes, frame + ", \"{{Task.Param.Shard}}\"",
                     head + std::string(runTaskFunction()) + "\ncd \"$1\" || exit\n" +
                         fmt::format("runTask {} \"$(({} * shards + {}))\" 3\n", pass, frame_index,
                                     shard));
  }
  begin("Merge");
  return text + spaceOf(plan, false) +
         scriptOf(plan.merge_minutes, frame,
                  head + "\ncd \"$1\" || exit\n" +
                      fmt::format("merge \"{}\" \"$memory\"\n", frame_index));
}

}  // namespace

std::string openJdTemplate(const FarmPlan& plan) {
  return planComment(plan) +
         "#\n"
         "# The parameter Directory is where names of files begin. A task tries again by itself;\n"
         "# what fails then is for the scheduler, and the merge waits for all.\n"
         "specificationVersion: jobtemplate-2023-09\n"
         "name: " +
         yamlString(jobName(plan)) +
         "\n"
         "parameterDefinitions:\n"
         "  - name: Directory\n"
         "    type: PATH\n"
         "    objectType: DIRECTORY\n"
         "    dataFlow: INOUT\n"
         "    default: .\n"
         "steps:\n" +
         stepsOf(plan);
}

}  // namespace surfeit
