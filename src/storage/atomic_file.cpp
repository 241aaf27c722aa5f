#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <utility>

#include "core/assert.h"
#include "storage/block_writer.h"
#include "storage/file.h"
#include "storage/output_target.h"
#include "storage/system_calls.h"
#include "storage/temporary_name.h"

namespace surfeit {
namespace {

// Opens a file without a name in the directory of `path`; not open where there are none.
FileDescriptor openUnnamed(const std::string& path) {
  FileDescriptor file(
      system_calls::open(directoryOf(path).c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666));
  // It gets its name by way of /proc
  const std::string self = "/proc/self/fd/" + std::to_string(file.get());
  if (file.isOpen() && access(self.c_str(), F_OK) != 0) file.close();
  return file;
}

}  // namespace

struct AtomicFile::State {
  State(std::string given_path, OutputTarget resolved)
      : path(std::move(given_path)), target(std::move(resolved)) {}
  ~State() {
    if (!removeTemporary().ok()) return;  // the next writer of the path tries again
  }

  Status openTemporary();
  Status complete();
  Status publish();
  Status removeTemporary();
  // Gives thread and memory back.
  void endWriting();

  // Where the file lies until it is complete, as a path beside it.
  std::string besidePath() const {
    return target.is_stream ? spoolDirectory() + "/surfeit-output" : target.path;
  }

  std::string path;  // as it was given, for messages
  OutputTarget target;
  std::string temporary_path;  // empty while the file has no name, and when it has the final one
  PositionalFile file;
  std::optional<BlockWriter> writer{std::in_place,
                                    file};  // ends before its file; none once finished
  std::uint64_t final_size = 0;             // once finished
  Status failure;
};

Status AtomicFile::State::openTemporary() {
  FileDescriptor descriptor = openUnnamed(besidePath());
  if (!descriptor.isOpen()) {
    // Not every file system has files without names
    SURFEIT_ASSIGN_OR_RETURN(NamedFile named, createTemporary(besidePath(), path));
    descriptor = std::move(named.descriptor);
    temporary_path = std::move(named.path);
  }
  file = PositionalFile(std::move(descriptor), path);
  return {};
}

// Everything that was appended is in the file, and nothing else.
Status AtomicFile::State::complete() {
  SURFEIT_RETURN_IF_ERROR(writer->flush());
  if (writer->isPadded() && system_calls::ftruncate(file.descriptor(), writer->size()) != 0) {
    return file.systemError("cut the padding off");
  }
  return {};
}

Status AtomicFile::State::publish() {
  SURFEIT_RETURN_IF_ERROR(complete());
  if (target.is_stream) {
    SURFEIT_RETURN_IF_ERROR(writeToStream(target, file.descriptor(), writer->size()));
    return removeTemporary();
  }
  // Permissions of the file that was there stay
  if (target.mode && ::fchmod(file.descriptor(), *target.mode) != 0) {
    return file.systemError("give the finished file the permissions of the one before");
  }
  if (system_calls::fsync(file.descriptor()) != 0) return file.systemError("sync");

  // What can fail is done before the file that was there is replaced
  const FileDescriptor directory(
      system_calls::open(directoryOf(target.path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!directory.isOpen()) return file.systemError("open the directory of the finished file");
  if (temporary_path.empty()) {
    // A new name cannot replace an old one; only rename can
    SURFEIT_ASSIGN_OR_RETURN(temporary_path, nameTemporary(file.descriptor(), target.path));
  }
  if (system_calls::rename(temporary_path.c_str(), target.path.c_str()) != 0) {
    return file.systemError("rename the finished file to its final name");
  }
  temporary_path.clear();
  // The new name itself must survive a power loss too. File systems that do not sync directories
  // say so by EINVAL
  if (system_calls::fsync(directory.get()) != 0 && errno != EINVAL) {
    const Status status = file.systemError("sync the directory of the finished file");
    return Status(status.code(),
                  status.message() +
                      ": the file is complete and has its name, but a power loss may "
                      "still undo that");
  }
  return {};
}

Status AtomicFile::State::removeTemporary() {
  if (temporary_path.empty()) return {};
  if (system_calls::unlink(temporary_path.c_str()) != 0) {
    return systemError(temporary_path, "remove the temporary file");
  }
  temporary_path.clear();
  return {};
}

void AtomicFile::State::endWriting() {
  final_size = writer->size();
  writer.reset();
}

AtomicFile::AtomicFile(std::unique_ptr<State> state) : state_(std::move(state)) {}
AtomicFile::AtomicFile(AtomicFile&& other) noexcept = default;
AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept = default;
AtomicFile::~AtomicFile() = default;

Result<AtomicFile> AtomicFile::create(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(OutputTarget target, resolveOutput(path));
  auto state = std::make_unique<State>(path, std::move(target));
  removeStaleTemporaries(state->besidePath());
  SURFEIT_RETURN_IF_ERROR(state->openTemporary());
  return AtomicFile(std::move(state));
}

const std::string& AtomicFile::path() const { return state_->path; }

std::uint64_t AtomicFile::size() const {
  return state_->writer ? state_->writer->size() : state_->final_size;
}

Status AtomicFile::append(Bytes bytes) {
  SURFEIT_CHECK(state_->writer.has_value());
  return state_->writer->append(bytes).status();
}

Status AtomicFile::writeAt(std::uint64_t offset, Bytes bytes) {
  SURFEIT_CHECK(state_->writer.has_value());
  return state_->writer->overwrite(offset, bytes);
}

Status AtomicFile::commit() {
  SURFEIT_CHECK(state_->writer.has_value());
  if (!state_->failure.ok()) return state_->failure;
  state_->failure = state_->publish();
  SURFEIT_RETURN_IF_ERROR(state_->failure);
  state_->endWriting();
  state_->file.close();
  // A writer of the same path may have been killed meanwhile
  removeStaleTemporaries(state_->besidePath());
  return {};
}

Result<InputFile> AtomicFile::finishUnnamed(const std::string& name, Access access) {
  SURFEIT_CHECK(state_->writer.has_value());
  if (!state_->failure.ok()) return state_->failure;
  state_->failure = state_->complete();
  if (state_->failure.ok()) state_->failure = state_->removeTemporary();
  SURFEIT_RETURN_IF_ERROR(state_->failure);
  state_->endWriting();
  state_->file.setName(name);
  return InputFile::fromOpen(std::move(state_->file), access);
}

}  // namespace surfeit
