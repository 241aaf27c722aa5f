#!/usr/bin/env bash
# One case of the tests of what is lost on the way from a file to surfels: each loss is told once,
# with the number of what is lost and the way out, and --strict refuses it.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

saysNot() {
  local text
  for text in "$@"; do
    [[ $said != *"$text"* ]] || fail "did not expect \"$text\" in: $said"
  done
}

# saysOnce TEXT
saysOnce() {
  local rest=${said#*"$1"}
  [[ $rest != "$said" ]] || fail "expected \"$1\" in: $said"
  [[ $rest != *"$1"* ]] || fail "expected \"$1\" once in: $said"
}

# ply FILE "TYPE NAME,..." ROW...: in ASCII, with places; a row has the other values.
ply() {
  local file=$1 properties=$2 row i=0
  shift 2
  {
    printf 'ply\nformat ascii 1.0\nelement vertex %d\n' $#
    printf 'property float %s\n' x y z
    tr ',' '\n' <<< "$properties" | sed 's/^/property /'
    echo end_header
    for row in "$@"; do echo "$((++i)) $((i * i)) 1 $row"; done
  } > "$file"
}

alphaThatIsNotUsedIsTold() {
  local rgb="uchar red,uchar green,uchar blue"
  ply low.ply "$rgb,uchar alpha" "9 9 9 20" "9 9 9 255" "9 9 9 0"
  run 0 index low.ply -o out.sft
  saysOnce "low.ply: the alpha of 2 of 3 records looked at is below 255 and not used: --channels alpha=opacity"
  run 3 index low.ply -o strict.sft --strict
  says "the alpha of 2 of 3" "refused by --strict"
  run 0 info low.ply
  says "the alpha of 2 of 3 records"
  # Both ways out
  run 0 index low.ply -o out.sft --channels alpha=-
  saysNot "alpha of"
  run 0 index low.ply -o out.sft --channels alpha=opacity
  saysNot "alpha of"
  says "skipped 1 record with an opacity that is not above 0 and at most 1 (first: record 2, whose opacity is 0)"
  gzip -k low.ply
  run 0 index low.ply.gz -o out.sft
  saysOnce "is below 255 and not used"
  run 0 index - -o out.sft < low.ply
  saysOnce "is below 255 and not used"
  # Other types
  ply words.ply "$rgb,ushort alpha" "9 9 9 65534" "9 9 9 65535"
  run 0 index words.ply -o out.sft
  saysOnce "the alpha of 1 of 2 records looked at is below 65535"
  ply reals.ply "$rgb,float alpha" "9 9 9 0.5" "9 9 9 1" "9 9 9 nan"
  run 0 index reals.ply -o out.sft
  saysOnce "the alpha of 2 of 3 records looked at is below 1 and"
  ply codes.ply "$rgb,float alpha" "9 9 9 255" "9 9 9 20"
  run 0 index codes.ply -o out.sft
  saysOnce "the alpha of 1 of 2 records looked at is below 255 and not used: write it as uchar, then"
  printf 'x,y,z,R,G,B,A\n1,2,3,9,9,9,0\n4,5,6,7,8,9,0\n4,6,6,7,8,9,0\n' > zero.csv
  run 0 index zero.csv -o out.sft
  saysOnce "zero.csv: the alpha of 3 of 3 records looked at is below"
  # Nothing is lost of these
  ply opaque.ply "$rgb,uchar alpha" "9 9 9 255" "9 9 9 255"
  ply ones.ply "$rgb,double alpha" "9 9 9 1" "9 9 9 1"
  ply none.ply "$rgb" "9 9 9" "9 9 9"
  printf 'x,y,z,R,G,B,A\n1,2,3,9,9,9,255\n4,5,6,7,8,9,255\n4,6,6,7,8,9,255\n' > opaque.csv
  local file
  for file in opaque.ply ones.ply none.ply opaque.csv; do
    run 0 index "$file" -o out.sft
    saysNot "alpha"
  done
  run 0 convert low.ply -o kept.ply --strict # keeps it
  run 0 convert kept.ply -o kept.csv
  [[ $(cut -d, -f7 kept.csv | paste -sd' ') == "alpha 20 255 0" ]] || fail "$(cat kept.csv)"
}

colorsOfTenOrTwelveBitsAreTold() {
  local type
  for type in ushort short int uint; do
    ply ten.ply "$type red,$type green,$type blue" "1023 512 0" "256 0 0"
    run 0 index ten.ply -o out.sft
    saysOnce "read as sRGB of 10 bits"
    says "--color-range 16"
    ply twelve.ply "$type red,$type green,$type blue" "1024 512 0" "4095 0 0"
    run 0 index twelve.ply -o out.sft
    saysOnce "read as sRGB of 12 bits"
    ply sixteen.ply "$type red,$type green,$type blue" "4096 512 0" "9 9 9"
    run 0 index sixteen.ply -o out.sft
    saysNot "10 bits" "12 bits" "10 or 12"
  done
  run 3 index twelve.ply -o strict.sft --strict
  run 0 index ten.ply -o out.sft --color-range 16
  saysNot "10 bits"
  ply ten.ply "ushort red,ushort green,ushort blue" "1023 0 0" "512 0 0"
  run 0 convert ten.ply -o bright.ply
  run 0 convert bright.ply -o bright.csv
  [[ $(sed -n 2p bright.csv) == *,65535,0,0 ]] || fail "$(cat bright.csv)"
  printf '1 2 3 1000 900 0\n4 5 6 7 300 9\n7 8 9 1 2 3\n' > text.xyz
  run 0 index text.xyz -o out.sft --channels 4=red,5=green,6=blue
  saysOnce "read as sRGB of 10 bits"
}

placesThatAreMovedKeepTheirDigits() {
  ply near.ply "float radius" 0.1 0.1 0.1 0.1
  awk '/^end_header/ { print; rows = 1; next } rows { $1 /= 4; $2 /= 8 } { print }' near.ply > quarter.ply
  run 0 convert quarter.ply -o far.csv --transform "1 0 0 5e5 0 1 0 5e6 0 0 1 0"
  saysNot "they move"
  [[ $(sed 1d far.csv | cut -d, -f1,2 | paste -sd' ') == \
    "500000.25,5000000.125 500000.5,5000000.5 500000.75,5000001.125 500001,5000002" ]] || fail "$(cat far.csv)"
  local ending
  for ending in ply prt ply.gz; do
    run 0 convert quarter.ply -o "far.$ending" --transform "1 0 0 5e5 0 1 0 5e6 0 0 1 0" --strict
    run 0 convert "far.$ending" -o again.csv
    cut -d, -f1-3 far.csv > places.csv
    cut -d, -f1-3 again.csv > places_again.csv
    sameBytes places.csv places_again.csv
  done
  for ending in ptc bgeo pdb; do
    run 0 convert quarter.ply -o "far.$ending" --transform "1 0 0 5e5 0 1 0 5e6 0 0 1 0"
    saysOnce "positions are floats in this format: they move by up to"
    run 0 convert quarter.ply -o "turned.$ending" --transform "0 1 0 0 1 0 0 0 0 0 2 0"
    saysNot "they move"
    run 0 convert quarter.ply -o "beside.$ending" --transform "1 0 0 2 0 1 0 3 0 0 1 4"
    saysNot "they move"
  done
  run 0 convert quarter.ply -o set.csv --set "x += 500000" --set "y = y + 5000000"
  sameBytes set.csv far.csv
  run 0 convert quarter.ply -o set.ptc --set "position += 5000000"
  saysOnce "they move by up to"
  # A turn and a scale cost no digits
  run 0 convert quarter.ply -o turned.ply --transform "0 1 0 0 1 0 0 0 0 0 2 0"
  grep -aq "property float x" turned.ply || fail "$(head turned.ply)"
}

linesMayEndAsOnOldMacs() {
  ply unix.ply "uchar red,uchar green,uchar blue" "1 2 3" "4 5 6"
  run 0 convert unix.ply -o binary.ply
  run 0 convert unix.ply -o unix.csv
  tr '\n' '\r' < unix.ply > mac.ply
  # Only lines of the header end so
  { sed '/^end_header/q' binary.ply | tr '\n' '\r'; tail -c 30 binary.ply; } > mac_binary.ply
  local file
  for file in mac.ply mac_binary.ply; do
    run 0 convert "$file" -o mac.csv
    sameBytes mac.csv unix.csv
  done
  ply wide.ply "int64 id" 1 2
  run 0 convert wide.ply -o out.csv
  [[ $(cut -d, -f4 out.csv | paste -sd' ') == "id 1 2" ]] || fail "$(cat out.csv)"
}

# Text far from 0 is read again, about its origin.
whatIsSkippedIsToldOnce() {
  awk -v CONVFMT=%.10g 'BEGIN { print "x,y,z,radius"; for (i = 0; i < 200; ++i) print 500000 + i / 4 "," 5000000 + i % 7 "," i % 5 "," (i == 17 ? -1 : .5) }' > far.csv
  run 0 index far.csv -o out.sft -v
  saysOnce "skipped 1 record with a radius that is not positive (first: record 17, whose radius is -1)"
  gzip -k far.csv
  run 0 index far.csv.gz -o out.sft
  saysOnce "skipped 1 record"
  # Two clouds have a note each
  cp far.csv too.csv
  run 0 index far.csv too.csv -o out.sft
  saysOnce "far.csv: skipped 1 record"
  saysOnce "too.csv: skipped 1 record"
  run 3 index far.csv -o strict.sft --strict
}

# Clouds have no column for it; index finds it again.
whatDisksHideIsTold() {
  local loss="how much of its disk each surfel hides"
  generate city.ply --surfels 3k
  run 0 index city.ply -o sized.sft
  run 0 convert sized.sft -o sized.ply
  saysNot "$loss"
  # Areas that are not those of the neighbourhood, and places that come twice
  run 0 index city.ply -o tiles.sft --channels radius=-
  run 0 index city.ply city.ply -o twice.sft --channels area=-,radius=-
  for scene in tiles twice; do
    run 0 verify $scene.sft
    run 0 convert $scene.sft -o $scene.ply
    saysOnce "$loss"
    says "index --channels radius=- finds it again"
    run 0 index $scene.ply -o again.sft --channels radius=-
    run 0 convert again.sft -o again.ply
    says "$loss"
  done
}

scenesUnderNamesOfCloudsAreTold() {
  generate city.ply --surfels 100
  run 0 index city.ply -o odd.PLY.gz
  says "odd.PLY.gz: a scene, under a name of PLY files" ".sft"
  run 0 index city.ply -o odd.las
  says "a name of LAS files"
  run 3 index city.ply -o strict.csv --strict
  leavesNothing strict
  run 0 index city.ply -o even.sft --strict
  run 0 index city.ply -o even.ply.scene --strict
  run 0 bounce even.sft -o lit.ply --quality draft
  says "lit.ply: a scene, under a name of PLY files"
}

runCase
