#!/usr/bin/env bash
# One case of the end-to-end tests of brick maps.
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
  run 0 view cornell.sft --brick baked.vdb --filter-width 0 -o fine.exr --size 160x120
  differentBytes scene.exr fine.exr
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

optionsChooseWhatIsKept() {
  bake
  run 0 brick baked.ply -o fine.vdb --max-error 0 --stats fine.json
  run 0 brick baked.ply -o coarse.vdb --max-error 0.2 --stats coarse.json
  (($(field coarse.json voxels) < $(field fine.json voxels))) || fail "as many voxels for less"
  run 0 brick --channel albedo,occlusion baked.ply -o albedo.vdb --voxel-size 0.1 --stats albedo.json
  jsonIs albedo.json voxel_size 0.1
  run 0 view cornell.ply --brick albedo.vdb -o albedo.png --channel albedo --size 160x120
  generate city.ply --surfels 600k
  run 74 brick city.ply -o out.vdb --memory 64M --temp nowhere
  says nowhere
  sed '1,/^end_header/!d' baked.ply | sed 's/^element vertex .*/element vertex 1/' >broken.ply
  head -c $((4 * $(grep -ac '^property float' baked.ply))) /dev/zero | tr '\0' '\377' >>broken.ply # NaN
  run 0 brick baked.ply broken.ply -o both.vdb
  says "skipped 1 record"
  run 3 brick baked.ply broken.ply -o out.vdb --strict
  says broken.ply
  leavesNothing out
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

runCase
