// What each number of the gather (gather/rules/fidelity.h) is worth: errors with it as it is, .7
// and 1.4 times as large, and as it would be without the rule, over three sets of scenes: those by
// which errors are reported, those that nothing was chosen by, and scenes by chance.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/internal/embree_truth.h"
#include "bench/internal/gather_measure.h"
#include "bench/internal/gather_scenes.h"
#include "core/job_limits.h"
#include "gather/rules/fidelity.h"
#include "random/indexed_scene.h"
#include "random/random_scene.h"
#include "random/result_differences.h"

namespace surfeit {
namespace {

// A number, and what it is without its rule, if that can be said.
struct Number {
  const char* name;
  float Fidelity::*member;
  std::optional<float> without{};
};

const std::vector<Number>& allNumbers() {
  using F = Fidelity;
  constexpr float kNever = 1e9f;
  static const std::vector<Number> numbers = {
      {"horizon_slope", &F::horizon_slope, 0},
      {"uneven_share", &F::uneven_share, 1},
      {"fading", &F::fading, 1e-4f},
      {"most_node_pixels", &F::most_node_pixels, kNever},
      {"least_visible_part", &F::least_visible_part, 0},
      {"shared_look", &F::shared_look, 0},
      {"own_order", &F::own_order, 0},
      {"least_filled", &F::least_filled, 0},
      {"fill_doubt", &F::fill_doubt, 0},
      {"hull_widening", &F::hull_widening, 0},
      {"most_in_hull", &F::most_in_hull, 0},
      {"soft_disk_area", &F::soft_disk_area, 1},
      {"least_axis", &F::least_axis, 0.01f},
      {"least_spread", &F::least_spread, 1e-6f},
  };
  return numbers;
}

struct SensitivityOptions {
  SceneOptions place{};
  std::vector<std::string> scenes, unseen;
  std::vector<std::string> numbers, changes;
  GatherQuality quality;
  std::uint64_t seeds = 200, first_seed = 10'000;
  int rays = 4096;
  int threads = 0;
  bool as_is = false;  // no number changed
};

struct Errors {
  double rmse = 0, bias = 0, color = 0, worst = 0;
};

// Something that is gathered at, with true values. Parts are gathered apart.
class Judged {
 public:
  virtual ~Judged() = default;
  virtual std::size_t parts() const { return 1; }
  virtual Result<std::vector<GatherResult>> gather(const GatherQuality& quality,
                                                   std::size_t part) = 0;
  // Of the results of all parts, one after the other.
  virtual Errors judge(std::span<const GatherResult> results) const = 0;
};

class JudgedScene : public Judged {
 public:
  // Every second run of dense receivers, a quarter of each.
  static Result<std::unique_ptr<Judged>> make(const std::string& name,
                                              const SensitivityOptions& options) {
    Progress quiet;
    SURFEIT_ASSIGN_OR_RETURN(const GatherScene scene,
                             GatherScene::open(name, options.place, quiet));
    auto judged = std::make_unique<JudgedScene>();
    SURFEIT_ASSIGN_OR_RETURN(judged->octree_, scene.openOctree(options.threads));
    SURFEIT_ASSIGN_OR_RETURN(const ReceiverSet all, denseReceivers(judged->octree_->file()));
    ReceiverSet set = {.name = "sensitivity", .run_length = kRun};
    for (std::size_t begin = 0; begin + all.run_length <= all.receivers.size();
         begin += kRunsApart * all.run_length) {
      if (set.receivers.size() % (kPartRuns * kRun) == 0)
        judged->sets_.push_back({.name = "part", .run_length = kRun});
      ReceiverSet& part = judged->sets_.back();
      for (std::size_t i = begin; i < begin + kRun; ++i) {
        if ((i - begin) % kJudgedApart == 0) {
          set.judged.push_back(std::uint32_t(set.receivers.size()));
          part.judged.push_back(std::uint32_t(part.receivers.size()));
        }
        set.receivers.push_back(all.receivers[i]);
        part.receivers.push_back(all.receivers[i]);
      }
    }
    SURFEIT_ASSIGN_OR_RETURN(judged->truth_,
                             traceTruth(scene, set, {.rays = options.rays, .threads = 1}));
    return std::unique_ptr<Judged>(std::move(judged));
  }

  std::size_t parts() const override { return sets_.size(); }
  Result<std::vector<GatherResult>> gather(const GatherQuality& quality,
                                           std::size_t part) override {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<GatherEngine> engine,
                             makeEngine("packet", GatherMode::kBleeding, quality));
    EngineWorker worker(std::move(engine), *octree_);
    return gatherJudged(sets_[part], engineBlock("packet"), worker);
  }
  Errors judge(std::span<const GatherResult> results) const override {
    const ErrorSummary summary = summarise(results, truth_);
    return Errors{summary.rmse, summary.bias, summary.color_rmse, summary.max};
  }

 private:
  static constexpr std::size_t kRun = 256, kRunsApart = 2, kJudgedApart = 8, kPartRuns = 4;
  std::unique_ptr<PagedOctree> octree_;
  std::vector<ReceiverSet> sets_;
  std::vector<GatherResult> truth_;
};

// Judged by the gather of every surfel. Rays on the true geometry would measure the
// sampling, because these scenes have few surfels.
class JudgedSeed : public Judged {
 public:
  static Result<std::unique_ptr<Judged>> make(std::uint64_t seed,
                                              const SensitivityOptions& options) {
    auto judged = std::make_unique<JudgedSeed>();
    const RandomScene scene = makeRandomScene(seed);
    judged->sides_ = seed % 3 == 0 ? GatherSides::kBoth : GatherSides::kFront;
    if (scene.surfels.empty()) return std::unique_ptr<Judged>(std::move(judged));
    judged->receivers_ = scene.plainReceivers();
    SURFEIT_ASSIGN_OR_RETURN(judged->indexed_, IndexedScene::make(scene.surfels));
    GatherQuality exact = options.quality;
    exact.max_solid_angle = 0, exact.sides = judged->sides_;
    SURFEIT_ASSIGN_OR_RETURN(
        judged->truth_,
        judged->indexed_->gatherAlone(judged->receivers_, {GatherMode::kBleeding, exact}));
    return std::unique_ptr<Judged>(std::move(judged));
  }

  Result<std::vector<GatherResult>> gather(const GatherQuality& given, std::size_t) override {
    if (receivers_.empty()) return std::vector<GatherResult>();
    GatherQuality quality = given;
    quality.sides = sides_;
    return indexed_->gatherTogether(receivers_, {GatherMode::kBleeding, quality});
  }
  Errors judge(std::span<const GatherResult> results) const override {
    if (results.empty()) return {};
    const ResultDifferences found = differencesOf(results, truth_);
    return Errors{found.rms, found.bias, found.irradiance_rms, found.worst};
  }

 private:
  std::vector<LocalReceiver> receivers_;
  std::unique_ptr<IndexedScene> indexed_;
  std::vector<GatherResult> truth_;
  GatherSides sides_ = GatherSides::kFront;
};

struct JudgedSet {
  std::string name;
  std::vector<std::string> names;
  std::vector<std::unique_ptr<Judged>> members;
};

// Calls work(i) for all i below count on `threads` threads; the first failure.
template <typename Work>
Status forAll(std::size_t count, int threads, const Work& work) {
  std::atomic<std::size_t> next = 0;
  std::vector<Status> statuses(count);
  std::vector<std::jthread> running;
  for (int thread = 0; thread < threads; ++thread) {
    running.emplace_back([&] {
      for (std::size_t i = next++; i < count; i = next++) statuses[i] = work(i);
    });
  }
  running.clear();
  for (Status& status : statuses) SURFEIT_RETURN_IF_ERROR(std::move(status));
  return {};
}

// Of a set: geometric means over its scenes, so that each counts alike, but for bias, the mean of
// absolute values; and the 95 % of the RMSEs.
struct SetErrors {
  double rmse = 0, bias = 0, color = 0, high = 0;
};

Result<std::vector<SetErrors>> judgeAll(std::vector<JudgedSet>& sets,
                                        const SensitivityOptions& options,
                                        std::vector<std::vector<Errors>>* each = nullptr) {
  struct Part {
    Judged* of;
    Errors* errors;
    std::size_t number;
  };
  std::vector<Part> parts;
  std::vector<std::vector<Errors>> errors;
  for (const JudgedSet& set : sets) errors.emplace_back(set.members.size());
  for (std::size_t s = 0; s < sets.size(); ++s) {
    for (std::size_t i = 0; i < sets[s].members.size(); ++i) {
      Judged& member = *sets[s].members[i];
      for (std::size_t k = 0; k < member.parts(); ++k) parts.push_back({&member, &errors[s][i], k});
    }
  }
  std::vector<std::vector<GatherResult>> results(parts.size());
  SURFEIT_RETURN_IF_ERROR(forAll(parts.size(), options.threads, [&](std::size_t i) -> Status {
    SURFEIT_ASSIGN_OR_RETURN(results[i], parts[i].of->gather(options.quality, parts[i].number));
    return {};
  }));
  for (std::size_t i = 0; i < parts.size();) {
    std::vector<GatherResult> all;
    const Part& first = parts[i];
    for (; i < parts.size() && parts[i].of == first.of; ++i) {
      all.insert(all.end(), results[i].begin(), results[i].end());
    }
    *first.errors = first.of->judge(all);
  }
  constexpr double kLeast = 1e-3;  // less is right
  std::vector<SetErrors> sums;
  for (const std::vector<Errors>& of_set : errors) {
    SetErrors sum;
    std::vector<double> all;
    const double count = double(std::max<std::size_t>(of_set.size(), 1));
    for (const Errors& one : of_set) {
      sum.rmse += std::log(std::max(one.rmse, kLeast)) / count;
      sum.bias += std::abs(one.bias) / count;
      sum.color += std::log(std::max(one.color, kLeast)) / count;
      all.push_back(one.rmse);
    }
    sum.rmse = std::exp(sum.rmse), sum.color = std::exp(sum.color);
    sum.high = quantile(all, 0.95);
    sums.push_back(sum);
  }
  if (each != nullptr) *each = std::move(errors);
  return sums;
}

Status prepare(const SensitivityOptions& options, std::vector<JudgedSet>& sets) {
  sets.push_back({"reported", options.scenes, {}});
  sets.push_back({"unseen", options.unseen, {}});
  sets.push_back({"random", {}, {}});
  for (std::uint64_t i = 0; i < options.seeds; ++i) {
    sets.back().names.push_back(std::to_string(options.first_seed + i));
  }
  for (std::size_t s = 0; s < sets.size(); ++s) {
    JudgedSet& set = sets[s];
    if (s < 2) {
      std::erase_if(set.names, [&](const std::string& name) {
        const std::string missing = missingSceneFile(name, options.place);
        if (missing.empty()) return false;
        fmt::print(stderr, "sensitivity: scene {} skipped: no {} (--data)\n", name, missing);
        return true;
      });
    }
    set.members.resize(set.names.size());
    SURFEIT_RETURN_IF_ERROR(forAll(set.names.size(), options.threads, [&](std::size_t i) -> Status {
      if (s < 2) {
        SURFEIT_ASSIGN_OR_RETURN(set.members[i], JudgedScene::make(set.names[i], options));
      } else {
        SURFEIT_ASSIGN_OR_RETURN(set.members[i], JudgedSeed::make(options.first_seed + i, options));
      }
      return {};
    }));
  }
  return {};
}

void printAsIs(const std::vector<JudgedSet>& sets, const std::vector<SetErrors>& errors,
               const std::vector<std::vector<Errors>>& each) {
  for (std::size_t s = 0; s < sets.size(); ++s) {
    fmt::print("{:<10} RMSE {:.4f}, |bias| {:.4f}, color {:.4f}, 95 % of RMSEs {:.4f}\n",
               sets[s].name, errors[s].rmse, errors[s].bias, errors[s].color, errors[s].high);
    if (s == 2) continue;
    for (std::size_t i = 0; i < sets[s].names.size(); ++i) {
      const Errors& one = each[s][i];
      fmt::print("  {:<10} RMSE {:.4f}, bias {:+.4f}, color {:.4f}, worst {:.3f}\n",
                 sets[s].names[i], one.rmse, one.bias, one.color, one.worst);
    }
  }
}

// Changes in %: of the three sets, RMSE, bias (over the RMSE), color, the high RMSEs.
void printChange(const std::string& name, float value, const std::vector<SetErrors>& before,
                 const std::vector<SetErrors>& after) {
  fmt::print("{:<26} {:>9.4g} ", name, value);
  double most = 0;
  for (std::size_t s = 0; s < before.size(); ++s) {
    const auto part = [&](double from, double to, double of) {
      const double change = of > 0 ? 100 * (to - from) / of : 0;
      most = std::max(most, std::abs(change));
      return change;
    };
    fmt::print(" | {:+6.1f} {:+6.1f} {:+6.1f}", part(before[s].rmse, after[s].rmse, before[s].rmse),
               part(before[s].bias, after[s].bias, before[s].rmse),
               part(before[s].color, after[s].color, before[s].color));
  }
  fmt::print(" | {:6.1f}\n", most);
  std::fflush(stdout);
}

// "fading=0,fill_doubt=0"
Status applyChange(const std::string& change) {
  std::size_t begin = 0;
  while (begin < change.size()) {
    const std::size_t end = std::min(change.find(',', begin), change.size());
    const std::string one = change.substr(begin, end - begin);
    const std::size_t equals = one.find('=');
    const auto number =
        std::find_if(allNumbers().begin(), allNumbers().end(),
                     [&](const Number& each) { return one.compare(0, equals, each.name) == 0; });
    if (equals == std::string::npos || number == allNumbers().end()) {
      return Status::invalidArgument(fmt::format("{}: expected a number's name=value", one));
    }
    kFidelity.*number->member = std::stof(one.substr(equals + 1));
    begin = end + 1;
  }
  return {};
}

Status run(const SensitivityOptions& options) {
  std::vector<JudgedSet> sets;
  SURFEIT_RETURN_IF_ERROR(prepare(options, sets));
  if (options.as_is) {
    for (const std::string& change : options.changes) SURFEIT_RETURN_IF_ERROR(applyChange(change));
  }
  std::vector<std::vector<Errors>> each;
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<SetErrors> before, judgeAll(sets, options, &each));
  printAsIs(sets, before, each);
  if (options.as_is) return {};
  fmt::print("\n{:<26} {:>9}   {:^20} | {:^20} | {:^20} | most\n", "", "value", "reported",
             "unseen", "random");
  for (const std::string& change : options.changes) {
    const Fidelity usual = kFidelity;
    SURFEIT_RETURN_IF_ERROR(applyChange(change));
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<SetErrors> after, judgeAll(sets, options));
    printChange(change, 0, before, after);
    kFidelity = usual;
  }
  if (options.numbers.empty() && !options.changes.empty()) return {};
  for (const Number& number : allNumbers()) {
    const auto& wanted = options.numbers;
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), number.name) == wanted.end()) {
      continue;
    }
    const float usual = kFidelity.*number.member;
    std::vector<float> values = {0.7f * usual, 1.4f * usual};
    if (number.without) values.push_back(*number.without);
    for (const float value : values) {
      kFidelity.*number.member = value;
      SURFEIT_ASSIGN_OR_RETURN(const std::vector<SetErrors> after, judgeAll(sets, options));
      printChange(number.name, value, before, after);
    }
    kFidelity.*number.member = usual;
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::SensitivityOptions options;
  options.place.surfels = 1'000'000;
  options.scenes = surfeit::gatherSceneNames();
  options.unseen = surfeit::unseenSceneNames();
  options.threads = surfeit::defaultThreadCount();
  CLI::App app("What each number of the gather is worth.");
  app.add_option("--scene", options.scenes, "Scenes that errors are reported for");
  app.add_option("--unseen", options.unseen, "Scenes that nothing was chosen by");
  app.add_option("--seeds", options.seeds, "Scenes by chance")->capture_default_str();
  app.add_option("--first-seed", options.first_seed, "The first of them")->capture_default_str();
  app.add_option("--number", options.numbers, "Numbers to change [all]");
  app.add_option("--change", options.changes, "Several at once, \"fading=0,fill_doubt=0\"");
  app.add_flag("--as-is", options.as_is, "Print errors of each scene, with --change");
  app.add_option("--surfels", options.place.surfels, "Of each scene")->capture_default_str();
  app.add_option("--data", options.place.data, "Directory of meshes")->capture_default_str();
  app.add_option("--keep", options.place.keep, "Directory for scenes and true values [none]");
  app.add_option("--rays", options.rays, "Rays of a true value, (4 n)^2")->capture_default_str();
  app.add_option("--threads", options.threads, "Scenes at a time")->capture_default_str();
  app.add_option("--max-solid-angle", options.quality.max_solid_angle)->capture_default_str();
  app.add_option("--raster-resolution", options.quality.raster_resolution)->capture_default_str();
  app.footer(
      "Of each set: changes of RMSE of occlusion, of its bias over the RMSE, and of color, in %.\n"
      "Examples:\n"
      "  sensitivity --keep scenes\n"
      "  sensitivity --number fading fill_doubt --scene city --unseen koala --seeds 50");
  CLI11_PARSE(app, argc, argv);
  const surfeit::Status status = surfeit::run(options);
  if (status.ok()) return 0;
  fmt::print(stderr, "sensitivity: {}\n", status.message());
  return 1;
}
