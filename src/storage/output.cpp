#include "surfeit/output.h"

#include <span>
#include <utility>

#include "storage/file.h"
#include "storage/output_target.h"

namespace surfeit {

Result<OutputPlace> findOutput(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(OutputTarget target, resolveOutput(path));
  return OutputPlace{std::move(target.path), target.is_stream};
}

Status writeOutput(const std::string& path, std::string_view bytes) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(bytes))));
  return file.commit();
}

}  // namespace surfeit
