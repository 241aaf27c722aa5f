#include <fcntl.h>

#include <algorithm>
#include <utility>

#include "core/assert.h"
#include "storage/block_writer.h"
#include "storage/file.h"
#include "storage/system_calls.h"
#include "storage/temporary_name.h"

namespace surfeit {

struct TemporaryFile::State {
  State(PositionalFile open_file, std::size_t blocks)
      : file(std::move(open_file)), writer(file, blocks) {}

  // Makes sure that the bytes before `end` are in the file.
  Status flushUpTo(std::uint64_t end) {
    return end <= writer.flushedSize() ? Status() : writer.flush();
  }
  // How many of the bytes [offset, offset + size) exist.
  std::size_t available(std::uint64_t offset, std::size_t size) const {
    const std::uint64_t rest = writer.size() - std::min(offset, writer.size());
    return static_cast<std::size_t>(std::min<std::uint64_t>(size, rest));
  }

  PositionalFile file;
  BlockWriter writer;  // ends before its file
};

TemporaryFile::TemporaryFile(std::unique_ptr<State> state) : state_(std::move(state)) {}
TemporaryFile::TemporaryFile(TemporaryFile&& other) noexcept = default;
TemporaryFile& TemporaryFile::operator=(TemporaryFile&& other) noexcept = default;
TemporaryFile::~TemporaryFile() = default;

Result<TemporaryFile> TemporaryFile::create(const std::string& directory, std::size_t blocks) {
  FileDescriptor descriptor(
      system_calls::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (!descriptor.isOpen()) {
    // Not every file system has files without names: create one with a name and remove that. What
    // a run left that was killed in between goes with it
    removeStaleTemporaries(directory + "/scratch");
    SURFEIT_ASSIGN_OR_RETURN(NamedFile named, createTemporary(directory + "/scratch", directory));
    if (system_calls::unlink(named.path.c_str()) != 0) {
      return systemError(directory, "remove the name of a temporary file");
    }
    descriptor = std::move(named.descriptor);
  }
  PositionalFile file(std::move(descriptor), directory + " (temporary file)",
                      "use --temp to put temporary files elsewhere");
  // Now, because others may read while blocks are still appended
  file.openDirect(O_RDWR);
  return TemporaryFile(std::make_unique<State>(std::move(file), blocks));
}

std::uint64_t TemporaryFile::size() const { return state_->writer.size(); }

Result<std::uint64_t> TemporaryFile::append(Bytes bytes) { return state_->writer.append(bytes); }

Status TemporaryFile::flush() { return state_->writer.flush(); }

Status TemporaryFile::readAt(std::uint64_t offset, std::span<std::byte> bytes) const {
  const std::size_t available = state_->available(offset, bytes.size());
  if (available < bytes.size()) return state_->file.endsEarly(offset, bytes.size(), available);
  SURFEIT_RETURN_IF_ERROR(state_->flushUpTo(offset + bytes.size()));
  return state_->file.readAt(offset, bytes);
}

Result<Bytes> TemporaryFile::readView(std::uint64_t offset, std::size_t size,
                                      AlignedBuffer& buffer) const {
  const std::size_t available = state_->available(offset, size);
  if (available < size) return state_->file.endsEarly(offset, size, available);
  SURFEIT_RETURN_IF_ERROR(state_->flushUpTo(offset + size));
  SURFEIT_ASSIGN_OR_RETURN(const Bytes view, state_->file.readView(offset, size, buffer));
  if (view.size() < size) return state_->file.endsEarly(offset, size, view.size());
  return view;
}

void TemporaryFile::release(std::uint64_t offset, std::uint64_t size) {
  state_->file.release(offset, size);
}

}  // namespace surfeit
