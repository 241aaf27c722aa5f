// Opens clouds of all formats, and the texts that stand for generated scenes, as surfels.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {

// Opens any cloud format that we read, recognised by content (cloud/cloud_formats.h, and the text
// that stands for a generated scene, surfels/generated/scene_recipe.h). A file with an unknown
// magic is kCorruption, naming what is read. `options` say how the file is read, which of its
// parts, and under which names; texts of generated scenes have none of these. A source of a plain
// file takes at most 1.5 MiB of memory besides the buffers that readRows is given, and half a MiB
// as a rule; decompression takes a MiB more, or what window the file asks for, up to 9 MiB.
Result<std::unique_ptr<SurfelSource>> openSurfelSource(const std::string& path, bool strict,
                                                       const RowReaderOptions& options = {});

}  // namespace surfeit
