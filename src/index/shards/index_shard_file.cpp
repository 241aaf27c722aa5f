#include "index/shards/index_shard_file.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <new>
#include <utility>
#include <vector>

namespace surfeit {
namespace {

constexpr std::array<char, 8> kMagic = {'S', 'R', 'F', 'I', 'N', 'D', 'E', 'X'};
constexpr std::uint32_t kIndexShardVersion = 1;
constexpr std::uint32_t kMostFactsBytes = 1 << 20;
constexpr std::size_t kCheckBytes = 4 << 20;

// What the file ends with.
struct Footer {
  std::uint64_t payload_bytes = 0, payload_checksum = 0, facts_checksum = 0;
  std::uint32_t facts_bytes = 0, reserved = 0;
  std::uint32_t version = kIndexShardVersion, reserved_too = 0;
  std::array<char, 8> magic = kMagic;
};
static_assert(sizeof(Footer) == 48);

}  // namespace

void IndexShardWriter::Deleter::operator()(XXH3_state_s* hash) const { XXH3_freeState(hash); }

std::uint64_t checksumOf(Bytes bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

const char* passName(IndexPass pass) {
  constexpr const char* kNames[] = {"count", "distribute", "build", "places", "sizes"};
  return kNames[std::size_t(pass)];
}

std::string indexShardPath(const std::string& scene_path, IndexPass pass, int shard, int count,
                           int round) {
  constexpr const char* kWords[] = {"count", "ranges", "slabs", "places", "sized"};
  std::string name = kWords[std::size_t(pass)];
  if (round > 1) name += std::to_string(round);
  return fmt::format("{}.{}-{:0{}}-of-{}", scene_path, name, shard,
                     fmt::formatted_size("{}", count), count);
}

std::string indexShardPath(const std::string& scene_path, IndexPass pass, int shard, int count) {
  return indexShardPath(scene_path, pass, shard, count, 1);
}

Result<IndexShardWriter> IndexShardWriter::create(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  Hash hash(XXH3_createState());
  if (hash == nullptr) throw std::bad_alloc();
  XXH3_64bits_reset(hash.get());
  return IndexShardWriter(std::move(file), std::move(hash));
}

Status IndexShardWriter::append(Bytes payload) {
  XXH3_64bits_update(hash_.get(), payload.data(), payload.size());
  return file_.append(payload);
}

Result<std::uint64_t> IndexShardWriter::finish(const nlohmann::json& facts) {
  const std::string text = facts.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  if (text.size() > kMostFactsBytes) {
    return Status::invalidArgument(
        fmt::format("{}: {} bytes of options and inputs, expected at most {}: index fewer files",
                    file_.path(), text.size(), kMostFactsBytes));
  }
  Footer footer;
  footer.payload_bytes = file_.size();
  footer.payload_checksum = XXH3_64bits_digest(hash_.get());
  footer.facts_checksum = XXH3_64bits(text.data(), text.size());
  footer.facts_bytes = static_cast<std::uint32_t>(text.size());
  SURFEIT_RETURN_IF_ERROR(file_.append(std::as_bytes(std::span(text))));
  SURFEIT_RETURN_IF_ERROR(file_.append(std::as_bytes(std::span(&footer, 1))));
  const std::uint64_t bytes = file_.size();
  SURFEIT_RETURN_IF_ERROR(file_.commit());
  return bytes;
}

Result<IndexShardReader> IndexShardReader::open(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile file, InputFile::open(path));
  const auto refuse = [&](const std::string& what) {
    return Status::corruption(fmt::format("{}: {}", path, what));
  };
  Footer footer;
  if (file.size() < sizeof footer) return refuse("too short for a shard of an index");
  const std::uint64_t facts_end = file.size() - sizeof footer;
  SURFEIT_RETURN_IF_ERROR(file.readAt(facts_end, std::as_writable_bytes(std::span(&footer, 1))));
  if (footer.magic != kMagic) return refuse("not a shard of an index");
  if (footer.version != kIndexShardVersion) {
    return refuse(fmt::format("shard of version {}, expected {}: index it again", footer.version,
                              kIndexShardVersion));
  }
  if (footer.facts_bytes > kMostFactsBytes || footer.payload_bytes > facts_end ||
      footer.payload_bytes + footer.facts_bytes != facts_end) {
    return refuse(fmt::format("{} bytes, expected {} and {} and a footer", file.size(),
                              footer.payload_bytes, footer.facts_bytes));
  }
  std::string text(footer.facts_bytes, '\0');
  SURFEIT_RETURN_IF_ERROR(file.readAt(footer.payload_bytes,
                                      std::as_writable_bytes(std::span(text.data(), text.size()))));
  const std::uint64_t checksum = XXH3_64bits(text.data(), text.size());
  nlohmann::json facts = nlohmann::json::parse(text, nullptr, false);
  if (checksum != footer.facts_checksum || !facts.is_object()) {
    return refuse(fmt::format("facts at {}: checksum {:016x}, expected {:016x}",
                              footer.payload_bytes, checksum, footer.facts_checksum));
  }
  return IndexShardReader(std::move(file), std::move(facts), footer.payload_bytes,
                          footer.payload_checksum);
}

Status IndexShardReader::readAt(std::uint64_t offset, std::span<std::byte> bytes) const {
  if (offset > payload_bytes_ || bytes.size() > payload_bytes_ - offset) {
    return Status::corruption(fmt::format("{}: {} bytes at {}, expected at most {} in all", path(),
                                          bytes.size(), offset, payload_bytes_));
  }
  return file_.readAt(offset, bytes);
}

Status IndexShardReader::check(const Progress& progress) const {
  XXH3_state_t* const state = XXH3_createState();
  if (state == nullptr) throw std::bad_alloc();
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> owner(state,
                                                                              XXH3_freeState);
  XXH3_64bits_reset(state);
  std::vector<std::byte> bytes(
      static_cast<std::size_t>(std::min<std::uint64_t>(payload_bytes_, kCheckBytes)));
  for (std::uint64_t at = 0; at < payload_bytes_; at += bytes.size()) {
    if (progress.isCancelled()) return Status::interrupted();
    bytes.resize(
        static_cast<std::size_t>(std::min<std::uint64_t>(payload_bytes_ - at, kCheckBytes)));
    SURFEIT_RETURN_IF_ERROR(readAt(at, bytes));
    XXH3_64bits_update(state, bytes.data(), bytes.size());
  }
  const std::uint64_t found = XXH3_64bits_digest(state);
  if (found == payload_checksum_) return {};
  return Status::corruption(fmt::format("{}: {} bytes at 0: checksum {:016x}, expected {:016x}",
                                        path(), payload_bytes_, found, payload_checksum_));
}

}  // namespace surfeit
