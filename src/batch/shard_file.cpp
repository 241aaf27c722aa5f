#include "batch/shard_file.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <utility>

#include "core/assert.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

using nlohmann::json;

constexpr std::array<char, 8> kMagic = {'S', 'R', 'F', 'S', 'H', 'A', 'R', 'D'};
constexpr std::uint32_t kShardVersion = 1;
constexpr std::uint32_t kMostTextBytes = 64 << 10;
constexpr std::size_t kBlockResults = 4096;

// What the file begins with; the text follows.
struct Preamble {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kShardVersion;
  std::uint32_t text_bytes = 0;
  std::uint64_t text_checksum = 0;
};
static_assert(sizeof(Preamble) == 24);

std::size_t recordBytes(std::uint32_t outputs) {
  return sizeof(std::uint64_t) + resultFloats(outputs) * sizeof(float);
}

// Of the results in it; a block elsewhere does not pass.
std::uint64_t blockChecksum(Bytes results, std::uint64_t number) {
  return XXH3_64bits_withSeed(results.data(), results.size(), number);
}

json toJson(const ShardHeader& header) {
  return {{"job", header.job},
          {"receivers_checksum", header.receivers_checksum},
          {"instruction_set", header.instruction_set},
          {"outputs", header.outputs},
          {"shard", header.shard},
          {"count", header.count},
          {"first_rank", header.first_rank},
          {"results", header.results},
          {"valid_receivers", header.valid_receivers},
          {"invalid_receivers", header.invalid_receivers}};
}

// False when the text is no header.
bool fromJson(const json& text, ShardHeader& header) {
  try {
    header.job = text.at("job");
    header.receivers_checksum = text.at("receivers_checksum").get<std::uint64_t>();
    header.instruction_set = text.at("instruction_set").get<std::string>();
    header.outputs = text.at("outputs").get<std::uint32_t>();
    header.shard = text.at("shard").get<int>();
    header.count = text.at("count").get<int>();
    header.first_rank = text.at("first_rank").get<std::uint64_t>();
    header.results = text.at("results").get<std::uint64_t>();
    header.valid_receivers = text.at("valid_receivers").get<std::uint64_t>();
    header.invalid_receivers = text.at("invalid_receivers").get<std::uint64_t>();
  } catch (const json::exception&) {
    return false;
  }
  return header.outputs != 0 && (header.outputs & ~kAllOutputs) == 0 && header.shard >= 1 &&
         header.shard <= header.count && header.results <= header.valid_receivers &&
         header.first_rank <= header.valid_receivers - header.results;
}

}  // namespace

Result<std::unique_ptr<ShardWriter>> ShardWriter::create(const std::string& path,
                                                         const ShardHeader& header) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  const std::string text = toJson(header).dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > kMostTextBytes) {
    return Status::invalidArgument(fmt::format("{}: {} bytes of options, expected at most {}", path,
                                               text.size(), kMostTextBytes));
  }
  Preamble preamble;
  preamble.text_bytes = static_cast<std::uint32_t>(text.size());
  preamble.text_checksum = XXH3_64bits(text.data(), text.size());
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(&preamble, 1))));
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(text))));
  return std::unique_ptr<ShardWriter>(new ShardWriter(std::move(file), header));
}

ShardWriter::ShardWriter(AtomicFile file, const ShardHeader& header)
    : file_(std::move(file)), outputs_(header.outputs), left_(header.results) {
  block_.reserve(kBlockResults * recordBytes(outputs_));
}

Status ShardWriter::put(std::span<const ResultStore::Entry> entries) {
  const std::lock_guard lock(mutex_);
  for (const ResultStore::Entry& entry : entries) {
    if (!failure_.ok()) break;
    SURFEIT_CHECK(left_ > 0);
    std::array<float, kResultFloats> packed;
    packResult(entry.result, outputs_, packed.data());
    const std::size_t at = block_.size();
    block_.resize(at + recordBytes(outputs_));
    std::memcpy(&block_[at], &entry.index, sizeof entry.index);
    std::memcpy(&block_[at + sizeof entry.index], packed.data(),
                recordBytes(outputs_) - sizeof entry.index);
    --left_;
    if (block_.size() == kBlockResults * recordBytes(outputs_) || left_ == 0) {
      failure_ = writeBlock();
    }
  }
  return failure_;
}

Status ShardWriter::writeBlock() {
  const std::uint64_t checksum = blockChecksum(block_, block_number_++);
  SURFEIT_RETURN_IF_ERROR(file_.append(std::as_bytes(std::span(&checksum, 1))));
  SURFEIT_RETURN_IF_ERROR(file_.append(block_));
  block_.clear();
  return {};
}

Status ShardWriter::finish() {
  SURFEIT_RETURN_IF_ERROR(failure_);
  SURFEIT_CHECK(left_ == 0);
  return file_.commit();
}

Result<ShardReader> ShardReader::open(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile file, InputFile::open(path));
  const auto refuse = [&](const std::string& what) {
    return Status::corruption(fmt::format("{}: {}", path, what));
  };
  Preamble preamble;
  SURFEIT_RETURN_IF_ERROR(file.readAt(0, std::as_writable_bytes(std::span(&preamble, 1))));
  if (preamble.magic != kMagic) return refuse("not a shard of a gather");
  if (preamble.version != kShardVersion) {
    return refuse(fmt::format("shard of version {}, expected {}: gather it again", preamble.version,
                              kShardVersion));
  }
  if (preamble.text_bytes > kMostTextBytes) {
    return refuse(fmt::format("header at 12: {} bytes, expected at most {}", preamble.text_bytes,
                              kMostTextBytes));
  }
  std::string text(preamble.text_bytes, '\0');
  SURFEIT_RETURN_IF_ERROR(
      file.readAt(sizeof preamble, std::as_writable_bytes(std::span(text.data(), text.size()))));
  const std::uint64_t checksum = XXH3_64bits(text.data(), text.size());
  if (checksum != preamble.text_checksum) {
    return refuse(fmt::format("header at 24: checksum {:016x}, expected {:016x}", checksum,
                              preamble.text_checksum));
  }
  ShardHeader header;
  if (!fromJson(json::parse(text, nullptr, false), header)) {
    return refuse("header at 24: not that of a shard");
  }
  const std::uint64_t begin = sizeof preamble + text.size();
  const std::uint64_t results = header.results, record = recordBytes(header.outputs);
  const std::uint64_t most = (std::numeric_limits<std::uint64_t>::max() / 2) / record;
  const std::uint64_t blocks = results / kBlockResults + (results % kBlockResults != 0);
  const std::uint64_t expected =
      begin + std::min(results, most) * record + blocks * sizeof(std::uint64_t);
  if (results > most || file.size() != expected) {
    return refuse(
        fmt::format("{} bytes, expected {} for {} results", file.size(), expected, results));
  }
  return ShardReader(std::move(file), std::move(header), begin);
}

ShardReader::ShardReader(InputFile file, ShardHeader header, std::uint64_t first_block)
    : file_(std::move(file)),
      header_(std::move(header)),
      offset_(first_block),
      left_(header_.results) {}

Status ShardReader::next(std::vector<ResultStore::Entry>& entries) {
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(left_, kBlockResults));
  entries.resize(count);
  if (count == 0) return {};
  const std::size_t record = recordBytes(header_.outputs);
  std::uint64_t expected = 0;
  block_.resize(count * record);
  SURFEIT_RETURN_IF_ERROR(file_.readAt(offset_, std::as_writable_bytes(std::span(&expected, 1))));
  SURFEIT_RETURN_IF_ERROR(file_.readAt(offset_ + sizeof expected, block_));
  const std::uint64_t found = blockChecksum(block_, block_number_++);
  if (found != expected) {
    return Status::corruption(
        fmt::format("{}: {} results at {}: checksum {:016x}, expected {:016x}", path(), count,
                    offset_, found, expected));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::byte* const at = &block_[i * record];
    std::array<float, kResultFloats> packed;
    std::memcpy(&entries[i].index, at, sizeof entries[i].index);
    std::memcpy(packed.data(), at + sizeof entries[i].index, record - sizeof entries[i].index);
    entries[i].result = unpackResult(packed.data(), header_.outputs);
  }
  offset_ += sizeof expected + block_.size();
  left_ -= count;
  return {};
}

Status ShardReader::check() {
  std::vector<ResultStore::Entry> entries;
  do {
    SURFEIT_RETURN_IF_ERROR(next(entries));
  } while (!entries.empty());
  return {};
}

}  // namespace surfeit
