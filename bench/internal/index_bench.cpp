// How fast is the whole of `surfeit index`, and how far from what the disk allows? Indexes a
// generated scene for each number of threads and each budget, every run in a process of its own, so
// that memory and processor time are the run's alone; and in turn with it copies as many bytes:
// reads the input, writes and reads what was temporary, writes the output, all by direct I/O in
// blocks of 1 MiB.
//
//   index_bench --surfels 10M --threads 1,2 --memory 256M,1G --repeat 3 --dir DIR --json FILE

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/seconds_since.h"
#include "core/square_strata.h"
#include "storage/file.h"
#include "storage/page_file.h"
#include "surfeit/generate.h"
#include "surfeit/index.h"
#include "tools/command.h"

namespace surfeit {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kBlockBytes = 1 << 20;

struct BenchOptions {
  SceneRecipe recipe;
  bool from_recipe = false;  // index the recipe, without any input file
  std::string directory = "out/index_bench";
  std::vector<int> threads = {1, 2};
  std::vector<std::uint64_t> memory_bytes = {std::uint64_t{256} << 20, std::uint64_t{1} << 30};
  int repeats = 1;
  std::string json_path;

  std::string path(const std::string& name) const { return directory + "/" + name; }
};

// What a process took from its start to its end, and what it says about its work.
struct ProcessResult {
  double wall_seconds = 0;
  double cpu_seconds = 0;
  std::uint64_t peak_bytes = 0;  // resident
  Json report;
};

double secondsOf(const timeval& time) { return double(time.tv_sec) + 1e-6 * double(time.tv_usec); }

// The work of a child: tells its report, or the failure, through the pipe, and ends.
[[noreturn]] void runChild(const std::function<Result<Json>()>& work, int pipe) {
  const Result<Json> report = work();
  const std::string text =
      (report.ok() ? *report : Json{{"error", report.status().message()}}).dump();
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t size = ::write(pipe, text.data() + written, text.size() - written);
    if (size <= 0) break;
    written += std::size_t(size);
  }
  _exit(report.ok() ? 0 : 1);
}

// Runs `work` in a child of this process, which itself never has a second thread.
Result<ProcessResult> runInProcess(const std::function<Result<Json>()>& work) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    return Status::failed(fmt::format("cannot make a pipe: {}", std::strerror(errno)));
  }
  FileDescriptor read_end(ends[0]), write_end(ends[1]);
  std::fflush(nullptr);
  const auto start = std::chrono::steady_clock::now();
  const pid_t child = ::fork();
  if (child < 0) return Status::failed(fmt::format("cannot fork: {}", std::strerror(errno)));
  if (child == 0) runChild(work, write_end.get());
  write_end.close();

  // All it says, then what it took
  std::string text;
  char buffer[4096];
  for (ssize_t size; (size = ::read(read_end.get(), buffer, sizeof buffer)) > 0;) {
    text.append(buffer, std::size_t(size));
  }
  int exit_status = 0;
  rusage usage{};
  if (::wait4(child, &exit_status, 0, &usage) != child) {
    return Status::failed(fmt::format("cannot wait: {}", std::strerror(errno)));
  }
  ProcessResult result;
  result.wall_seconds = secondsSince(start);
  result.cpu_seconds = secondsOf(usage.ru_utime) + secondsOf(usage.ru_stime);
  result.peak_bytes = std::uint64_t(usage.ru_maxrss) * 1024;
  result.report = Json::parse(text, nullptr, false);
  if (exit_status != 0 || result.report.is_discarded()) {
    const bool has_error = result.report.is_object() && result.report.contains("error");
    return Status::failed(has_error ? result.report["error"].get<std::string>()
                                    : fmt::format("a run ended with status {}", exit_status));
  }
  return result;
}

// Generates the input unless a complete one is there; returns its path.
Result<std::string> prepareInput(const BenchOptions& options) {
  const SceneRecipe& recipe = options.recipe;
  const std::string name = options.path(
      fmt::format("{}-{}-{}-{}.{}", sceneKindName(recipe.kind), recipe.surfels, recipe.seed,
                  recordOrderName(recipe.order), options.from_recipe ? "recipe" : "ply"));
  std::error_code error;
  std::filesystem::create_directories(options.directory, error);
  if (std::filesystem::exists(name, error)) return name;
  fmt::print("generating {}\n", name);
  SURFEIT_ASSIGN_OR_RETURN(
      const ProcessResult generated, runInProcess([&]() -> Result<Json> {
        if (options.from_recipe) {
          SURFEIT_RETURN_IF_ERROR(writeSceneRecipe(recipe, name));
          return Json::object();
        }
        Progress progress;
        const int threads = *std::max_element(options.threads.begin(), options.threads.end());
        SURFEIT_ASSIGN_OR_RETURN(const GenerateStats stats,
                                 generateScene(recipe, name, threads, progress));
        return Json{{"surfels", stats.surfels}};
      }));
  fmt::print("generated in {:.1f} s\n", generated.wall_seconds);
  return name;
}

// Lets the page cache forget the file, so that every run begins with a cold input.
void forgetCached(const std::string& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.isOpen()) ::posix_fadvise(file.get(), 0, 0, POSIX_FADV_DONTNEED);
}

// In a child: indexes, reports, and removes the octree.
Result<Json> indexInput(const std::string& input, const std::string& output,
                        const IndexOptions& options) {
  Progress progress;
  SURFEIT_ASSIGN_OR_RETURN(const IndexStats stats, indexClouds({input}, output, options, progress));
  Json report = {{"surfels", stats.surfels},
                 {"temporary_bytes", stats.temporary_bytes},
                 {"file_bytes", stats.file_bytes}};
  for (const auto& [phase, seconds] : stats.phase_seconds) {
    report["phases"].push_back(Json{phase, seconds});
  }
  // Tells whether two runs wrote the same pages
  SURFEIT_ASSIGN_OR_RETURN(const PageFile pages, PageFile::open(output));
  report["directory_checksum"] = fmt::format("{:016x}", pages.directoryChecksum());
  std::filesystem::remove(output);
  return report;
}

// Appends `bytes` bytes that no disk can compress away.
template <typename File>
Status appendBytes(std::uint64_t bytes, File& file) {
  std::vector<std::uint64_t> block(kBlockBytes / sizeof(std::uint64_t));
  for (std::size_t i = 0; i < block.size(); ++i) block[i] = mixBits(i + 1);
  for (std::uint64_t done = 0; done < bytes; done += kBlockBytes) {
    const std::size_t size = std::size_t(std::min<std::uint64_t>(kBlockBytes, bytes - done));
    const auto result = file.append(std::as_bytes(std::span(block)).first(size));
    if constexpr (std::is_same_v<std::decay_t<decltype(result)>, Status>) {
      SURFEIT_RETURN_IF_ERROR(result);
    } else {
      SURFEIT_RETURN_IF_ERROR(result.status());
    }
  }
  return {};
}

template <typename File>
Status readBytes(const File& file, std::uint64_t bytes) {
  AlignedBuffer buffer;
  for (std::uint64_t done = 0; done < bytes; done += kBlockBytes) {
    const std::size_t size = std::size_t(std::min<std::uint64_t>(kBlockBytes, bytes - done));
    SURFEIT_RETURN_IF_ERROR(file.readView(done, size, buffer).status());
  }
  return {};
}

// In a child: moves the bytes that indexing must move, and does nothing else.
Result<Json> copyBytes(const std::string& input, const std::string& output,
                       std::uint64_t temporary_bytes, std::uint64_t file_bytes) {
  auto start = std::chrono::steady_clock::now();
  Json report;
  const auto finishStep = [&](const char* step) {
    report[step] = secondsSince(start);
    start = std::chrono::steady_clock::now();
  };
  SURFEIT_ASSIGN_OR_RETURN(const InputFile cloud, InputFile::open(input, Access::kDirect));
  SURFEIT_RETURN_IF_ERROR(readBytes(cloud, cloud.size()));
  finishStep("read_input");
  if (temporary_bytes > 0) {
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile temporary, TemporaryFile::create(directoryOf(output)));
    SURFEIT_RETURN_IF_ERROR(appendBytes(temporary_bytes, temporary));
    SURFEIT_RETURN_IF_ERROR(temporary.flush());
    finishStep("write_temporary");
    SURFEIT_RETURN_IF_ERROR(readBytes(temporary, temporary_bytes));
    finishStep("read_temporary");
  }
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(output));
  SURFEIT_RETURN_IF_ERROR(appendBytes(file_bytes, file));
  SURFEIT_RETURN_IF_ERROR(file.commit());
  finishStep("write_output");
  std::filesystem::remove(output);
  return report;
}

// All runs of one number of threads and one budget.
struct Setting {
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  std::vector<ProcessResult> index_runs, copy_runs;  // in turn: one of each a repeat
};

Status runOnce(const BenchOptions& options, const std::string& input, Setting& setting) {
  const std::string output = options.path("index_bench.sft");
  IndexOptions index_options;
  index_options.threads = setting.threads;
  index_options.memory_bytes = setting.memory_bytes;
  forgetCached(input);
  SURFEIT_ASSIGN_OR_RETURN(ProcessResult indexed,
                           runInProcess([&] { return indexInput(input, output, index_options); }));
  forgetCached(input);
  const std::uint64_t temporary_bytes = indexed.report["temporary_bytes"];
  const std::uint64_t file_bytes = indexed.report["file_bytes"];
  SURFEIT_ASSIGN_OR_RETURN(ProcessResult copied, runInProcess([&] {
                             return copyBytes(input, output, temporary_bytes, file_bytes);
                           }));
  setting.index_runs.push_back(std::move(indexed));
  setting.copy_runs.push_back(std::move(copied));
  return {};
}

// The median of a value over runs; of an even number the mean of the middle two.
template <typename ValueOf>
double medianOf(const std::vector<ProcessResult>& runs, ValueOf valueOf) {
  std::vector<double> values;
  for (const ProcessResult& run : runs) values.push_back(valueOf(run));
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

double wallOf(const ProcessResult& run) { return run.wall_seconds; }
double cpuOf(const ProcessResult& run) { return run.cpu_seconds; }

double phaseOf(const ProcessResult& run, std::size_t phase) {
  return run.report["phases"][phase][1].get<double>();
}

// A row of the table, as fields: medians over the repeats.
Json summaryOf(const Setting& setting) {
  const Json& report = setting.index_runs.front().report;
  const double surfels = report["surfels"];
  const double wall = medianOf(setting.index_runs, wallOf);
  const double cpu = medianOf(setting.index_runs, cpuOf);
  const double copy = medianOf(setting.copy_runs, wallOf);
  const double file_bytes = report["file_bytes"];
  Json phases = Json::array();
  for (std::size_t i = 0; report.contains("phases") && i < report["phases"].size(); ++i) {
    phases.push_back(
        Json{report["phases"][i][0],
             medianOf(setting.index_runs, [i](const auto& run) { return phaseOf(run, i); })});
  }
  Json wall_runs, copy_runs;
  for (const ProcessResult& run : setting.index_runs) wall_runs.push_back(run.wall_seconds);
  for (const ProcessResult& run : setting.copy_runs) copy_runs.push_back(run.wall_seconds);
  return {{"threads", setting.threads},
          {"memory_bytes", setting.memory_bytes},
          {"surfels", report["surfels"]},
          {"wall_seconds", wall},
          {"cpu_seconds", cpu},
          {"surfels_per_second", surfels / wall},
          {"surfels_per_cpu_second", surfels / cpu},
          {"peak_resident_bytes",
           medianOf(setting.index_runs, [](const auto& run) { return double(run.peak_bytes); })},
          {"temporary_bytes", report["temporary_bytes"]},
          {"file_bytes", report["file_bytes"]},
          {"bytes_per_surfel", file_bytes / surfels},
          {"copy_seconds", copy},
          {"copy_cpu_seconds", medianOf(setting.copy_runs, cpuOf)},
          {"index_over_copy", wall / copy},
          {"phases", phases},
          {"directory_checksum", report["directory_checksum"]},
          {"wall_seconds_of_runs", wall_runs},
          {"copy_seconds_of_runs", copy_runs},
          {"copy_steps", setting.copy_runs.front().report}};
}

void printTable(const Json& rows) {
  fmt::print("\n{:>7} {:>9} {:>8} {:>8} {:>7} {:>8} {:>9} {:>9} {:>9} {:>7} {:>7} {:>6}  {}\n",
             "threads", "memory", "wall s", "CPU s", "M/s", "M/CPU-s", "peak MiB", "temp MiB",
             "out MiB", "B/surf", "copy s", "ratio", "phases");
  constexpr double kMiB = 1 << 20;
  for (const Json& row : rows) {
    const auto number = [&](const char* field) { return row[field].get<double>(); };
    std::string phases;
    for (const Json& phase : row["phases"]) {
      phases += fmt::format("{}{} {:.2f}", phases.empty() ? "" : ", ", phase[0].get<std::string>(),
                            phase[1].get<double>());
    }
    fmt::print(
        "{:>7} {:>9} {:>8.2f} {:>8.2f} {:>7.2f} {:>8.2f} {:>9.1f} {:>9.1f} {:>9.1f} {:>7.2f} "
        "{:>7.2f} {:>6.2f}  {}\n",
        row["threads"].get<int>(), formatBytes(row["memory_bytes"].get<std::uint64_t>()),
        number("wall_seconds"), number("cpu_seconds"), number("surfels_per_second") / 1e6,
        number("surfels_per_cpu_second") / 1e6, number("peak_resident_bytes") / kMiB,
        number("temporary_bytes") / kMiB, number("file_bytes") / kMiB, number("bytes_per_surfel"),
        number("copy_seconds"), number("index_over_copy"), phases);
  }
}

// kFailed when two settings wrote different octrees.
Status checkFiles(const std::vector<Setting>& settings) {
  const std::string expected = settings.front().index_runs.front().report["directory_checksum"];
  for (const Setting& setting : settings) {
    for (const ProcessResult& run : setting.index_runs) {
      const std::string found = run.report["directory_checksum"];
      if (found == expected) continue;
      return Status::failed(
          fmt::format("{} threads, {}: directory checksum {}, expected {} as before",
                      setting.threads, formatBytes(setting.memory_bytes), found, expected));
    }
  }
  return {};
}

Status runBench(const BenchOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(const std::string input, prepareInput(options));
  std::vector<Setting> settings;
  for (const int threads : options.threads) {
    for (const std::uint64_t memory : options.memory_bytes) {
      settings.push_back({threads, memory, {}, {}});
    }
  }
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    for (Setting& setting : settings) SURFEIT_RETURN_IF_ERROR(runOnce(options, input, setting));
  }
  Json rows = Json::array();
  for (const Setting& setting : settings) rows.push_back(summaryOf(setting));
  printTable(rows);
  if (!options.json_path.empty()) {
    const std::string text =
        Json{{"input", input}, {"repeats", options.repeats}, {"settings", rows}}.dump(2) + "\n";
    SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(options.json_path));
    SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(text))));
    SURFEIT_RETURN_IF_ERROR(file.commit());
  }
  return checkFiles(settings);
}

// Reads a text by a parser of Results; a failure is told by CLI11.
template <typename T>
T parsed(const char* option, Result<T> value) {
  if (!value.ok()) throw CLI::ValidationError(option, value.status().message());
  return std::move(*value);
}

int parseAndRun(int argc, char** argv) {
  BenchOptions options;
  std::string surfels = "10M", kind = "city", order = "scan";
  std::vector<std::string> memory;
  CLI::App app("Measures the whole of surfeit index on a generated scene");
  app.add_option("--surfels", surfels, "Surfels of the scene")->capture_default_str();
  app.add_option("--kind", kind, "terrain, city or volume")->capture_default_str();
  app.add_option("--order", order, "scan or shuffled")->capture_default_str();
  app.add_option("--dir", options.directory, "Directory of input, temporary files and output")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "Numbers of threads, such as 1,2")->delimiter(',');
  app.add_option("--memory", memory, "Budgets, such as 256M,1G")->delimiter(',');
  app.add_option("--repeat", options.repeats, "Runs of each setting; medians are told")
      ->check(CLI::Range(1, 1000));
  app.add_flag("--recipe", options.from_recipe, "Index the recipe: no input file is read");
  app.add_option("--json", options.json_path, "Write all figures to this file");
  try {
    app.parse(argc, argv);
    options.recipe.surfels = parsed("--surfels", parseSurfelCount(surfels));
    options.recipe.kind = parsed("--kind", parseSceneKind(kind));
    options.recipe.order = parsed("--order", parseRecordOrder(order));
    if (!memory.empty()) options.memory_bytes.clear();
    for (const std::string& size : memory) {
      options.memory_bytes.push_back(parsed("--memory", parseByteSize(size)));
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
  const Status status = runBench(options);
  if (status.ok()) return 0;
  fmt::print(stderr, "index_bench: {}\n", status.message());
  return 1;
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  // As the program does
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 256 << 10);
  return surfeit::parseAndRun(argc, argv);
}
