#!/usr/bin/env bash
# What quantization costs and saves: real meshes as 5 M surfels, indexed quantized and in full
# precision, gathered at the same receivers. Prints bytes per surfel and how results differ.
#
#   bench/precision.sh DATA [OUT]     DATA holds meshes/ and scenes/
#
# Needs the build of preset dev (scripts/test.sh makes it).
set -euo pipefail
cd "$(dirname "$0")/.."
data=${1:?usage: bench/precision.sh DATA [OUT]}
out=${2:-out/precision}
PATH=$PWD/build/dev/bin:$PWD/build/dev/bench:$PATH
mkdir -p "$out"

# mesh_scene NAME MESH LIGHT AND GROUND OPTIONS...
mesh_scene() {
  local name=$1 mesh=$2 precision
  shift 2
  printf '\n== %s\n' "$name"
  surfeit sample "$mesh" -o "$out/$name.ply" --count 5000000 "$@"
  surfeit sample "$mesh" -o "$out/$name.receivers.ply" --count 50000 "$@"
  for precision in quantized full; do
    surfeit index "$out/$name.ply" -o "$out/$name.$precision.sft" --precision "$precision"
    surfeit gather "$out/$name.$precision.sft" "$out/$name.receivers.ply" \
      -o "$out/$name.$precision.ply" --mode bleeding --quiet
  done
  compare_baked "$out/$name.full.ply" "$out/$name.quantized.ply" |
    grep -e occlusion -e irradiance
  rm "$out/$name".*.sft "$out/$name.ply"
}

mesh_scene lion "$data/meshes/lion_reconstruction.ply" \
  --up z --ground-plane --light-directional "-1 -0.6 -2 3 2.8 2.4"
mesh_scene sponza "$data/scenes/sponza/sponza.obj" --light-directional "-0.3 -1 -0.25 8 7.4 6.4"
