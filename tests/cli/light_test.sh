#!/usr/bin/env bash
# One case of the end-to-end tests of lights: photons, bounces, outputs, interpolation, subsets.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# Photons to surfels to a gather, and a scene with more bounces.
photonsAndBouncesWork() {
  makeScene 5000
  run 0 sample cornell.obj -o photons.ply --photons 20000
  run 0 radiance photons.ply -o lit.ply --stats radiance.json
  jsonHas radiance.json photons surfels area reflected_power
  run 0 index lit.ply -o lit.sft
  run 0 gather lit.sft cornell.ply -o final.ply --mode bleeding
  exists final.ply
  run 3 radiance cornell.ply -o wrong.ply
  leavesNothing wrong.ply

  run 0 bounce cornell.sft --bounces 2 -o bounced.sft --stats bounce.json
  jsonHas bounce.json bounces passes mean_radiosity largest_change
  run 0 verify bounced.sft
  run 0 gather bounced.sft cornell.ply -o bounced.ply --mode bleeding
  differentBytes bounced.ply final.ply
  run 2 bounce cornell.sft --bounces 0 -o none.sft
  leavesNothing none.sft
}

# Other light for a scene: the light of the sampler, layers, and what is refused.
relightGivesOtherLight() {
  "$cornell_scene" .
  local lamp=(--light-point "0.5 0.8 0.5  1 1 1") sun=(--light-directional "-1 -2 -1  3 3 3")
  run 0 sample cornell.obj -o cornell.ply --count 20000 --quiet
  run 0 index cornell.ply -o cornell.sft --quiet
  run 0 relight cornell.sft -o lamp.sft --mesh cornell.obj "${lamp[@]}" --stats relight.json
  jsonHas relight.json gain adds surfels lit_surfels triangles file_bytes mean_radiosity phases
  says "shadows of" "mean radiosity"
  run 0 verify lamp.sft
  run 0 relight lamp.sft -o both.sft --mesh cornell.obj "${sun[@]}" --add --gain 0.5 --threads 1 --memory 64M
  says --no-mesh-light
  run 0 relight lamp.sft -o both.sft --mesh cornell.obj "${sun[@]}" --add --gain 0.5 --no-mesh-light --strict
  run 0 verify both.sft
  run 0 info both.sft
  says radiosity
  run 0 gather both.sft cornell.ply -o baked.ply --mode bleeding --quality draft --quiet
  run 0 bounce both.sft -o bounced.sft --quality draft --quiet
  run 0 relight bounced.sft -o again.sft --mesh cornell.obj "${lamp[@]}"
  says "bounces of bounced.sft go"
  run 0 bounce again.sft -o bounced.sft --quality draft --quiet

  run 0 relight cornell.sft -o bright.sft "${lamp[@]}"
  says "no shadows" --mesh
  run 3 relight cornell.sft -o none.sft "${lamp[@]}" --strict
  run 2 relight cornell.sft -o none.sft --light-pont "1 1 1  1 1 1"
  says --light-point
  run 2 relight cornell.sft -o none.sft --light-point "1 1 1"
  run 2 relight cornell.sft -o none.sft "${lamp[@]}" --gain -1
  run 2 relight cornell.sft -o none.sft "${lamp[@]}" --ground-plane
  run 2 relight cornell.sft -o cornell.sft "${lamp[@]}"
  run 74 relight cornell.sft -o none.sft "${lamp[@]}" --mesh nowhere.obj
  run 0 convert cornell.ply -o bare.ply --keep position,normal --quiet
  run 0 index bare.ply -o bare.sft --quiet
  run 3 relight bare.sft -o none.sft "${lamp[@]}"
  says "no albedo" albedo_r
  leavesNothing none.sft
}

# By the name of the result; all of them are read again.
radianceWritesEveryFormat() {
  local extension
  "$cornell_scene" .
  run 0 sample cornell.obj -o photons.ply --photons 20000
  for extension in ply ply.gz ply.zst ptc ptc.gz vdb prt bgeo bgeo.gz pdb xyz csv.zst; do
    run 0 radiance photons.ply -o "lit.$extension" --nphotons 50 --stats radiance.json
    run 0 info "lit.$extension"
    case $extension in
      ptc*) says PTC ;;
      vdb) says OpenVDB ;;
      prt | bgeo* | pdb) says "${extension%%.*}" ;;
      xyz | csv*) says text ;;
      *) says PLY ;;
    esac
    run 0 index "lit.$extension" -o lit.sft --stats index.json
    jsonIs index.json surfels "$(field radiance.json surfels)" skipped_records 0
    run 0 info lit.sft
    says "input had      position, normal, radius, area, radiosity, albedo"
  done
  run 0 convert lit.ply.gz -o again.csv
  run 0 convert lit.csv.zst -o lit.csv
  sameBytes lit.csv again.csv

  run 2 radiance photons.ply -o none.jpg
  says none.jpg .ptc
  run 2 radiance photons.ply -o none.exr
  says "write .ply instead"
  run 2 radiance photons.ply -o none.vdb.gz
  says "end with .vdb"
  local four=(photons.ply photons.ply photons.ply photons.ply)
  run 0 convert "${four[@]}" "${four[@]}" "${four[@]}" "${four[@]}" -o many.ply
  run 33 radiance many.ply -o none.vdb --memory 64M
  says "OpenVDB files are sorted in memory"
  leavesNothing none
}

radianceHasItsOptions() {
  "$cornell_scene" .
  run 0 sample cornell.obj -o photons.ply --photons 20000
  run 0 radiance photons.ply -o all.ply --stats all.json
  run 0 radiance photons.ply -o near.ply --max-radius 0.02 --stats near.json
  jsonIs near.json max_radius 0.02 photons_per_estimate 100
  (($(field near.json sparse_surfels) > $(field all.json sparse_surfels))) ||
    fail "no more sparse surfels within a smaller radius"
  run 0 radiance photons.ply -o few.ply --photons-per-estimate 10
  differentBytes few.ply all.ply
  run 0 radiance photons.ply -o large.ply --disk-overlap 9
  differentBytes large.ply all.ply
  run 0 radiance photons.ply -o grey.ply --channels albedo=- --albedo "0.25 0.25 0.25"
  says "0.25 0.25 0.25 is used"
  run 0 radiance photons.ply -o again.ply --memory 64M --threads 1
  sameBytes again.ply all.ply
  run 74 radiance photons.ply -o none.ply --temp nowhere
  says nowhere
  run 2 radiance photons.ply -o none.ply --albedo "1 2"
  run 2 radiance photons.ply -o none.ply --disk-overlap 0
  leavesNothing none
}

# Outputs, cones, falloff, reflections; and what they lack is told before work starts.
lightsHaveTheirOptions() {
  makeScene 5000
  run 0 gather cornell.sft cornell.ply -o a.ply --outputs occlusion,bent_normal \
    --cone-angle 0.8 --falloff 2 --falloffmode 1 --max-dist 1 --distribution uniform
  grep -aq "property float bent_normal_z" a.ply || fail "no bent normals"
  run 0 gather cornell.sft cornell.ply -o b.ply --mode glossy --camera 0.5,0.5,2.4
  grep -aq "property float reflection_r" b.ply || fail "no reflection"
  run 3 gather cornell.sft cornell.ply -o c.ply --mode glossy
  says view_x --camera
  run 2 gather cornell.sft cornell.ply -o c.ply --outputs occlusion,colour
  says "found \"colour\"" environment
  run 2 gather cornell.sft cornell.ply -o c.ply --outputs environment
  says --environment
  run 74 gather cornell.sft cornell.ply -o c.ply --environment no_such_map.exr
  says no_such_map.exr
  leavesNothing c.ply
}

interpolationIsAnOption() {
  makeScene 20000
  run 0 gather cornell.sft cornell.ply -o all.ply --stats all.json
  jsonIs all.json max_variation 0 interpolated_receivers 0
  run 0 gather cornell.sft cornell.ply -o some.ply --max-variation 0.1 --stats some.json
  jsonIs some.json max_variation 0.1
  differentBytes all.ply some.ply
  run 2 gather cornell.sft cornell.ply -o none.ply --max-variation -1
  run 2 tune cornell.sft cornell.ply --max-variation 0.1
  says "leave it out"
}

tuningKnowsTheLights() {
  makeScene 5000
  run 0 tune cornell.sft cornell.ply --mode glossy --camera 0.5,0.5,2.4
  run 3 tune cornell.sft cornell.ply --mode glossy
  says --camera
  run 3 tune cornell.sft cornell.ply --subset 1
  says group
}

# A floor of group 0 and, above it, a lamp of group 7 behind a screen of group 3: lit.ply, groups.sft.
makeGroupedScene() {
  awk 'BEGIN {
    print "ply\nformat ascii 1.0\nelement vertex 1200"
    for (split("x y z nx ny nz radius area radiosity_r radiosity_g radiosity_b", name, " "); ++n in name;)
      print "property float " name[n]
    print "property uchar group\nend_header"
    for (layer = 0; layer < 3; ++layer)
      for (i = 0; i < 400; ++i)
        print (i % 20) / 10 - .95, int(i / 20) / 10 - .95, layer, 0, 0, layer ? -1 : 1, .08, .01,
          layer == 2, layer == 2, layer == 2, layer ? layer * 4 - 1 : 0
  }' > groups.ply
  run 0 index groups.ply -o groups.sft --quiet
}

subsetsAreChosenByGroup() {
  makeGroupedScene
  run 0 verify groups.sft
  run 0 info groups.sft
  says "radiosity, group" "groups         0,3,7"
  run 0 info groups.sft --json
  says '"groups": "0,3,7"'
  # Only the floor, at which to gather
  awk '/^element/ { print "element vertex 400"; next } { print } /^end_header/ { body = 1; next }
       body && ++n == 400 { exit }' groups.ply > floor.ply
  run 0 gather groups.sft floor.ply -o all.ply --mode bleeding --memory 64M
  run 0 gather groups.sft floor.ply -o every.ply --mode bleeding --memory 64M --subset 0-63
  sameBytes all.ply every.ply
  run 0 gather groups.sft floor.ply -o lamp.ply --mode bleeding --memory 64M --subset 7
  differentBytes all.ply lamp.ply
  run 0 gather groups.sft floor.ply -o same.ply --mode bleeding --memory 64M --subset 1,5-9
  sameBytes lamp.ply same.ply

  run 2 gather groups.sft floor.ply -o none.ply --subset 1,4-6
  says "groups.sft: found groups 0,3,7, expected one of those chosen: 1,4-6"
  run 2 bounce groups.sft -o none.sft --subset 64
  says "--subset" "expected groups from 0 to 63"
  run 2 gather groups.sft floor.ply -o none.ply --subset 3-1
  says "--subset" "3-1"
  run 0 generate --surfels 1k -o city.ply
  run 0 index city.ply -o city.sft
  run 3 gather city.sft floor.ply -o none.ply --subset 0
  says "city.sft: found no groups"
  run 3 bounce city.sft -o none.sft --subset 0
  says "city.sft: found no groups"
  leavesNothing none
}

# The scene above, built from a file for each group, whose names choose as the numbers do.
subsetsAreChosenByName() {
  makeGroupedScene
  local group
  for group in 0 3 7; do
    run 0 convert groups.ply -o "group_$group.ply" --filter "group == $group" \
      --keep position,normal,radius,area,radiosity --quiet
  done
  run 0 index group_0.ply --group screen=group_3.ply --group "lamp=group_7.ply" -o named.sft
  run 0 verify named.sft
  run 0 info named.sft
  says "groups         0-2 (1 screen, 2 lamp)"
  run 0 info named.sft --json
  says '"group_names": {' '"1": "screen"' '"2": "lamp"'

  local chosen
  for chosen in "7 lamp" "3,7 screen,lamp" "0,7 0,lamp" "0-63 0-63"; do
    run 0 gather groups.sft group_0.ply -o by_number.ply --mode bleeding --subset "${chosen% *}" --quiet
    run 0 gather named.sft group_0.ply -o by_name.ply --mode bleeding --subset "${chosen#* }" --quiet
    sameBytes by_number.ply by_name.ply
  done

  # Names stay with the light; files of one name are one group, in place of their own
  run 0 index group_0.ply --group "all of it=groups.ply" --group "all of it=group_7.ply" -o one.sft
  says "groups of its own are left out"
  run 0 info one.sft
  says "groups         0,1 (1 all of it)"
  run 0 index --group floor=group_0.ply -o floor.sft --dry-run
  run 3 index --group floor=groups.ply -o none.sft --strict

  run 2 gather named.sft group_0.ply -o none.ply --subset lump
  says "--subset" lump "screen, lamp"
  run 2 gather groups.sft group_0.ply -o none.ply --subset lamp
  says "names of the scene: none"
  run 74 gather nowhere.sft group_0.ply -o none.ply --subset lamp
  run 2 index --group 7up=group_7.ply -o none.sft
  says "begins with a digit"
  run 2 index --group group_7.ply -o none.sft
  says "NAME=FILE"
  run 74 index --group lamp=nowhere.ply -o none.sft
  run 2 index -o none.sft
  local many=()
  for group in {1..64}; do many+=(--group "name_$group=group_7.ply"); done
  run 2 index "${many[@]}" -o none.sft
  says "at most 63"
  cp group_7.ply copy.ply
  run 2 index --group lamp=copy.ply -o copy.ply
  says "its input"
  sameBytes copy.ply group_7.ply
  leavesNothing none
}

# Bounces at few of the surfels, the last one too, against those at all surfels.
sparedBouncesAreNearTheWholeOnes() {
  makeScene 40000
  run 0 bounce cornell.sft -o whole.sft --bounces 2 --quality draft --stats whole.json --quiet
  run 0 bounce cornell.sft -o spared.sft --bounces 2 --quality draft --surfels-per-receiver 16 --spare-last \
    --stats spared.json --quiet
  run 0 bounce cornell.sft -o most.sft --bounces 2 --quality draft --surfels-per-receiver 16 --stats most.json --quiet
  run 0 verify spared.sft
  differentBytes spared.sft most.sft
  jsonHas spared.json spare_last
  local name
  for name in whole most spared; do
    sed -n -E 's/^ *"receivers": ([0-9]+),?$/\1/p' $name.json | xargs echo $name >> receivers
    run 0 convert $name.sft -o $name.csv --keep radiosity,area --quiet
  done
  cat receivers
  # Receivers of both bounces: all; few and all; few
  awk '{ first[$1] = $2; last[$1] = $3 }
       END { exit !(last["most"] == last["whole"] && first["spared"] == first["most"] &&
                    last["spared"] == first["spared"] && 6 * last["spared"] < last["whole"]) }' receivers ||
    fail "numbers of receivers"
  # Error of what the bounces add, weighted by area, as a part of what they add: root mean square
  run 0 convert cornell.sft -o direct.csv --keep radiosity,area --quiet
  head -3 whole.csv
  paste -d, direct.csv whole.csv spared.csv | awk -F, '
    NR == 1 { for (i = 1; i <= NF; ++i) at[$i, ++seen[$i]] = i; next }
    { for (n = split("r g b", c, " "); n; --n) {
        name = "radiosity_" c[n]
        whole = $at[name, 2] - $at[name, 1]; spared = $at[name, 3] - $at[name, 1]
        w = $at["area", 1]; e += w * (spared - whole) ^ 2; s += w * whole ^ 2; d += w * (spared - whole); m += w * whole
      } }
    END { rms = sqrt(e / s); mean = d / m; printf "error: rms %.4f, mean %.4f of the bounces\n", rms, mean
          exit !(rms > 0 && rms < 0.08 && mean < 0.01 && mean > -0.01) }' ||
    fail "spared bounces are too far off"
  run 2 bounce cornell.sft -o none.sft --spare-last
  says --surfels-per-receiver
  leavesNothing none
}

# What counts only beside another option is told, and refused by --strict.
optionsWithoutOthersAreTold() {
  makeScene 2000
  local option
  for option in "--roughness .3" "--camera 0,0,1" "--falloff-mode polynomial" "--environment-rotation 20" \
    "--environment-intensity 2" "--max-pixel-dist 8"; do
    run 0 gather cornell.sft cornell.ply -o out.ply --quality draft $option
    says "${option%% *} has no effect without --"
    run 3 gather cornell.sft cornell.ply -o strict.ply --quality draft --strict $option
    leavesNothing strict.ply
  done
  run 0 gather cornell.sft cornell.ply -o out.ply --quality draft --strict --max-variation .02 --max-pixel-dist 8 --falloff 1
}

runCase
