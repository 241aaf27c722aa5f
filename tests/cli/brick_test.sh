#!/usr/bin/env bash
# One case of the end-to-end tests of brick maps; CMakeLists.txt lists the cases.
#
#   brick_test.sh CASE SURFEIT CORNELL_SCENE WORK_DIR
set -euo pipefail

case_name=$1
surfeit=$2
cornell_scene=$3
work_dir=$4

source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

bake() {
  makeScene 20000
  run 0 gather cornell.sft cornell.ply -o baked.ply --mode occlusion --quality draft --quiet
}

# Gathered, kept in voxels, and looked up at another cloud of the same scene.
bakedValuesAreLookedUp() {
  bake
  run 0 brick baked.ply -o baked.vdb --max-error 0.05 --stats brick.json
  says "baked.vdb: " "levels"
  jsonHas brick.json voxels level_voxels voxel_size points_per_second channels
  exists baked.vdb
  run 0 info baked.vdb
  run 0 sample cornell.obj -o other.ply --count 5000 --light-samples 2 --quiet
  run 0 view other.ply --brick baked.vdb -o other.png --channel ao --size 160x120 --stats view.json
  exists other.png
  jsonIs view.json non_finite_values 0
  run 0 view cornell.sft --brick baked.vdb -o scene.exr --filter-width 0.1 --size 160x120
  exists scene.exr
}

mapsDoNotDependOnThreadsMemoryOrCloudOrder() {
  bake
  run 0 brick baked.ply -o a.vdb --threads 1 --memory 64M
  run 0 brick baked.ply -o b.vdb --threads 3 --memory 1G
  sameBytes a.vdb b.vdb
  run 0 convert baked.ply -o first.ply --every 2
  run 0 brick first.ply baked.ply -o c.vdb
  run 0 brick baked.ply first.ply -o d.vdb
  sameBytes c.vdb d.vdb
}

whatCannotWorkIsRefused() {
  bake
  run 2 brick baked.ply -o baked.ply.out
  says ".vdb"
  run 2 brick baked.ply -o out.vdb --channel nothing
  says "no channel \"nothing\"" "occlusion"
  run 2 brick baked.ply -o out.vdb --voxel-size 0
  run 33 brick baked.ply -o out.vdb --memory 1M
  run 74 brick missing.ply -o out.vdb
  head -c 3000 cornell.obj >broken.vdb
  run 3 view cornell.ply --brick broken.vdb -o out.png
  leavesNothing out.
}

rm -rf "$work_dir"
mkdir -p "$work_dir"
cd "$work_dir"
"$case_name"
echo "passed: $case_name"
