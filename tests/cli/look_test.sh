#!/usr/bin/env bash
# One case of the end-to-end tests of the look of light: corrections, filters, gains, groups by name
# and crops.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# The box with its materials as groups: 1 white, 2 red, 3 green, 4 light, 5 blue.
makeNamedScene() {
  "$cornell_scene" .
  run 0 sample cornell.obj -o cornell.ply --count 6000 --light-samples 2 --group-by material --quiet
  run 0 index cornell.ply -o cornell.sft --precision full --quiet
}

# sameColors A.ply B.ply TOLERANCE: radiosities, behind positions, as near as that part of them.
sameColors() {
  local cloud
  for cloud in "$1" "$2"; do
    run 0 convert "$cloud" -o "$cloud.csv" --keep radiosity --quiet
  done
  paste -d, "$1.csv" "$2.csv" | awk -F, -v tolerance="$3" '
    NR > 1 { for (i = 4; i <= 6; i++) { d = $i - $(i + 6); if (d < 0) d = -d
             if (d > tolerance * (1e-3 + $i)) { print NR, $0; exit 1 } } n++ }
    END { if (n < 100) exit 1 }' || fail "$1 and $2 differ"
}

# The long way: albedos changed in the cloud.
gainsOfGroupsAreThoseOfOtherAlbedos() {
  makeNamedScene
  run 0 bounce cornell.sft -o look.sft --bounces 2 --quality draft --group-gain "red,3=.5" \
    --group-tint "blue=1,.5,.25" --bounce-gain 1.5
  run 0 verify look.sft
  run 0 convert cornell.ply -o changed.ply --set "albedo *= 1.5" \
    --set "albedo *= .5 where group == 2 or group == 3" --set "albedo_g *= .5 where group == 5" \
    --set "albedo_b *= .25 where group == 5"
  run 0 index changed.ply -o changed.sft --precision full --quiet
  run 0 bounce changed.sft -o changed_b.sft --bounces 2 --quality draft --quiet
  run 0 bounce cornell.sft -o plain.sft --bounces 2 --quality draft --quiet
  local scene
  for scene in look changed_b plain; do
    run 0 convert $scene.sft -o $scene.ply --quiet
  done
  sameColors look.ply changed_b.ply 1e-4
  if (sameColors look.ply plain.ply 1e-4) > /dev/null; then fail "the look changed nothing"; fi

  # What is off changes no byte
  run 0 bounce cornell.sft -o off.sft --bounces 2 --quality draft --bounce-gain 1 \
    --bounce-tint 1,1,1 --bounce-saturation 1 --quiet
  sameBytes off.sft plain.sft
}

looksHaveTheirOptions() {
  makeNamedScene
  local gather=(gather cornell.sft cornell.ply --quality draft --mode bleeding)
  local filter="centre=.5,.5,.5 radius=.2,.6 gain=.5 direction=0,1,0 angle=20,100 saturation=0"
  run 0 "${gather[@]}" -o plain.ply --quiet
  run 0 "${gather[@]}" -o look.ply --bounce-gain 2 --bounce-filter "$filter" \
    --bounce-filter "direction=0,0,1 angle=45 tint=1,.5,.5"
  differentBytes look.ply plain.ply
  run 0 "${gather[@]}" -o parts.ply --bounce-gain 2 --bounce-filter "$filter" \
    --bounce-filter "direction=0,0,1 angle=45 tint=1,.5,.5" --resume --resume-parts 3
  sameBytes look.ply parts.ply
  run 0 gather --help
  says --bounce-filter --crop --occlusion-by-brightness --max-pixel-dist
  run 0 bounce --help
  says --group-saturation "GROUPS=R,G,B"

  run 2 "${gather[@]}" -o none.ply --bounce-filter "centre=1,1,1 gain=2"
  says "centre and radius need each other"
  run 2 "${gather[@]}" -o none.ply --bounce-filter "gain=2"
  says --bounce-gain
  run 2 "${gather[@]}" -o none.ply --bounce-filter "center=1,1,1"
  says "center=1,1,1" "centre, radius"
  run 2 "${gather[@]}" -o none.ply --bounce-filter "centre=1,1,1 radius=2,1 gain=2"
  says "radius=2,1" "INNER,OUTER"
  run 2 "${gather[@]}" -o none.ply --bounce-tint 1,2
  says "r,g,b"
  run 2 gather cornell.sft cornell.ply -o none.ply --bounce-gain 2
  says "--mode bleeding"
  run 2 bounce cornell.sft -o none.sft --group-gain "rad=.5"
  says --group-gain "white, red, green"
  run 2 bounce cornell.sft -o none.sft --group-gain "red"
  says "GROUPS=VALUE"
  run 2 bounce cornell.sft -o none.sft --group-gain "red=-1"
  says "0 to 1e6"
  run 2 bounce cornell.sft -o none.sft --group-gain "red=1" --group-gain "2=1"
  says "another value has"
  leavesNothing none
}

# The long way: radiosities changed in the cloud.
gainsOfGroupsAreThoseOfOtherRadiosities() {
  makeNamedScene
  local gather=(--mode bleeding --quality draft --max-solid-angle 0 --quiet)
  run 0 convert cornell.ply -o some.ply --every 20 --quiet
  run 0 gather cornell.sft some.ply -o gain.ply "${gather[@]}" --gain "red,3=2.5,white=.5"
  run 0 convert cornell.ply -o changed.ply --set "radiosity *= 2.5 where group == 2 or group == 3" \
    --set "radiosity *= .5 where group == 1"
  run 0 index changed.ply -o changed.sft --precision full --quiet
  run 0 gather changed.sft some.ply -o changed_gi.ply "${gather[@]}"
  run 0 gather cornell.sft some.ply -o plain.ply "${gather[@]}"
  local cloud
  for cloud in gain changed_gi plain; do
    run 0 convert $cloud.ply -o $cloud.csv --keep irradiance --quiet
  done
  paste -d, gain.csv changed_gi.csv plain.csv | awk -F, '
    NR > 1 { for (i = 4; i <= 6; i++) { d = $i - $(i + 6); if (d < 0) d = -d; if (d > 1e-5) exit 1
             e = $i - $(i + 12); if (e * e > 1e-6) ++changed } }
    END { exit !(changed > 300) }' || fail "the gain is not that of another radiosity"
  run 2 gather cornell.sft cornell.ply -o none.ply --mode bleeding --gain rad=2
  says --gain "white, red, green"
  run 2 gather cornell.sft cornell.ply -o none.ply --mode bleeding --gain red
  says "key=2,fill=.5"
  run 2 gather cornell.sft cornell.ply -o none.ply --gain red=2
  says "--mode bleeding"
  leavesNothing none
}

# A crop is what --filter has in more words; cameras see less.
cropsAreWindowsOfPictures() {
  makeScene 3000
  local camera=(--eye "0.5 0.5 2.4" --look-at "0.5 0.5 0" --fov 60 --size 48x48)
  run 0 view cornell.sft --passes passes.exr "${camera[@]}" --quiet
  run 0 gather cornell.sft passes.exr -o crop.ply --crop 10,20,30,28 --quality draft --quiet
  run 0 gather cornell.sft passes.exr -o filter.ply --quality draft --quiet \
    --filter "pixel_x >= 10 and pixel_x < 30 and pixel_y >= 20 and pixel_y < 28"
  sameBytes crop.ply filter.ply
  run 0 info crop.ply --json
  says '"surfels": 160'
  run 0 gather cornell.sft passes.exr -o both.ply --crop 10,20,30,28 --filter "pixel_x < 12" --quiet
  run 0 info both.ply --json
  says '"surfels": 16'
  run 2 gather cornell.sft passes.exr -o none.ply --crop 10,20,5,28
  says "10,20,5,28" "x0,y0,x1,y1"
  run 2 gather cornell.sft passes.exr -o none.ply --crop 1,2,3
  leavesNothing none

  local seen=(--camera "0.5 0.5 2.4  0.5 0.5 0  60" --size 48x48)
  run 0 sample cornell.obj -o whole.ply "${seen[@]}" --stats whole.json --quiet
  run 0 sample cornell.obj -o part.ply "${seen[@]}" --crop 0,0,24,48 --stats part.json --quiet
  (($(field part.json surfels) < $(field whole.json surfels))) || fail "a crop has as many surfels"
  run 0 sample cornell.obj -o all.ply "${seen[@]}" --crop 0,0,48,48 --quiet
  run 2 sample cornell.obj -o none.ply "${seen[@]}" --crop 0,0,49,48
  says "48x48"
  run 2 sample cornell.obj -o none.ply --crop 0,0,4,4
  says "no camera"
  leavesNothing none
}

lightsHaveNamesAndGains() {
  "$cornell_scene" .
  run 0 sample cornell.obj -o cornell.ply --count 4000 --quiet
  run 0 index cornell.ply -o cornell.sft --quiet
  local key="0.5 0.8 0.5" relight=(relight cornell.sft --mesh cornell.obj --no-mesh-light --quiet)
  run 0 "${relight[@]}" -o named.sft --light-point "key=$key  1 1 1" \
    --light-directional "fill=-1 -2 -1  3 3 3" --light-point "0.1 0.9 0.1  .5 .5 .5" \
    --gain key=2,fill=.5
  run 0 "${relight[@]}" -o by_hand.sft --light-point "$key  2 2 2" \
    --light-directional "-1 -2 -1  1.5 1.5 1.5" --light-point "0.1 0.9 0.1  .5 .5 .5"
  sameBytes named.sft by_hand.sft
  run 2 "${relight[@]}" -o none.sft --light-point "key=$key  1 1 1" --gain kay=2
  says '"kay"' "found key"
  run 2 "${relight[@]}" -o none.sft --light-point "$key  1 1 1" --gain bright
  says "key=2,fill=.5"
  run 2 "${relight[@]}" -o none.sft --light-point "key=$key  1 1 1" --gain key=2,key=3
  says twice

  # A falloff of 2 is what there was; others say so
  run 0 "${relight[@]}" -o usual.sft --light-point "$key  1 1 1"
  run 0 "${relight[@]}" -o two.sft --light-point "$key  1 1 1" --falloff 2 --falloff-distance 7
  sameBytes usual.sft two.sft
  run 0 "${relight[@]}" -o far.sft --light-point "$key  1 1 1" --falloff 1
  differentBytes usual.sft far.sft
  run 2 "${relight[@]}" -o none.sft --light-point "$key  1 1 1" --falloff 9
  run 2 sample cornell.obj -o none.ply --photons 1000 --falloff 1
  says "square of the distance"
  leavesNothing none
}

groupsComeByNameFromMeshes() {
  makeNamedScene
  run 0 info cornell.sft
  says "groups         1-5 (1 white, 2 red, 3 green, 4 light, 5 blue)"
  run 0 gather cornell.sft cornell.ply -o by_name.ply --mode bleeding --subset red,blue --quality draft --quiet
  run 0 gather cornell.sft cornell.ply -o by_number.ply --mode bleeding --subset 2,5 --quality draft --quiet
  sameBytes by_name.ply by_number.ply
  # What is chosen is what is left when the others are filtered away
  run 0 index cornell.ply -o alone.sft --precision full --filter "group == 2 or group == 5" --quiet
  run 0 gather alone.sft cornell.ply -o alone.ply --mode bleeding --quality draft --quiet
  run 0 convert by_name.ply -o by_name.csv --keep occlusion --quiet
  run 0 convert alone.ply -o alone.csv --keep occlusion --quiet
  paste -d, by_name.csv alone.csv | awk -F, '
    NR > 1 { d = $4 - $8; s += d * d; n++ } END { print sqrt(s / n); exit !(n > 1000 && s / n < 1e-4) }' ||
    fail "the subset is not what is left"
  # Names stay in clouds of the same kind
  run 0 convert cornell.ply -o copy.ply --quiet
  run 0 index copy.ply -o copy.sft --precision full --quiet
  sameBytes cornell.sft copy.sft
  run 2 sample cornell.obj -o none.ply --group-by name
  says "file,object,material"
  run 0 sample cornell.obj -o none.ptc --count 100 --group-by file
  says "no place for the names of object groups"
  run 3 sample cornell.obj -o none.bgeo --count 100 --group-by file --strict
}

glossyBouncesHaveTheirOptions() {
  makeNamedScene
  local bounce=(bounce cornell.sft --quality draft --quiet)
  run 0 "${bounce[@]}" -o plain.sft
  run 0 "${bounce[@]}" -o shiny.sft --glossy "white=.8,.3" --glossy 5=.5
  run 0 verify shiny.sft
  run 0 info shiny.sft
  says "lobes          of glossy bounces" '"glossy":[{"group":1,"roughness":0.3'
  # All that is sent together is the same; what a wall gets from it is not
  for scene in plain shiny; do
    run 0 convert $scene.sft -o $scene.ply --quiet
    run 0 gather $scene.sft cornell.ply -o lit_$scene.ply --mode bleeding --quality draft --quiet
  done
  sameBytes plain.ply shiny.ply
  differentBytes lit_plain.ply lit_shiny.ply
  # Lobes that go are told
  run 0 convert shiny.sft -o told.ply
  says "lobes of glossy bounces are left out"
  run 0 relight shiny.sft -o relit.sft --light-point "0.5 0.8 0.5  1 1 1"
  says "the lobes of the glossy bounces of shiny.sft are left out"
  run 0 verify relit.sft
  # A share of 0 changes no byte
  run 0 "${bounce[@]}" -o off.sft --glossy white=0
  sameBytes off.sft plain.sft
  run 2 "${bounce[@]}" -o none.sft --glossy white=1.5
  says '"1.5"' "SHARE or SHARE,ROUGHNESS"
  run 2 "${bounce[@]}" -o none.sft --glossy white=.5,.01
  run 2 "${bounce[@]}" -o none.sft --glossy .5
  says "GROUPS=VALUE"
  run 2 "${bounce[@]}" -o none.sft --glossy wite=.5
  says wite
  run 2 "${bounce[@]}" -o none.sft --glossy white=.5 --glossy 1=.6
  says "has a group that another value has"
  leavesNothing none
}

runCase
