#!/usr/bin/env bash
# One case of the end-to-end tests of the raster cube's pictures.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

cubesArePicturesAndValues() {
  local floor=(--at 0.5,0,0.5 --normal 0,1,0)
  makeScene 5000
  run 0 cube cornell.sft "${floor[@]}" -o floor.png
  says "light | coverage | depth" "rough node" occlusion
  exists floor.png
  [[ $(od -An -c -j 1 -N 3 floor.png | tr -d ' ') == PNG ]] || fail "floor.png is no PNG"
  run 0 cube cornell.sft "${floor[@]}" -o again.png --memory 64M --threads 1
  sameBytes floor.png again.png
  run 0 cube cornell.sft "${floor[@]}" -o some.png --show coverage,kind --zoom 2 --exposure 1 --quiet
  [[ -z $said ]] || fail "said with --quiet: $said"
  differentBytes floor.png some.png
  run 0 cube cornell.sft --at "0.5 0.5 0.9" -o around.png --up z
  run 0 cube cornell.sft "${floor[@]}" -o cone.png --cone-angle 0.4 --sides both --max-dist 2
  run 0 cube cornell.sft "${floor[@]}" -o glossy.png --mode glossy --camera 0.5,0.5,2.4 \
    --roughness 0.3 --quality draft
  run 0 cube cornell.sft "${floor[@]}" -o traced.png --reference cornell.obj --rays 4 --stats cube.json
  says "rays: occlusion" "coverage | coverage of rays"
  jsonHas cube.json command occlusion irradiance contributions traced_surfels reference_occlusion \
    coverage_rms
  # The box is closed but for its front, by rays as by surfels
  awk -v a="$(field cube.json occlusion)" -v b="$(field cube.json reference_occlusion)" \
    'BEGIN { exit !(a > 0.8 && a < 1 && b > 0.8 && b < 1 && a - b < 0.03 && b - a < 0.03) }' ||
    fail "occlusion is not that of rays: $(cat cube.json)"
  run 0 cube cornell.sft "${floor[@]}" -o floor.exr --reference cornell.obj
  exists floor.exr
  [[ $said != *"light blue"* ]] || fail "a legend for an EXR"
  leavesNothing none
}

# The receiver of a cloud, gathered alone.
cubesAgreeWithTheGather() {
  makeScene 5000
  run 0 convert cornell.ply -o some.csv --every 1237 --keep normal
  local number=3 row
  row=$(sed -n "$((number + 2))p" some.csv)
  { head -n 1 some.csv && echo "$row"; } > one.csv
  run 0 gather cornell.sft one.csv -o gathered.csv --mode bleeding
  run 0 cube cornell.sft --receivers some.csv --number $number -o cube.png --stats cube.json
  # A packet of one agrees with the scalar gather
  local column
  column=$(head -n 1 gathered.csv | tr -d '#' | tr ', ' '\n\n' | grep -v '^$' | grep -nx occlusion | cut -d: -f1)
  awk -F '[, ]' -v column="$column" -v found="$(field cube.json occlusion)" \
    'NR == 2 { d = $column - found; ok = d * d < 0.003 * 0.003 } END { exit !ok }' gathered.csv ||
    fail "$(cat gathered.csv) is not $(field cube.json occlusion)"
}

badCubesAreRefused() {
  makeScene 1000
  local cube=(cube cornell.sft -o none.png)
  run 2 "${cube[@]}"
  says "--at or --receivers"
  run 2 "${cube[@]}" --at 1,2
  says "found \"1,2\"" X,Y,Z
  run 2 "${cube[@]}" --at 0,0,0 --normal up
  run 2 "${cube[@]}" --normal 0,1,0
  run 2 "${cube[@]}" --at 0,0,0 --receivers cornell.ply
  run 2 "${cube[@]}" --at 0,0,0 --number 3
  run 2 "${cube[@]}" --receivers cornell.ply --number 1000000
  says "expected less than 1"
  run 2 "${cube[@]}" --at 0,0,0 --show light,colour
  says "found \"colour\"" coverage
  run 2 "${cube[@]}" --at 0,0,0 --zoom 0
  run 2 "${cube[@]}" --at 0,0,0 --raster-resolution 13
  run 2 "${cube[@]}" --at 0,0,0 --normal 0,1,0 --mode glossy
  says --camera
  run 2 cube cornell.sft --at 0,0,0 -o none.jpg
  says .png .exr
  run 33 "${cube[@]}" --at 0,0,0 --memory 1M
  says "least that works"
  run 74 cube nowhere.sft --at 0,0,0 -o none.png
  says nowhere.sft
  run 74 "${cube[@]}" --receivers nowhere.ply
  run 74 "${cube[@]}" --at 0,0,0 --reference nowhere.obj
  run 3 cube cornell.ply --at 0,0,0 -o none.png
  run 3 "${cube[@]}" --at 0,0,0 --reference cornell.sft
  run 74 cube cornell.sft --at 0,0,0 -o no/such/directory/none.png
  leavesNothing none
}

runCase
