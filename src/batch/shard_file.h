// Results of a shard on their way to the merge (docs/format.md, "Shards of a gather"). All bytes
// are under a checksum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "batch/result_store.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// What the header of a shard says.
struct ShardHeader {
  nlohmann::json job;  // its identity
  std::uint64_t receivers_checksum = 0;
  std::string instruction_set;  // that it was gathered with
  std::uint32_t outputs = 0;
  int shard = 0, count = 0;
  std::uint64_t first_rank = 0;         // of its first receiver among all valid ones
  std::uint64_t results = 0;            // valid receivers in it
  std::uint64_t valid_receivers = 0;    // in all shards
  std::uint64_t invalid_receivers = 0;  // in the cloud
};

class ShardWriter {
 public:
  // Errors, here and below: as AtomicFile.
  static Result<std::unique_ptr<ShardWriter>> create(const std::string& path,
                                                     const ShardHeader& header);

  // From any thread; in all, as many results as the header says.
  Status put(std::span<const ResultStore::Entry> entries);
  // The file appears.
  Status finish();

 private:
  ShardWriter(AtomicFile file, const ShardHeader& header);
  Status writeBlock();

  std::mutex mutex_;
  AtomicFile file_;
  const std::uint32_t outputs_;
  std::uint64_t left_;  // results to come
  std::uint64_t block_number_ = 0;
  std::vector<std::byte> block_;
  Status failure_;
};

class ShardReader {
 public:
  // Checks the header, and that the file is as long as it says. kCorruption names file and place.
  static Result<ShardReader> open(const std::string& path);

  const ShardHeader& header() const { return header_; }
  const std::string& path() const { return file_.path(); }

  // Replaces `entries` by the next results; none at the end. kCorruption for bytes that do not fit
  // their checksum.
  Status next(std::vector<ResultStore::Entry>& entries);
  // Reads all results, and drops them.
  Status check();

 private:
  ShardReader(InputFile file, ShardHeader header, std::uint64_t first_block);

  InputFile file_;
  ShardHeader header_;
  std::uint64_t offset_;
  std::uint64_t left_;  // results
  std::uint64_t block_number_ = 0;
  std::vector<std::byte> block_;
};

}  // namespace surfeit
