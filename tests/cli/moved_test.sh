#!/usr/bin/env bash
# One case of the tests of places: what is made of a cloud on a map or a globe is what is made of it
# about 0, for every command that gathers, looks up or estimates.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# same LOCAL MOVED PROPERTY...: within 1e-5 of each other, record by record, and not all 0.
same() {
  local file
  for file in "$1" "$2"; do
    run 0 convert "$file" -o "$file.csv" --quiet
  done
  python3 - "$@" <<'PYTHON' || fail "not the same: $*"
import csv, math, sys
local, moved = (list(csv.DictReader(line for line in open(name + ".csv") if line[0] != "#"))
                for name in sys.argv[1:3])
assert len(local) == len(moved) > 100, (len(local), len(moved))
for name in sys.argv[3:]:
    pairs = [(float(a[name]), float(b[name])) for a, b in zip(local, moved)]
    worst = max(abs(a - b) for a, b in pairs if not (math.isnan(a) and math.isnan(b)))
    print(name, "differs by up to", worst)
    assert worst <= 1e-5, (name, worst)
    assert any(a != 0 for a, b in pairs), name
PYTHON
}

# The same scene and its map of photons, in `local` and in `moved`, which is so far away.
makeBoth() {
  local to=$1
  "$cornell_scene" .
  run 0 sample cornell.obj -o local.ply --count 20000 --light-samples 2 --emission --group-by material --quiet
  run 0 sample cornell.obj -o local.photons.ply --photons 5000 --quiet
  run 0 convert local.ply -o local.points.ply --keep position --quiet
  local cloud
  for cloud in "" .photons .points; do
    run 0 convert "local$cloud.ply" -o "moved$cloud.ply" --transform "$to" --quiet
  done
  run 0 view local.ply -o small.exr --size 64x32 --quiet
  run 0 index local.ply -o local.sft --threads 1 --quiet
  run 0 index moved.ply -o moved.sft --threads 1 --quiet
}

# both OUTPUT COMMAND...: with local and moved for NAME.
both() {
  local output=$1 name
  shift
  for name in local moved; do
    # shellcheck disable=SC2086 # a list of words
    run 0 ${@//NAME/$name} -o "$name.$output" --threads 1 --quiet
  done
}

compareAll() {
  local gather="gather NAME.sft NAME.ply"
  both ao.ply $gather --quality draft
  same local.ao.ply moved.ao.ply occlusion
  both lit.ply $gather --quality draft --mode bleeding --max-variation 0.02
  same local.lit.ply moved.lit.ply occlusion irradiance_r irradiance_b
  both sky.ply $gather --quality draft --environment small.exr --up y
  same local.sky.ply moved.sky.ply environment_r environment_g
  both all.ply $gather --quality draft --mode bleeding --outputs occlusion,bent_normal,irradiance --max-dist 0.4
  same local.all.ply moved.all.ply bent_normal_x bent_normal_y irradiance_g
  both again.ply $gather --quality draft --resume
  same local.again.ply moved.again.ply occlusion
  both b.sft bounce NAME.sft --quality draft --bounces 2 --surfels-per-receiver 8
  same local.b.sft moved.b.sft radiosity_r radiosity_b
  both g.sft bounce NAME.sft --quality draft --glossy 1=.5,.3
  same local.g.sft moved.g.sft radiosity_g
  both pt.ply ptfilter NAME.ply --filter colorbleeding --maxsolidangle 0.2
  same local.pt.ply moved.pt.ply irradiance_r
  both sun.sft relight NAME.sft --light-directional -1,-2,-1,3,3,3
  same local.sun.sft moved.sun.sft radiosity_r
  both rad.ply radiance NAME.photons.ply --nphotons 20
  same local.rad.ply moved.rad.ply radiosity_r area
  both n.ply normals NAME.points.ply --sizes
  same local.n.ply moved.n.ply nx nz area normal_confidence
  both look.ply lookup NAME.ao.ply NAME.lit.ply --channel occlusion
  same local.look.ply moved.look.ply occlusion
}

mapsGiveTheSame() {
  makeBoth "1 0 0 500000 0 1 0 5000000 0 0 1 100"
  compareAll
}

globesGiveTheSame() {
  makeBoth "1 0 0 -3923410 0 1 0 300000 0 0 1 5002803"
  compareAll
}

runCase
