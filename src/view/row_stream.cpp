#include "view/row_stream.h"

namespace surfeit {

Status streamRows(CloudRows& rows, const char* phase, Progress& progress,
                  const std::function<void(std::span<const std::byte>)>& visit) {
  SURFEIT_RETURN_IF_ERROR(rows.rewind());
  progress.beginPhase(phase, rows.element().count, "surfels");
  while (true) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> batch, rows.next());
    if (batch.empty()) return {};
    visit(batch);
    progress.advance(batch.size() / rows.element().row_bytes);
  }
}

}  // namespace surfeit
