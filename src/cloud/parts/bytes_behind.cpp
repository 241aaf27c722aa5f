#include "cloud/parts/bytes_behind.h"

#include <fmt/format.h>

#include <cstddef>

namespace surfeit {

std::string noteOfBytesBehind(std::uint64_t bytes, std::string_view thing) {
  if (bytes == 0) return {};
  return fmt::format(
      "{} bytes behind the last {} are not read: if the header counts too few, or files were "
      "joined, write each cloud as a file of its own",
      bytes, thing);
}

Status checkNothingBehind(ByteInput& input, std::uint64_t end, std::string_view thing) {
  if (!input.isCompressed()) return {};
  std::byte more;
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input.readSome(end, {&more, 1}));
  if (got == 0) return {};
  return Status::corruption(fmt::format(
      "{}: byte {}: bytes behind the last {}, expected the end: if the header counts too few, or "
      "files were joined, write each cloud as a file of its own; unpacked (gunzip, unzstd), the "
      "file is read without them",
      input.path(), end, thing));
}

}  // namespace surfeit
