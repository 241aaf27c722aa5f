#!/usr/bin/env bash
# One case of the end-to-end tests of look-ups.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

bake() {
  makeScene 20000
  run 0 gather cornell.sft cornell.ply -o baked.ply --mode bleeding --quality draft --quiet
  run 0 sample cornell.obj -o other.ply --count 3000 --light-samples 2 --quiet
}

# difference FILE FILE COLUMN: root mean square of a channel of one number.
difference() {
  "$surfeit" convert "$1" -o a.csv --keep "$3" --quiet
  "$surfeit" convert "$2" -o b.csv --keep "$3" --quiet
  paste -d, a.csv b.csv | awk -F, 'NR > 1 { e = $4 - $8; sum += e * e } END { print sqrt(sum / (NR - 1)) }'
}

# What is looked up at other receivers is about what a gather finds there.
bakedValuesAreLookedUpAtClouds() {
  bake
  run 0 gather cornell.sft other.ply -o gathered.ply --mode bleeding --quality draft --quiet
  run 0 brick baked.ply -o baked.vdb --max-error 0.01 --quiet
  local map error
  for map in "baked.ply --interpolation=smooth" "baked.ply --interpolation=nearest" baked.vdb; do
    # shellcheck disable=SC2086 # a list of words
    run 0 lookup $map other.ply -o found.ply --stats stats.json
    jsonIs stats.json receivers 3000 missing_receivers 0 invalid_receivers 0
    jsonHas stats.json map channels points spacing max_distance page_loads receivers_per_second phases
    error=$(difference found.ply gathered.ply occlusion)
    echo "$map: occlusion differs by $error"
    awk -v error="$error" 'BEGIN { exit !(error > 0 && error < 0.05) }' || fail "$map: differs by $error"
  done
  run 0 info found.ply
  says irradiance occlusion albedo
}

passesAndVolumesAreReceivers() {
  bake
  run 0 brick baked.ply -o baked.vdb --quiet
  run 0 view cornell.sft --passes passes.exr --eye "0.5 0.5 2.4" --look-at "0.5 0.5 0" --fov 60 \
    --size 64x64
  run 0 lookup baked.vdb passes.exr -o light.exr --channel irradiance
  run 0 composite passes.exr light.exr -o lit.png --channel lit
  exists lit.png
  run 0 lookup baked.ply passes.exr -o direct.exr --threads 3
  run 0 lookup baked.ply passes.exr -o again.exr --threads 1 --memory 64M
  sameBytes direct.exr again.exr
  generate haze.vdb --kind volume --surfels 1000
  run 0 lookup baked.vdb haze.vdb -o found.vdb --missing 0 --channel occlusion
  says "find no value nearby that faces their way: they get 0"
  run 0 info found.vdb
  says occlusion
}

objectsMayHaveMoved() {
  bake
  local matrix="0 -1 0 10  1 0 0 0  0 0 1 5  0 0 0 1"
  echo "$matrix" > matrix.txt
  run 0 convert other.ply -o moved.ply --transform "$matrix" --quiet
  run 0 lookup baked.ply other.ply -o still.ply --channel occlusion --quiet
  run 0 lookup baked.ply moved.ply -o found.ply --channel occlusion --from-space matrix.txt --quiet
  local error
  error=$(difference still.ply found.ply occlusion)
  awk -v error="$error" 'BEGIN { exit !(error < 1e-4) }' || fail "differs by $error"
  run 0 lookup baked.ply moved.ply -o again.ply --channel occlusion --from-space "$matrix" --quiet
  sameBytes found.ply again.ply
  run 0 lookup baked.ply moved.ply -o nowhere.ply --channel occlusion
  says "3000 of 3000 receivers find no value nearby that faces their way: they get nan"
  run 0 convert other.ply -o rest.csv --keep position,normal --quiet
  sed -i '1s/.*/Pref_x,Pref_y,Pref_z,Nref_x,Nref_y,Nref_z/' rest.csv
  awk -F, -v OFS=, '{ print (NR == 1 ? "x,y,z" : NR ",0,0"), $0 }' rest.csv > bent.csv
  run 0 lookup baked.ply bent.csv -o bent.ply --channel occlusion --pref Pref --nref Nref --quiet
  run 0 convert bent.ply -o bent_values.csv --keep occlusion --quiet
  run 0 convert still.ply -o still_values.csv --keep occlusion --quiet
  error=$(paste -d, bent_values.csv still_values.csv |
    awk -F, 'NR > 1 { e = $4 - $8; if (e < 0) e = -e; if (e > most) most = e } END { print most + 0 }')
  awk -v error="$error" 'BEGIN { exit !(error < 1e-4) }' || fail "reference positions: $error"
}

whatCannotWorkIsRefused() {
  bake
  run 0 brick baked.ply -o baked.vdb --quiet
  run 2 lookup baked.vdb other.ply -o out.ply --interpolation nearest
  says "a brick map has no points"
  run 2 lookup baked.ply other.ply -o out.ply --filter-width 1
  says "needs a brick map"
  run 2 lookup baked.ply other.ply -o out.ply --channel nothing
  says 'no channel "nothing"; this cloud has: '
  run 2 lookup baked.vdb other.ply -o out.ply --channel nothing
  says "this brick map has: "
  run 2 lookup baked.ply other.ply -o out.ply --pref Pref
  says "no property Pref_x"
  run 2 lookup baked.ply other.ply -o out.ply --nref Nref
  run 2 lookup baked.ply other.ply -o out.ply --to-space "1 2 3"
  says "--to-space" "12 or 16 numbers"
  run 2 lookup baked.ply other.ply -o out.ply --from-space "1 0 0 0 1 0 0 0 1 0 0 0"
  says "the matrix has no inverse"
  run 2 lookup baked.ply other.ply -o baked.ply
  says "would replace its input"
  run 33 lookup baked.ply other.ply -o out.ply --memory 20M
  says "MiB is the least that works"
  run 74 lookup nosuch.ply other.ply -o out.ply
  run 3 lookup cornell.obj other.ply -o out.ply
  leavesNothing out
}

runCase
