// A file of an index in shards: bytes, and behind them facts about them as JSON. It appears whole,
// and all of it is under checksums. It lives as long as a job of one version of the program;
// docs/format.md has nothing of it.
//
//   [ payload | facts | footer : 48 ]
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "storage/file.h"
#include "surfeit/index_shards.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

struct XXH3_state_s;

namespace surfeit {

// That of a pass; `round`: of the count, which is repeated about another origin.
std::string indexShardPath(const std::string& scene_path, IndexPass pass, int shard, int count,
                           int round);

// As on the command line.
const char* passName(IndexPass pass);

// XXH3-64.
std::uint64_t checksumOf(Bytes bytes);

class IndexShardWriter {
 public:
  // Errors, here and below: as AtomicFile.
  static Result<IndexShardWriter> create(const std::string& path);

  Status append(Bytes payload);
  std::uint64_t payloadBytes() const { return file_.size(); }
  // The file appears. Returns its bytes.
  Result<std::uint64_t> finish(const nlohmann::json& facts);

 private:
  struct Deleter {
    void operator()(XXH3_state_s* hash) const;
  };
  using Hash = std::unique_ptr<XXH3_state_s, Deleter>;
  IndexShardWriter(AtomicFile file, Hash hash) : file_(std::move(file)), hash_(std::move(hash)) {}

  AtomicFile file_;
  Hash hash_;  // of the payload so far
};

class IndexShardReader {
 public:
  // Checks all but the payload. kCorruption names file and place.
  static Result<IndexShardReader> open(const std::string& path);

  const std::string& path() const { return file_.path(); }
  const nlohmann::json& facts() const { return facts_; }
  std::uint64_t payloadBytes() const { return payload_bytes_; }
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes) const;
  // Reads all of the payload. kCorruption for bytes that do not fit their checksum.
  Status check(const Progress& progress) const;

 private:
  IndexShardReader(InputFile file, nlohmann::json facts, std::uint64_t bytes,
                   std::uint64_t checksum)
      : file_(std::move(file)),
        facts_(std::move(facts)),
        payload_bytes_(bytes),
        payload_checksum_(checksum) {}

  InputFile file_;
  nlohmann::json facts_;
  std::uint64_t payload_bytes_;
  std::uint64_t payload_checksum_;
};

}  // namespace surfeit
