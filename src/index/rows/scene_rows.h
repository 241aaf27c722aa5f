// The surfels of a scene (.sft) as a cloud, so that what was indexed and bounced can go to any
// format and be indexed again.
#pragma once

#include <memory>
#include <string>

#include "cloud/cloud_formats.h"
#include "cloud/rows/row_reader.h"
#include "octree/read/scene_file.h"
#include "surfeit/status.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {

// Rows in the order of the curve, under the names of surfels/rows/surfel_rows.h: position, normal
// and radiosity, radius, area, and what else the scene has. Positions are the cloud's own, as
// doubles where the scene has an origin. Decodes pages with the threads of the arena; holds a few
// MiB. Errors as of SceneFile.
Result<std::unique_ptr<RowReader>> readSceneAsCloud(SceneFile scene,
                                                    const RowReaderOptions& options = {});

// Opens a cloud of any format (openRowReader), or a scene as one.
Result<std::unique_ptr<RowReader>> openCloud(const std::string& path,
                                             const RowReaderOptions& options = {});

// The same as surfels (openSurfelSource).
Result<std::unique_ptr<SurfelSource>> openCloudSource(const std::string& path, bool strict,
                                                      const RowReaderOptions& options = {});

}  // namespace surfeit
