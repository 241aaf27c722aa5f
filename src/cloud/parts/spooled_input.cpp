#include "cloud/parts/spooled_input.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

namespace surfeit {

Result<SpooledInput> SpooledInput::open(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, access));
  SpooledInput spooled(std::move(input));
  if (spooled.input_.isCompressed()) {
    SURFEIT_RETURN_IF_ERROR(spooled.spool());
  } else {
    spooled.size_ = spooled.input_.size().value_or(0);
  }
  return spooled;
}

Status SpooledInput::spool() {
  SURFEIT_ASSIGN_OR_RETURN(TemporaryBytes file, TemporaryBytes::create(spoolDirectory()));
  std::vector<std::byte> buffer(256 << 10);
  while (true) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input_.readSome(size_, buffer));
    if (got == 0) break;
    SURFEIT_RETURN_IF_ERROR(file.append(Bytes(buffer).first(got)));
    size_ += got;
  }
  SURFEIT_RETURN_IF_ERROR(file.flush());
  spooled_.emplace(std::move(file));
  return {};
}

Status SpooledInput::readAt(std::uint64_t offset, std::span<std::byte> bytes) {
  if (spooled_ && (offset > size_ || bytes.size() > size_ - offset)) {
    return Status::corruption(fmt::format("{}: file ends early: {} bytes, expected {} at {}",
                                          path(), size_, bytes.size(), offset));
  }
  return spooled_ ? spooled_->readAt(offset, bytes) : input_.readAt(offset, bytes);
}

Result<Bytes> SpooledInput::readView(std::uint64_t offset, std::size_t size,
                                     AlignedBuffer& buffer) {
  if (offset > size_ || size > size_ - offset) {
    return Status::corruption(fmt::format("{}: file ends early: {} bytes, expected {} at {}",
                                          path(), size_, size, offset));
  }
  if (spooled_) {
    buffer.reserve(size);
    SURFEIT_RETURN_IF_ERROR(spooled_->readAt(offset, {buffer.data(), size}));
    return Bytes(buffer.data(), size);
  }
  SURFEIT_ASSIGN_OR_RETURN(const Bytes view, input_.readView(offset, size, buffer));
  if (view.size() == size) return view;
  return Status::corruption(fmt::format("{}: file ends early: {} bytes at {}, expected {}", path(),
                                        view.size(), offset, size));
}

}  // namespace surfeit
