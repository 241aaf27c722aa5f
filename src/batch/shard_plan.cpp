#include "batch/shard_plan.h"

#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <utility>

#include "batch/sorted_receiver.h"
#include "gather/cut/cut.h"
#include "gather/cut/packet_cost.h"
#include "gather/packet/group_gatherer.h"
#include "octree/read/paged_octree.h"
#include "storage/file.h"

namespace surfeit {
namespace {

using nlohmann::json;

// Groups of receivers whose cost is foreseen: at least so many, and so many of each shard. Shards
// begin at one of them.
constexpr std::uint64_t kLeastSamples = 4096, kSamplesPerShard = 16;
// A boundary as text, and what a plan holds beside them, at most.
constexpr std::uint64_t kBoundaryBytes = 80, kPlanBytes = 256 << 10;

// What one receiver costs, and with it its neighbours.
class CostOfReceiver {
 public:
  CostOfReceiver(PagedOctree& octree, const GatherRules& rules)
      : rules_(rules), reader_(octree), cut_(std::make_unique<CutWalk>(rules)), cost_(rules) {}

  Result<double> operator()(const LocalReceiver& receiver) {
    const std::span<const LocalReceiver> one(&receiver, 1);
    cost_.begin(receiver.position);
    SURFEIT_RETURN_IF_ERROR(cut_->walk(viewPacket(one, rules_), one, reader_, cost_));
    return double(cost_.cost(0));
  }

 private:
  const GatherRules rules_;
  PagedOctree::Reader reader_;
  std::unique_ptr<CutWalk> cut_;
  PacketCost cost_;
};

struct Sample {
  ShardPlan::Boundary boundary;
  double cost_before = 0;  // of all receivers before it
};

// Groups at equal steps, each of which stands for the receivers up to the next.
class Sampling {
 public:
  Sampling(PagedOctree& octree, const GatherRules& rules, std::uint64_t receivers, int count)
      : cost_of_(octree, rules) {
    const std::uint64_t group = GroupGatherer::groupSize(rules);
    const std::uint64_t groups = (receivers + group - 1) / group;
    const std::uint64_t wanted =
        std::max(kLeastSamples, kSamplesPerShard * static_cast<std::uint64_t>(count));
    step_ = group * std::max<std::uint64_t>(groups / wanted, 1);
  }

  Status add(std::span<const SortedReceiver> receivers) {
    for (const SortedReceiver& receiver : receivers) {
      if (rank_ % step_ == 0) {
        samples_.push_back({{rank_, {receiver.key, receiver.index}}, cost_});
        SURFEIT_ASSIGN_OR_RETURN(receiver_cost_, cost_of_(receiver.receiver));
      }
      cost_ += receiver_cost_;
      ++rank_;
    }
    return {};
  }

  std::uint64_t count() const { return rank_; }

  std::vector<ShardPlan::Boundary> boundaries(int shards) const {
    std::vector<ShardPlan::Boundary> boundaries;
    auto at = samples_.begin();
    for (int shard = 0; shard < shards; ++shard) {
      const double before = cost_ * shard / shards;
      at = std::lower_bound(at, samples_.end(), before, [](const Sample& sample, double cost) {
        return sample.cost_before < cost;
      });
      boundaries.push_back(at == samples_.end() ? end() : at->boundary);
    }
    boundaries.push_back(end());
    return boundaries;
  }

 private:
  ShardPlan::Boundary end() const { return {rank_, OrderRange::kEnd}; }

  CostOfReceiver cost_of_;
  std::uint64_t step_ = 1, rank_ = 0;
  double cost_ = 0, receiver_cost_ = 0;
  std::vector<Sample> samples_;
};

// The line behind the plan.
std::string checksumOf(const std::string& text) {
  return fmt::format("{:016x}", XXH3_64bits(text.data(), text.size()));
}

std::string hexOf(std::span<const std::uint64_t> numbers) {
  std::string text;
  for (const std::uint64_t number : numbers) text += fmt::format("{:016x}", number);
  return text;
}

std::vector<std::uint64_t> numbersOf(const std::string& hex) {
  std::vector<std::uint64_t> numbers(hex.size() / 16);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = std::strtoull(hex.substr(16 * i, 16).c_str(), nullptr, 16);
  }
  return numbers;
}

json toJson(const ShardPlan& plan) {
  json boundaries = json::array();
  for (const auto& [rank, place] : plan.boundaries) {
    boundaries.push_back({rank, place.key, place.index});
  }
  return {{"job", plan.job},
          {"receivers_checksum", plan.receivers_checksum},
          {"valid_receivers", plan.valid_receivers},
          {"invalid_receivers", plan.invalid_receivers},
          {"boundaries", std::move(boundaries)},
          {"block_checksums", hexOf(plan.blocks.checksums)},
          {"block_shards", hexOf(plan.blocks.shards)}};
}

std::optional<ShardPlan> fromJson(const json& text, int count) {
  ShardPlan plan;
  try {
    plan.job = text.at("job");
    plan.receivers_checksum = text.at("receivers_checksum").get<std::uint64_t>();
    plan.valid_receivers = text.at("valid_receivers").get<std::uint64_t>();
    plan.invalid_receivers = text.at("invalid_receivers").get<std::uint64_t>();
    for (const json& boundary : text.at("boundaries")) {
      plan.boundaries.push_back(
          {boundary.at(0).get<std::uint64_t>(),
           {boundary.at(1).get<CurveKey>(), boundary.at(2).get<std::uint64_t>()}});
    }
    plan.blocks.checksums = numbersOf(text.at("block_checksums").get<std::string>());
    plan.blocks.shards = numbersOf(text.at("block_shards").get<std::string>());
  } catch (const json::exception&) {
    return std::nullopt;
  }
  if (plan.blocks.checksums.size() != plan.blocks.shards.size()) return std::nullopt;
  const auto& boundaries = plan.boundaries;
  const bool is_plan =
      boundaries.size() == static_cast<std::size_t>(count) + 1 && boundaries[0].rank == 0 &&
      boundaries.back().rank == plan.valid_receivers &&
      boundaries.back().place == OrderRange::kEnd &&
      std::is_sorted(boundaries.begin(), boundaries.end(), [](const auto& a, const auto& b) {
        return a.rank < b.rank || a.place < b.place;
      });
  if (!is_plan) return std::nullopt;
  return plan;
}

// The shards of which each block of `rows` rows has receivers; reads the sorter to the end.
Result<std::vector<std::uint64_t>> shardsOfBlocks(ExternalSorter& sorter, const ShardPlan& plan,
                                                  std::uint64_t rows, Progress& progress) {
  std::vector<std::uint64_t> shards(blockCount(rows), 0);
  std::vector<SortedReceiver> block(kQueueReceivers);
  int shard = 1;
  std::uint64_t rank = 0;
  for (std::size_t read = 1; read > 0;) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(read, sorter.next(block));
    for (const SortedReceiver& receiver : std::span(block).first(read)) {
      while (plan.firstRank(shard) + plan.results(shard) <= rank) ++shard;
      shards[receiver.index / blockRows(rows)] |= plan.bits(shard, shard);
      ++rank;
    }
    progress.advance(read);
  }
  return shards;
}

}  // namespace

Result<ShardPlan> planShards(SceneFile scene, const GatherJob& job, ExternalSorter& sorter,
                             int count, Progress& progress) {
  PagedOctree::Memory memory = job.memory().caches;
  memory.tracked_pages = 0;
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory));
  ShardPlan plan;
  const bool has_blocks = count > 1 && job.input().reader().isSeekable();
  progress.beginPhase("plan shards", (has_blocks ? 2 : 1) * sorter.count(), "receivers");
  const ExternalSorter::Mark begin = sorter.mark();
  {
    Sampling sampling(*octree, GatherRules(job.options()), sorter.count(), count);
    std::vector<SortedReceiver> block(kQueueReceivers);
    for (std::size_t read = 1; read > 0;) {
      if (progress.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(read, sorter.next(block));
      SURFEIT_RETURN_IF_ERROR(sampling.add(std::span(block).first(read)));
      progress.advance(read);
    }
    plan.valid_receivers = sampling.count();
    plan.boundaries = sampling.boundaries(count);
  }
  if (has_blocks) {
    SURFEIT_RETURN_IF_ERROR(sorter.reset(begin));
    plan.blocks.checksums = job.input().blocks().checksums;
    SURFEIT_ASSIGN_OR_RETURN(plan.blocks.shards,
                             shardsOfBlocks(sorter, plan, job.input().receiverCount(), progress));
  }
  plan.receivers_checksum = job.input().checksum();
  plan.invalid_receivers = job.input().defects().total();
  return plan;
}

Status writeShardPlan(const std::string& path, const ShardPlan& plan) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  const std::string text = toJson(plan).dump() + "\n", bytes = text + checksumOf(text) + "\n";
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(bytes))));
  return file.commit();
}

Result<std::optional<ShardPlan>> readShardPlan(const std::string& path, int count) {
  if (access(path.c_str(), F_OK) != 0) return std::optional<ShardPlan>();
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  if (file.size() > kPlanBytes + kBoundaryBytes * (static_cast<std::uint64_t>(count) + 1)) {
    return std::optional<ShardPlan>();
  }
  std::string bytes(static_cast<std::size_t>(file.size()), '\0');
  SURFEIT_RETURN_IF_ERROR(
      file.readAt(0, std::as_writable_bytes(std::span(bytes.data(), bytes.size()))));
  const std::string text = bytes.substr(0, bytes.find('\n') + 1);
  if (bytes != text + checksumOf(text) + "\n") return std::optional<ShardPlan>();
  return fromJson(json::parse(text, nullptr, false), count);
}

}  // namespace surfeit
