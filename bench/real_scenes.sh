#!/usr/bin/env bash
# The whole job on real geometry: meshes to surfels, scenes, occlusion and bleeding, pictures, and
# errors against rays on the true triangles; captured clouds to scenes and occlusion; a gather in a
# tenth of what the scene decodes to.
#
#   bench/real_scenes.sh DATA [OUT]     DATA holds meshes/, scenes/ and points/
#
# Needs the build of preset dev (scripts/test.sh makes it). Prints every figure of README, "Numbers".
set -euo pipefail
cd "$(dirname "$0")/.."
data=${1:?usage: bench/real_scenes.sh DATA [OUT]}
out=${2:-out/real}
PATH=$PWD/build/dev/bin:$PWD/build/dev/bench:$PATH
mkdir -p "$out"

# mesh_scene NAME MESH CAMERA... -- LIGHT AND GROUND OPTIONS
mesh_scene() {
  local name=$1 mesh=$2 camera=()
  shift 2
  while [[ $1 != -- ]]; do
    camera+=("$1")
    shift
  done
  shift
  printf '\n== %s\n' "$name"
  surfeit sample "$mesh" -o "$out/$name.ply" --count 2000000 "$@"
  surfeit index "$out/$name.ply" -o "$out/$name.sft" --stats "$out/$name.index.json"
  surfeit verify "$out/$name.sft"
  surfeit sample "$mesh" -o "$out/$name.receivers.ply" --count 250000 "$@"
  surfeit gather "$out/$name.sft" "$out/$name.receivers.ply" -o "$out/$name.baked.ply" \
    --mode bleeding --stats "$out/$name.gather.json"
  fidelity "$out/$name.baked.ply" "$mesh" "$@" --receivers 2000 --rays 1024
  for channel in ao lit; do
    surfeit view "$out/$name.baked.ply" -o "$out/$name.$channel.png" --channel $channel \
      "${camera[@]}"
  done
}

# cloud_scene NAME CLOUD CAMERA...
cloud_scene() {
  local name=$1 cloud=$2
  shift 2
  printf '\n== %s\n' "$name"
  surfeit index "$cloud" -o "$out/$name.sft"
  surfeit gather "$out/$name.sft" "$cloud" -o "$out/$name.baked.ply"
  surfeit view "$out/$name.baked.ply" -o "$out/$name.ao.png" --channel ao "$@"
}

mesh_scene lion "$data/meshes/lion_reconstruction.ply" \
  --eye "4 1 -0.5" --look-at "-2.8 3.8 -1.3" --up-axis z --fov 40 --exposure -1 -- \
  --up z --ground-plane --light-directional "-1 -0.6 -2 3 2.8 2.4"
mesh_scene sponza "$data/scenes/sponza/sponza.obj" \
  --eye "-11 3 -0.5" --look-at "4 4.5 0.4" --fov 65 -- \
  --light-directional "-0.3 -1 -0.25 8 7.4 6.4"

printf '\n== sponza, in a tenth of its decoded size\n'
surfeit gather "$out/sponza.sft" "$out/sponza.receivers.ply" -o "$out/sponza.small.ply" \
  --mode bleeding --memory 32M
cmp "$out/sponza.baked.ply" "$out/sponza.small.ply" && echo "the same bytes"

cloud_scene takanawa "$data/points/lion_takanawa.ply" \
  --eye "4 1 -0.5" --look-at "-2.8 3.8 -1.3" --up-axis z --fov 40
cloud_scene stadium "$data/points/autzen_stadium.ply" \
  --eye "150 -330 160" --look-at "20 0 0" --fov 45 --up-axis z
