#!/usr/bin/env bash
# One case of the end-to-end tests of clouds of many formats.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# Four points with a radius, as PLY text.
makePoints() {
  printf '%s\n' ply "format ascii 1.0" "element vertex 4" "property double x" "property double y" \
    "property double z" "property float radius" "property uchar group" end_header \
    "0 0 0 1 0" "1 0 0 2 1" "2 0 5 3 2" "637000.25 0 0 4 3" > points.ply
}

everyFormatComesBack() {
  local extension
  generate city.ply --surfels 3k
  for extension in ply ply.gz ply.zst ptc ptc.gz vdb las prt bgeo pdb xyz csv.zst; do
    run 0 convert city.ply -o "city.$extension"
    run 0 info "city.$extension"
    says radiosity
    run 0 convert "city.$extension" -o back.ply --stats stats.json
    jsonIs stats.json records 3000 written_records 3000
  done
  jsonHas stats.json inputs output properties input_bytes output_bytes records_per_second \
    peak_resident_bytes
  run 0 convert city.csv.zst -o back.ply
  run 0 convert back.ply -o again.csv
  run 0 convert city.ply -o first.csv
  sameBytes first.csv again.csv
  run 0 index city.ptc -o city.sft
  run 0 verify city.sft
}

cloudsMergeMoveAndThin() {
  makePoints
  run 0 convert points.ply points.ply -o a.csv --every 3 --drop group --quiet
  [[ $(cat a.csv) == $'x,y,z,radius\n0,0,0,1.7320508\n637000.25,0,0,6.928203\n0,0,0,1.7320508\n637000.25,0,0,6.928203' ]] ||
    fail "$(cat a.csv)"
  run 0 convert points.ply -o b.csv --units m:cm --up y --keep radius --crop -1,0,-1,150,501,1
  [[ $(cat b.csv) == $'x,y,z,radius\n0,0,0,100\n100,0,0,200' ]] || fail "$(cat b.csv)"
  run 0 convert points.ply -o c.csv --transform "1 0 0 -637000 0 1 0 0 0 0 1 0.5 0 0 0 1" --keep x \
    --crop 0,0,0,1,1,1
  [[ $(cat c.csv) == $'x,y,z\n0.25,0,0.5' ]] || fail "$(cat c.csv)"
  printf '1 2 3\n' > one.xyz
  run 0 convert points.ply one.xyz -o d.ply
  says "one.xyz: not there, 0 is written: radius group"
  run 0 convert - one.xyz -o e.csv --spacing 2.5 --keep radius --stats stats.json < <(cat points.ply)
  says "e.csv: 4 of 5 records are kept, one per cell of 2.5"
  [[ $(cat e.csv) == $'x,y,z,radius\n1,0,0,2.828427\n2,0,5,3\n637000.25,0,0,4\n1,2,3,0' ]] || fail "$(cat e.csv)"
  jsonIs stats.json records 5 written_records 4 thinned_records 1 placeless_records 0
  run 0 convert d.ply -o d.csv --quiet
  [[ $(tail -n 1 d.csv) == "1,2,3,0,0" ]] || fail "$(cat d.csv)"
  [[ -z $said ]] || fail "said: $said"
}

# Values are set by channel and condition; what is lost is told, and slips of the pen are refused.
channelsAreComputed() {
  generate city.ply --surfels 500
  run 0 convert city.ply -o grouped.ply --set "group = 3 where x < 500"
  says "of 500 records"
  run 0 convert grouped.ply -o dimmed.ply --set "radiosity *= .5 where group == 3" --set "z += 1"
  run 0 convert city.ply -o before.csv --keep radiosity_r,radiosity_b --quiet
  run 0 convert dimmed.ply -o after.csv --keep radiosity_r,radiosity_b --quiet
  paste -d, before.csv after.csv | awk -F, 'NR > 1 {
      part = $1 < 500 ? .5 : 1
      for (i = 4; i <= 5; ++i) { e = $(i + 5) - part * $i; if (e * e > 1e-12) exit 1 }
      e = $8 - $3 - 1; if (e * e > 1e-8) exit 1
      if (part < 1) ++dimmed
    } END { if (NR != 501 || dimmed == 0 || dimmed == 500) exit 1 }' || fail "other values"
  run 0 convert grouped.ply -o out.ply --set "group = 300"
  says "500 values do not fit the type of group"
  run 0 convert grouped.ply -o out.csv --set "position *= 2" --spacing 100 --quiet
  run 3 convert grouped.ply -o refused.ply --set "radius = 1 / (x - x)" --strict
  run 2 convert city.ply -o refused.ply --set "radiosty *= 2"
  says "set: at 1: found 'radiosty', expected one of position normal"
  run 2 convert city.ply -o refused.ply --set "radius = radiosity"
  says "at 10: found 'radiosity' of 3 numbers, expected one number, such as radiosity_r"
  run 2 convert city.ply -o refused.ply --set "radius = 1 where"
  run 2 convert city.ply -o refused.ply --set "radius"
  leavesNothing refused
}

# A scan keeps its points through all commands, but for those that are withheld, noise or filtered.
scansAreFilteredAndWritten() {
  generate city.ply --surfels 3k
  run 0 convert city.ply -o plain.csv --keep position,normal,radiosity,radius --quiet
  awk -F, 'NR == 1 { print $0 ",classification,withheld,return_number" }
    NR > 1 { print $0 "," (NR % 10 == 0 ? 7 : 2) "," (NR % 100 == 1) "," 1 + NR % 2 }' \
    plain.csv > scan.csv
  run 0 convert scan.csv -o scan.las
  says "points move by up to"
  run 0 info scan.las
  says "330 of 3000 points are left out: 30 withheld, 300 of noise"
  run 0 info scan.las --filter "return == 1 and class != 7 and not withheld"
  says "1,200 points"
  run 0 index scan.las -o scan.sft --filter "class == 2"
  run 0 info scan.sft
  says "2,700"
  run 3 index scan.las -o none.sft --strict
  says "(refused by --strict)"
  test ! -e none.sft || fail "refused, and written"
  run 2 index scan.las -o none.sft --filter "clas == 2"
  says "filter: at 1: found 'clas'" classification
  run 2 info scan.sft --filter true
  run 0 view scan.sft -o scene.png --size 64x64 --filter "y > 0"
  run 0 convert scan.sft -o scene.csv --filter "y > 0"
  run 0 view scan.las -o scan.png --size 64x64 --filter "class == 2"
  run 0 gather scan.sft scan.las -o lit.las --filter true --max-solid-angle 0.1
  run 0 info lit.las --filter true
  says "3,000 points" "occlusion      float occlusion" return_number "normal         float nx ny nz"
  run 0 gather scan.sft scan.las -o lit.csv --max-solid-angle 0.1 --filter "return == 2"
  [[ $(wc -l < lit.csv) == 1501 ]] || fail "$(wc -l lit.csv)"
  run 0 brick lit.las -o lit.vdb --filter "return == 1"
  run 0 tune scan.sft lit.las --filter "return == 1"
  printf 'v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nf 1 2 3 4\n' > square.obj
  run 0 sample square.obj -o square.las --count 500
  says "points move by up to"
  run 0 info square.las
  says "LAS 1.4 point format 6"
}

# What one program calls so is read as what another needs, by every command.
channelsAreNamedOnTheWay() {
  generate city.ply --surfels 3k
  run 0 convert city.ply -o odd.ptc --channels radiosity=bake,normal=N2
  run 0 info odd.ptc
  says bake N2_x
  run 0 info odd.ptc --channels bake=radiosity,N2=normal
  says "radiosity      float radiosity_r" "normal         float nx ny nz"
  run 0 index odd.ptc -o odd.sft --channels bake=radiosity,N2=normal
  run 0 info odd.sft
  says "input had      position, normal, radius, area, radiosity"
  run 0 gather odd.sft odd.ptc -o lit.ptc --channels N2=normal,bake=- --memory 64M
  run 0 info lit.ptc
  says occlusion "normal         float nx ny nz"
  run 0 view odd.ptc -o picture.png --channels bake=radiosity --channel radiosity --size 32x32
  exists picture.png
  run 2 index odd.ptc -o none.sft --channels bake
  says "channels: found 'bake', expected FROM=TO"
  run 3 gather odd.sft city.ply -o none.ply --channels x=y
  says "would be a second y"
  leavesNothing none
}

partsAreChosenByName() {
  printf '%s\n' ply "format ascii 1.0" "element vertex 1" "property float x" "property float y" \
    "property float z" "element lamps 2" "property float x" "property float y" "property float z" \
    "property float nx" "property float ny" "property float nz" "property float radius" \
    "property float power_r" "property float power_g" "property float power_b" \
    end_header "9 9 9" "1 2 3 0 0 1 1 1 1 1" "4 5 6 0 0 1 1 1 1 1" > two.ply
  run 0 convert two.ply -o a.csv --part lamps --keep position
  [[ $(cat a.csv) == $'x,y,z\n1,2,3\n4,5,6' ]] || fail "$(cat a.csv)"
  run 0 info two.ply --part lamps --channels radius=width
  says "width          float width" "power"
  run 0 index two.ply -o lamps.sft --part lamps
  says "2 surfels"
  run 0 gather lamps.sft two.ply -o lit.ply --part lamps --memory 64M
  says "2 receivers"
  run 0 radiance two.ply -o map.ply --part lamps --max-radius 10
  says "2 surfels"
  run 0 view two.ply -o picture.png --part lamps --size 16x16
  says "2 surfels"
  run 0 convert --part lamps --keep position,radius --channels nx=- two.ply -o b.csv
  [[ $(head -1 b.csv) == "x,y,z,radius" ]] || fail "$(cat b.csv)"
  run 0 convert --part lamps --drop normal,power two.ply -o b.csv
  [[ $(head -1 b.csv) == "x,y,z,radius" ]] || fail "$(cat b.csv)"
  run 3 convert two.ply -o none.ply --part roofs
  says roofs lamps
  leavesNothing none
}

badOptionsAreUsageErrors() {
  makePoints
  run 2 convert points.ply
  run 2 convert points.ply -o none.jpg
  says "none.jpg" ".ptc"
  run 2 convert points.ply -o none.ply --transform "1 2 3"
  says "--transform" "12 or 16 numbers"
  run 2 convert points.ply -o none.ply --transform "1 0 0 0 0 1 0 0 0 0 1 0 5 5 5 1"
  says "last row 5 5 5 1" transpose
  run 2 convert points.ply -o none.ply --transform "1 0 0 0 1 0 0 0 0 0 1 0"
  says determinant
  run 2 convert points.ply -o none.ply --units m:parsec
  says "--units" "us-ft"
  run 2 convert points.ply -o none.ply --up w
  run 2 convert points.ply -o none.ply --crop 0,0,0,1,1
  says "--crop" "six numbers"
  run 2 convert points.ply -o none.ply --crop 0,0,0,-1,1,1
  says "crop: found 0 to -1 along x"
  run 2 convert points.ply -o none.ply --every 0
  run 2 convert points.ply -o none.ply --keep x --drop radius
  run 2 convert points.ply -o none.ply --spacing 1 --every 2
  run 2 convert points.ply -o none.ply --spacing 0
  says "spacing: found 0, expected a finite length above 0"
  run 2 convert points.ply -o none.ply --spacing 1e-11
  says "position 637000.25 along x" "give a larger spacing"
  run 33 convert points.ply -o none.ply --spacing 1 --memory 20M
  run 2 convert points.ply -o none.ply --keep colour
  says "found no channel 'colour', expected one of position radius group"
  run 2 convert points.ply -o none.exr
  run 33 convert points.ply -o none.vdb --memory 10
  run 74 convert no_such_file.ply -o none.ply
  printf "no cloud" > notes.txt
  run 3 convert notes.txt -o none.ply
  head -c 180 points.ply > cut.ply
  run 3 convert points.ply cut.ply -o none.ply
  says cut.ply
  leavesNothing none
}

interruptLeavesNothing() {
  local name
  generate city.ply --surfels 1M
  # Much more than can be done before the signal comes
  for name in result.prt result.ptc.gz; do
    stoppedLeavesNothing "$name" convert city.ply city.ply city.ply city.ply city.ply city.ply \
      city.ply city.ply city.ply city.ply city.ply city.ply
  done
}

runCase
