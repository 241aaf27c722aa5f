#!/usr/bin/env bash
# One case of the end-to-end tests of scenes that share a root cube.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# Two frames: a city, and the same with one surfel that has flown away. Without it the cube is half
# as wide.
makeFrames() {
  generate near.ply --surfels 5000
  generate far.ply --surfels 5000 --outlier 3000
  run 0 index near.ply -o near.sft --quiet
  run 0 index far.ply -o far.sft --quiet
}

# difference FILE FILE: of the results of receivers that look away from what left the city, root mean
# square.
difference() {
  paste -d, "$1" "$2" | awk -F, 'NR > 1 && $4 < -0.5 { e = $7 - $14; sum += e * e; ++count }
    END { if (NR != 5001 || count < 100) exit 1; print sqrt(sum / count) }'
}

# What leaves the city changes what receivers get that do not even see it, unless both frames have
# one cube.
pinnedCubesDoNotPop() {
  makeFrames
  run 0 index near.ply -o pinned_near.sft --cube far.sft --quiet
  run 0 index far.ply -o pinned_far.sft --cube far.sft --quiet
  local scene output popped pinned
  for scene in near far pinned_near pinned_far; do
    run 0 gather $scene.sft near.ply -o baked.ply --mode bleeding --quiet
    for output in occlusion irradiance_g; do
      run 0 convert baked.ply -o $output.$scene.csv --keep normal,$output --quiet
    done
  done
  for output in occlusion irradiance_g; do
    popped=$(difference $output.near.csv $output.far.csv)
    pinned=$(difference $output.pinned_near.csv $output.pinned_far.csv)
    echo "$output: differs by $popped, with one cube by $pinned"
    awk -v popped="$popped" -v pinned="$pinned" \
      'BEGIN { exit !(popped > 4e-4 && pinned < 5e-5) }' ||
      fail "$output: differs by $pinned with one cube, and by $popped without"
  done
}

# By name or by numbers, with many buckets and threads; and its own cube changes no byte of a scene.
pinnedCubesAreNumbersOrScenes() {
  makeFrames
  local frame
  run 0 info far.sft
  says "cube           -170.671875,-170.671875,-170.671875,4096"
  run 0 index near.ply -o like.sft --cube far.sft --quiet
  run 0 index near.ply -o numbers.sft --cube "-170.671875 -170.671875 -170.671875 4096" --quiet --threads 3
  sameBytes like.sft numbers.sft
  run 0 info like.sft
  says "cube           -170.671875,-170.671875,-170.671875,4096" '"cube":[-170.671875,-170.671875,-170.671875,4096.0]'
  run 0 verify like.sft
  run 0 index far.ply -o far_again.sft --cube far.sft --quiet
  sameBytes far.sft far_again.sft
  run 0 info like.sft --json
  says '"cube": ['
  # Far from 0 the cube brings its origin
  run 0 convert near.ply -o map.csv --transform "1 0 0 500000 0 1 0 5000000 0 0 1 0 0 0 0 1" --quiet
  run 0 convert far.ply -o map_far.csv --transform "1 0 0 500000 0 1 0 5000000 0 0 1 0 0 0 0 1" --quiet
  run 0 index map_far.csv -o map_far.sft --quiet
  run 0 index map.csv -o map.sft --cube map_far.sft --quiet
  for frame in map map_far; do
    run 0 info $frame.sft
    says "origin         499968 4999936 -256" "cube           499797.328125,4999765.328125,-170.671875,4096"
  done
  run 0 index near.ply -o curve.sft --cube=-3000,-3000.5,-3000,8192 --precision full --quiet
  run 0 verify curve.sft
}

cubesThatDoNotHoldAreRefused() {
  makeFrames
  run 2 index far.ply -o out.sft --cube near.sft
  says "1 of 5001 surfels lie outside of the cube -85.3359375,-85.3359375,-85.3359375,2048" "to 3500 " \
    "with one cube that holds all: --cube -170.671875,-170.671875,-170.671875,4096"
  leavesNothing out.sft
  run 0 index far.ply -o fits.sft --cube 0,0,-256,4096 --quiet
  run 2 index far.ply -o out.sft --cube 1,2,3
  says 'found "1,2,3", expected a scene (.sft), or four numbers X,Y,Z,SIZE'
  run 2 index far.ply -o out.sft --cube 0,0,0,-4
  says "cube: size -4, expected a number above 0"
  run 2 index far.ply -o out.sft --cube 1e11,0,0,1
  says "too small to be divided"
  run 2 index far.ply -o out.sft --cube 1e13,0,0,1
  says "cube: corner 10000000000000, expected a number of at most 1e12"
  run 74 index far.ply -o out.sft --cube nosuch.sft
  says "--cube: expected a scene" "nosuch.sft"
  run 3 index far.ply -o out.sft --cube far.ply
  leavesNothing out.sft
}

runCase
