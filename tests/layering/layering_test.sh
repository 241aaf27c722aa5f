#!/usr/bin/env bash
# The sources keep to their rooms, and the check notices when they do not.
#
#   layering_test.sh SOURCE_DIRECTORY
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
source_dir=$1
"$here/check_layering.sh" "$source_dir"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/src" "$work/include" "$work/bench"
cp -r "$source_dir/include/surfeit" "$work/include/"
cp -r "$source_dir/src/." "$work/src/"
cp -r "$source_dir/tools" "$source_dir/examples" "$source_dir/python" "$work/"
cp "$source_dir"/bench/*.h "$source_dir"/bench/*.cpp "$work/bench/"
"$here/check_layering.sh" "$work"

# expect_refusal FILE LINE: the check fails when LINE is added to FILE
expect_refusal() {
  cp "$work/$1" "$work/kept"
  echo "$2" >>"$work/$1"
  if "$here/check_layering.sh" "$work" >"$work/report" 2>&1; then
    echo "not noticed: $2 in $1" >&2
    exit 1
  fi
  cp "$work/kept" "$work/$1"
}
expect_refusal src/gather/cut/cut.cpp '#include "gather/packet/packet_raster.h"'
expect_refusal src/gather/cut/cut.cpp '#include "storage/file.h"'
expect_refusal src/gather/rules/gather_rules.h '#include "batch/gather_memory.h"'
expect_refusal src/bounce/bounce_crew.cpp '#include "gather/packet/packet_gatherer.h"'
expect_refusal src/octree/read/scene_file.cpp '#include "cloud/rows/row_reader.h"'
expect_refusal src/cache/page_cache.cpp '#include "storage/file.h"'
expect_refusal src/cloud/text/xyz_reader.cpp '#include "cloud/cloud_formats.h"'
expect_refusal src/cloud/rows/row_writer.h '#include "cloud/ply/ply_format.h"'
expect_refusal src/cloud/edits/color_reader.h '#include "cloud/cloud_formats.h"'
expect_refusal src/surfels/rows/surfel_source.cpp '#include "surfels/generated/scene_recipe.h"'
expect_refusal src/index/steps/cloud_reader.h '#include "index/index_from.h"'
expect_refusal src/gather/packet/packet_raster.cpp '#include <tbb/parallel_for.h>'
expect_refusal src/storage/file.cpp '#include <OpenEXR/ImfHeader.h>'
expect_refusal include/surfeit/gather.h '#include "gather/rules/receiver.h"'
expect_refusal src/core/bounds.h '#include "cloud/rows/surfel_names.h"'
expect_refusal tools/command.h '#include "core/job_limits.h"'
expect_refusal tools/main.cpp '#include "src/core/job_limits.h"'
expect_refusal tools/main.cpp '#include "tools/../src/core/job_limits.h"'
expect_refusal tools/main.cpp '#include <core/job_limits.h>'
expect_refusal tools/main.cpp '#include "bench/or_exit.h"'
expect_refusal bench/engine_bench.cpp '#include "gather/cut/cut.h"'
expect_refusal bench/engine_bench.cpp '#include "bench/internal/error_summary.h"'
expect_refusal bench/or_exit.h '#include "storage/file.h"'
expect_refusal examples/renderer.cpp '#include "engine/engine_state.h"'
expect_refusal python/src/engine.cpp '#include "engine/engine_state.h"'

# A folder that is no room
mkdir "$work/src/core/nook"
touch "$work/src/core/nook/nook.h"
expect_refusal src/core/nook/nook.h '#include "core/bounds.h"'
rm -r "$work/src/core/nook"

# expect_rooms_refused PATTERN LINE WHY: rooms are refused when LINE takes the place of the one that
# PATTERN matches
cp "$here/check_layering.sh" "$work/"
expect_rooms_refused() {
  sed "s|$1|$2|" "$here/rooms.txt" >"$work/rooms.txt"
  if "$work/check_layering.sh" "$work" >"$work/report" 2>&1 || ! grep -q "$3" "$work/report"; then
    echo "not noticed: room $2" >&2
    exit 1
  fi
}
expect_rooms_refused '^storage:.*' 'storage: core octree/read' 'does not stand above it'
expect_rooms_refused '^cache:.*' 'storage: core' 'is there twice'
