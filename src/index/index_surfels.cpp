#include "index/index_from.h"
#include "index/rows/provided_rows.h"
#include "surfeit/surfel_source.h"

namespace surfeit {

Result<IndexStats> indexSurfels(SurfelProvider& provider, const std::string& output,
                                const IndexOptions& options, Progress& progress) {
  const SourceOpener opener = [&provider](const std::string&, bool strict,
                                          const RowReaderOptions&) {
    return makeSurfelSource(readProvidedSurfels(provider), strict);
  };
  return indexFrom({provider.name()}, opener, output, options, progress);
}

}  // namespace surfeit
