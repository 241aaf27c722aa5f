#!/usr/bin/env bash
# One case of the end-to-end tests of sample: cameras, hair, materials of photons.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

camerasDecideTheDensity() {
  "$cornell_scene" .
  local camera="0.5 0.5 2.4  0.5 0.5 0  37"
  run 0 sample cornell.obj -o one.ply --camera "$camera" --size 200x200 --stats one.json
  run 0 sample cornell.obj -o coarse.ply --camera "$camera" --size 200x200 --pixels 1.5 \
    --stats coarse.json
  [[ $(field coarse.json surfels) -lt $(($(field one.json surfels) * 7 / 10)) ]] ||
    fail "1.5 pixels save too little"
  printf '# two cameras\n%s\n0.2 0.9 0.9 0.9 0.2 0.1\n' "$camera" > cameras.txt
  run 0 sample cornell.obj -o two.ply --camera-file cameras.txt --fov 60 --size 200x200 \
    --stats two.json
  [[ $(field two.json surfels) -gt $(field one.json surfels) ]] || fail "two cameras are no union"
  run 0 index one.ply -o one.sft
  run 0 convert one.ply -o thin.ply --camera "$camera" --size 200x200 --pixels 4 --stats thin.json
  [[ $(field thin.json written_records) -lt $(($(field one.json surfels) / 4)) ]] ||
    fail "clouds are not thinned"
}

camerasHaveTheirErrors() {
  "$cornell_scene" .
  run 2 sample cornell.obj -o no.ply --camera "1 2 3 4 5"
  says --camera "eye and look-at"
  run 2 sample cornell.obj -o no.ply --camera "1 2 3 4 5 6" --count 5
  run 2 sample cornell.obj -o no.ply --camera "1 2 3 4 5 6" --size 5
  says "WIDTHxHEIGHT"
  run 2 sample cornell.obj -o no.ply --pixels 1
  says "--pixels: found no camera"
  run 2 sample cornell.obj -o no.ply --camera "1 2 3 1 2 3"
  says "the eye stands on the look-at point"
  run 2 convert cornell.obj -o no.ply --camera "1 2 3 4 5 6" --spacing 1
  echo "1 2 3" > bad.txt
  run 3 sample cornell.obj -o no.ply --camera-file bad.txt
  says "bad.txt: line 1"
  leavesNothing no.ply
}

countsHaveUnits() {
  "$cornell_scene" .
  run 0 sample cornell.obj -o digits.ply --count 1005 --light-samples 1
  run 0 sample cornell.obj -o units.ply --count 1.005k --light-samples 1
  cmp digits.ply units.ply || fail "1.005k surfels are not 1005"
  run 0 sample cornell.obj -o digits.ply --photons 2000
  run 0 sample cornell.obj -o units.ply --photons 2k
  cmp digits.ply units.ply || fail "2k photons are not 2000"
}

linesAreHairWhereTheyHaveAWidth() {
  printf 'v 0 0 0\nv 0 1 0\nv 0 2 0\nv 1 0 0\nv 1 3 0\nl 1 2 3\nl 4 5\n' > lines.obj
  run 3 sample lines.obj -o no.ply
  says "--curve-width gives lines one"
  run 0 sample lines.obj -o hair.ply --curve-width 0.1 --count 500
  run 0 info hair.ply
  says two_sided
  run 0 sample lines.obj -o one.ply --curve-width 0.1 --count 500 --strands 1 --stats one.json
  jsonIs one.json triangles 2
  leavesNothing no.ply
}

causticsAreAMapOfTheirOwn() {
  printf 'newmtl mirror\nKd 0 0 0\nKs .8 .8 .8\nillum 3\nnewmtl wall\nKd .5 .5 .5\n' > m.mtl
  printf 'mtllib m.mtl\nusemtl mirror\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nf 1 2 3 4\n' > m.obj
  printf 'usemtl wall\nv 1 0 1\nv 1 2 1\nv 1 2 -1\nv 1 0 -1\nf 5 6 7 8\n' >> m.obj
  run 0 sample m.obj -o photons.ply --photons 20000 --caustic-photons caustic.ply \
    --light-directional "1 -1 0  2 2 2" --stats stats.json
  says "photons of caustics"
  [[ $(field stats.json caustic_photons) -gt 1000 ]] || fail "no caustic"
  run 0 radiance photons.ply caustic.ply -o radiance.ply --nphotons 50
  run 2 sample m.obj -o same.ply --photons 10 --caustic-photons same.ply --light-point "0 1 0 1 1 1"
}

whatMaterialsLackIsRefusedByStrict() {
  printf 'P6 1 1 255\n\x33\x33\x33' > t.ppm
  printf 'newmtl a\nKd 1 1 1\nmap_Kd t.ppm\nnewmtl b\nKd 200 100 50\n' > m.mtl
  local square='mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\n'
  printf "$square"'usemtl a\nf 1 2 3 4\n' > bare.obj
  printf "$square"'usemtl a\nf 1/1 2/1 3/1 4/1\n' > full.obj
  local light=(--count 64 --light-directional "0 0 -1  1 1 1")
  run 3 sample bare.obj -o no.ply --strict "${light[@]}"
  says "(refused by --strict)"
  says 'material "b" has Kd 200 100 50: read as sRGB of 8 bits'
  printf 'newmtl a\nKd 1 1 1\nmap_Kd t.ppm\n' > m.mtl
  run 3 sample bare.obj -o no.ply --strict "${light[@]}"
  says '1 of 1 faces of material "a" have no texture coordinates'
  run 0 sample full.obj -o full.ply --strict "${light[@]}"
  run 0 sample bare.obj -o white.ply "${light[@]}"
  cmp -s full.ply white.ply && fail "the picture does not matter"
  leavesNothing no.ply
}

runCase
