#include "storage/byte_output.h"

#include <optional>
#include <utility>

#include "storage/compression.h"

namespace surfeit {
namespace {

constexpr std::size_t kReadBytes = 1 << 20;

// Reads a file from front to back into a compressor, and that into another file.
Status compress(const InputFile& from, Compression compression, Progress* progress,
                AtomicFile& to) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<Compressor> compressor,
                           Compressor::create(compression));
  AlignedBuffer buffer;
  for (std::uint64_t offset = 0;;) {
    if (progress != nullptr && progress->isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, from.readView(offset, kReadBytes, buffer));
    offset += bytes.size();
    if (progress != nullptr) progress->advanceBytes(bytes.size());
    const bool is_last = bytes.size() < kReadBytes;
    SURFEIT_RETURN_IF_ERROR(
        compressor->encode(bytes, is_last, [&to](Bytes piece) { return to.append(piece); }));
    if (is_last) return {};
  }
}

}  // namespace

struct ByteOutput::State {
  AtomicFile file;  // as it will appear, or what is to be compressed
  Compression compression;
  std::string path;
  Progress* progress;
  Status failure;  // of commit, which is not tried again

  Status pollCancel() const {
    return progress != nullptr && progress->isCancelled() ? Status::interrupted() : Status();
  }

  Status compressAndCommit() {
    SURFEIT_ASSIGN_OR_RETURN(const InputFile plain, file.finishUnnamed(path));
    SURFEIT_ASSIGN_OR_RETURN(AtomicFile packed, AtomicFile::create(path));
    SURFEIT_RETURN_IF_ERROR(compress(plain, compression, progress, packed));
    return packed.commit();
  }
};

Result<ByteOutput> ByteOutput::create(const std::string& path, Progress* progress) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  return ByteOutput(std::make_unique<State>(
      State{std::move(file), compressionOf(std::string_view(path)), path, progress, {}}));
}

ByteOutput::ByteOutput(std::unique_ptr<State> state) : state_(std::move(state)) {}
ByteOutput::ByteOutput(ByteOutput&&) noexcept = default;
ByteOutput& ByteOutput::operator=(ByteOutput&&) noexcept = default;
ByteOutput::~ByteOutput() = default;

const std::string& ByteOutput::path() const { return state_->path; }

std::uint64_t ByteOutput::size() const { return state_->file.size(); }

Status ByteOutput::append(Bytes bytes) {
  SURFEIT_RETURN_IF_ERROR(state_->pollCancel());
  return state_->file.append(bytes);
}

Status ByteOutput::writeAt(std::uint64_t offset, Bytes bytes) {
  return state_->file.writeAt(offset, bytes);
}

Status ByteOutput::commit() {
  if (state_->compression == Compression::kNone) return state_->file.commit();
  if (state_->failure.ok()) state_->failure = state_->compressAndCommit();
  return state_->failure;
}

std::string_view withoutCompression(std::string_view path) {
  switch (compressionOf(path)) {
    case Compression::kGzip:
      return path.substr(0, path.size() - 3);
    case Compression::kZstd:
      return path.substr(0, path.size() - 4);
    case Compression::kNone:
      break;
  }
  return path;
}

}  // namespace surfeit
