#!/usr/bin/env bash
# Builds Surfeit and takes it through its whole job on a scene that it makes itself: a Cornell box
# with spheres. Pictures, clouds and statistics end up in out/. Minutes on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."

surfels=1000000
receivers=250000
memory=64M
# Where examples/cornell_scene.cpp puts the camera: before the open side of the box
camera=(--eye "0.5 0.5 2.4" --look-at "0.5 0.5 0" --fov 37 --size 900x900 --cull-back)

say() { printf '\n== %s\n' "$*"; }

say "Installing what the build needs"
scripts/install-deps.sh

say "Building the program (preset release)"
cmake --preset release > /dev/null
cmake --build --preset release --parallel "$(nproc)" --target surfeit_program cornell_scene
PATH=$PWD/build/release/bin:$PWD/build/release/examples:$PATH

mkdir -p out
say "Writing the scene: a box with a light below its ceiling and two spheres"
cornell_scene out

say "Cutting its triangles into $surfels surfels, each with the direct light that it sends on"
surfeit sample out/cornell.obj -o out/cornell.ply --count $surfels

say "Building the octree file out/cornell.sft from them, within $memory of memory"
surfeit index out/cornell.ply -o out/cornell.sft --memory $memory --stats out/index.json
surfeit info out/cornell.sft

say "Placing $receivers receivers on the same surfaces"
# With --emission the light itself shows in the picture; what is gathered from has no need of it
surfeit sample out/cornell.obj -o out/receivers.ply --count $receivers --emission \
  --light-samples 64

say "Gathering ambient occlusion and color bleeding at every receiver, within $memory of memory"
surfeit gather out/cornell.sft out/receivers.ply -o out/gathered.ply --mode bleeding \
  --memory $memory --stats out/gather.json
echo "All statistics: out/index.json and out/gather.json (docs/stats.md)"

say "Drawing the results"
surfeit view out/gathered.ply -o out/ambient_occlusion.png --channel ao "${camera[@]}"
surfeit view out/gathered.ply -o out/color_bleeding.png --channel lit "${camera[@]}" --exposure -1

say "Done. Ambient occlusion, and direct light with color bleeding:"
echo "$PWD/out/ambient_occlusion.png"
echo "$PWD/out/color_bleeding.png"
