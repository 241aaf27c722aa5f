#!/usr/bin/env bash
# One case of the program's end-to-end tests.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"
readme=$(dirname "$script")/../../README.md

# Replaces the byte at an offset of a file by its complement.
flipByte() {
  local value
  value=$(od -An -tu1 -j "$2" -N 1 "$1")
  printf '%b' "\\$(printf '%03o' $((255 - value)))" |
    dd of="$1" bs=1 seek="$2" conv=notrunc status=none
}

wholePipelineWorks() {
  "$cornell_scene" .
  exists cornell.obj
  run 0 sample cornell.obj -o cornell.ply --count 5000
  says "5,000 surfels"
  run 0 index cornell.ply -o cornell.sft --memory 64M
  says "5,000 surfels"
  run 0 verify cornell.sft
  run 0 info cornell.sft
  says "5,000" "radiosity"
  run 0 info cornell.ply
  run 0 gather cornell.sft cornell.ply -o lit.ply --mode bleeding --memory 64M
  run 0 info lit.ply
  says occlusion irradiance_r irradiance_g irradiance_b albedo_r
  run 0 view lit.ply -o lit.png --channel lit --size 64x48
  exists lit.png
  [[ $(od -An -c -j 1 -N 3 lit.png | tr -d ' ') == PNG ]] || fail "lit.png is no PNG"
  run 0 view cornell.sft -o scene.exr --size 64x48
  exists scene.exr
  [[ -z $(find . -name '*.tmp') ]] || fail "temporary files left behind"
}

# The command lines of README.md under <!-- tested -->, in their order, with fewer surfels.
readmeCommandsWork() {
  local commands
  commands=$(awk '/^<!-- tested -->/ { tested = 1 }
                  /^```/ { if (inside) { inside = tested = 0 } else inside = 1; next }
                  inside && tested' "$readme" | sed -E 's/--count [0-9]+/--count 3000/')
  [[ $(grep -c '^surfeit ' <<< "$commands") -ge 5 ]] || fail "found few commands in $readme"
  mkdir bin
  ln -s "$surfeit" bin/surfeit
  ln -s "$cornell_scene" bin/cornell_scene
  PATH=$PWD/bin:$PATH bash -euxo pipefail -c "$commands" || fail "a command of $readme"
}

resultsDoNotDependOnThreadsOrMemory() {
  makeScene 20000
  run 0 index cornell.ply -o other.sft --memory 64M --threads 1
  sameBytes cornell.sft other.sft
  run 0 sample cornell.obj -o receivers.ply --count 300 --light-samples 1
  run 0 gather cornell.sft receivers.ply -o one.ply --mode bleeding --threads 1 --memory 1G
  run 0 gather cornell.sft receivers.ply -o many.ply --mode bleeding --threads 4 --memory 48M
  sameBytes one.ply many.ply
}

statisticsHaveTheDocumentedFields() {
  local common=(command stats_version wall_seconds cpu_seconds peak_resident_bytes threads)
  makeScene 3000
  run 0 sample cornell.obj -o again.ply --count 1000 --stats sample.json
  jsonHas sample.json "${common[@]}" triangles surfels area spacing phases
  run 0 index cornell.ply -o again.sft --stats index.json
  jsonHas index.json "${common[@]}" memory_bytes input_bytes surfels skipped_records repeated_surfels normals_found thin_surfels scattered_surfels nodes node_pages \
    surfel_pages file_bytes bytes_per_surfel temporary_bytes surfels_per_second phases \
    sample read build finish
  run 0 generate --surfels 1k -o city.ply --stats generate.json
  jsonHas generate.json "${common[@]}" kind scene_surfels seed order surfels scene_area \
    surfels_per_second
  run 0 index cornell.ply -o dry.sft --dry-run --stats dry.json
  [[ ! -e dry.sft ]] || fail "a dry run wrote a scene"
  jsonHas dry.json "${common[@]}" dry_run records sampled_surfels memory_bytes temporary_bytes \
    file_bytes seconds
  run 0 gather cornell.sft again.ply -o dry.ply --dry-run --stats dry.json
  [[ ! -e dry.ply ]] || fail "a dry run wrote a result"
  jsonHas dry.json "${common[@]}" dry_run receivers recommended_memory_bytes temporary_bytes \
    output_bytes seconds
  run 0 normals cornell.ply -o normals.csv --orient outward --sizes --stats normals.json
  jsonHas normals.json "${common[@]}" points points_without_surface points_outside_trajectory mean_confidence memory_bytes \
    temporary_bytes points_per_second phases order
  run 2 normals cornell.ply -o normals.csv --orient sideways
  says "expected up, outward, consistent, "
  run 0 verify cornell.sft --stats verify.json
  jsonHas verify.json "${common[@]}" pages bytes finding_count findings
  run 0 gather cornell.sft again.ply -o lit.ply --memory 64M --stats gather.json --cache-series series.csv
  jsonHas gather.json "${common[@]}" memory_bytes mode max_solid_angle raster_resolution \
    receivers invalid_receivers receivers_per_second gather_seconds node_cache surfel_cache \
    requests hits front_hits shared_hits waits misses prefetches repeated_loads evictions bytes_read \
    repeated_bytes load_seconds stall_seconds peak_bytes budget_bytes decoded_bytes \
    working_set_bytes temporary_bytes windows begin_seconds end_seconds receivers run_receivers \
    prefetch_receivers
  local name
  for name in begin_seconds run_receivers node_cache.misses surfel_cache.stall_seconds; do
    head -n 1 series.csv | tr , '\n' | grep -qx "$name" || fail "series.csv has no column $name"
  done
  [[ $(awk -F, '{print NF}' series.csv | sort -u | wc -l) == 1 && $(wc -l < series.csv) -ge 2 ]] ||
    fail "series.csv is no table of windows"
  run 0 gather cornell.sft again.ply -o lit.ply --memory 64M --cache-series series.json
  jsonHas series.json begin_seconds node_cache misses
  grep -q '"stats_version": 1' gather.json || fail "stats_version is not 1"
  run 0 tune cornell.sft again.ply --memory 64M --sample 100 --check --plot tune.svg --stats tune.json
  says recommended knee "hit rates are off"
  jsonHas tune.json "${common[@]}" memory_bytes receivers invalid_receivers sampled_receivers \
    sample_seconds decoded_cache_bytes receiver_seconds node_load_seconds surfel_load_seconds \
    hit_rate_error rows curve knee recommended cache_bytes predicted measured frame_bytes requests \
    loads hit_rate bytes_read seconds
  grep -q '</svg>' tune.svg || fail "tune.svg is no SVG"
  run 0 view lit.ply -o lit.png --size 32x32 --stats view.json
  jsonHas view.json "${common[@]}" channel records drawn_surfels coverage
}

helpAndVersionExitWithZero() {
  run 0 --version
  says "surfeit 0."
  run 0 --help
  local command help=$said
  for command in sample generate convert index info verify gather relight bounce radiance brick tune view \
    composite cube normals merge plan ptfilter brickmake lookup; do
    [[ $help == *"  $command "* ]] || fail "no $command in: $help"
    run 0 "$command" --help
    says Example "  surfeit $command "
  done
}

generatedScenesAreTheSameByEveryWay() {
  run 0 generate --surfels 20k -o a.ply
  run 0 generate --surfels 20k --threads 1 -o b.ply
  sameBytes a.ply b.ply
  run 0 generate --surfels 20k --recipe -o a.recipe
  run 0 index a.recipe -o recipe.sft
  run 0 index a.ply -o whole.sft
  sameBytes recipe.sft whole.sft
  local k
  for k in 1 2 3; do run 0 generate --surfels 20k --part "$k/3" -o "part$k.ply"; done
  run 0 index part3.ply part1.ply part2.ply -o parts.sft
  sameBytes parts.sft whole.sft
  run 0 generate --surfels 20k --order shuffled -o shuffled.ply
  run 0 index shuffled.ply -o shuffled.sft
  sameBytes shuffled.sft whole.sft
  run 2 generate --surfels 0 -o none.ply
  run 2 generate --surfels 10x -o none.ply
  run 2 generate --part 7/5 -o none.ply
  run 2 generate --kind town -o none.ply
  run 2 generate --duplicates 101 -o none.ply
  sed 's/^kind .*/kind town/' a.recipe > town.recipe
  run 3 index town.recipe -o none.sft
  says town.recipe
}

missingFileIsAnIoError() {
  makeScene 1000
  run 74 index nowhere.ply -o nowhere.sft
  says nowhere.ply
  run 74 info nowhere.sft
  run 74 verify nowhere.sft
  run 74 gather nowhere.sft cornell.ply -o result.ply
  run 74 gather cornell.sft nowhere.ply -o result.ply
  run 74 tune nowhere.sft cornell.ply
  run 74 tune cornell.sft nowhere.ply
  run 74 gather cornell.sft cornell.ply -o no/such/directory/result.ply
  run 74 view nowhere.ply -o nowhere.png
  run 74 sample nowhere.obj -o nowhere.ply
  leavesNothing result
  leavesNothing nowhere
}

foreignAndEmptyFilesAreBadData() {
  makeScene 1000
  echo "These are no surfels, and no scene either." > foreign
  : > empty
  local file
  for file in foreign empty; do
    run 3 index "$file" -o result.sft
    says "$file"
    run 3 info "$file"
    run 3 verify "$file"
    run 3 gather "$file" cornell.ply -o result.ply
    says "$file"
    run 3 gather cornell.sft "$file" -o result.ply
    run 3 view "$file" -o result.png
  done
  # A cloud where a scene is expected, and the other way round
  run 3 gather cornell.ply cornell.ply -o result.ply
  run 0 index cornell.sft -o result.sft  # a scene is a cloud, too
  rm result.sft
  leavesNothing result
}

unknownOptionsAreUsageErrorsWithASuggestion() {
  run 2
  run 2 gahter
  says "did you mean gather?"
  run 2 index cloud.ply -o scene.sft --memroy 1G
  says "did you mean --memory?"
  run 2 gather scene.sft cloud.ply -o result.ply --max-solid-angel 0.1
  says "did you mean --max-solid-angle?"
  run 2 gather scene.sft
  leavesNothing scene
}

impossibleValuesAreUsageErrors() {
  makeScene 1000
  local gather=(gather cornell.sft cornell.ply -o result.ply) index=(index cornell.ply -o result.sft)
  run 2 "${gather[@]}" --max-solid-angle -1
  run 2 "${gather[@]}" --max-solid-angle nan
  run 2 "${gather[@]}" --quality best
  says "expected draft|standard|final"
  run 2 "${gather[@]}" --raster-resolution 13
  run 2 "${gather[@]}" --raster-resolution 1000
  run 2 "${gather[@]}" --threads 0
  run 2 "${gather[@]}" --threads two
  run 2 "${gather[@]}" --memory 12X
  run 2 "${gather[@]}" --memory -5G
  run 2 "${gather[@]}" --mode glosy
  run 2 "${gather[@]}" --max-dist 0
  run 2 tune cornell.sft cornell.ply --sample -1
  run 2 "${index[@]}" --leaf 0
  run 2 "${index[@]}" --disk-overlap 0.5
  run 2 "${index[@]}" --overlap 2.5
  says "--disk-overlap 2.5"
  run 2 "${index[@]}" --overlap some
  says "expected keep or thin"
  run 2 "${index[@]}" --precision double
  run 2 sample cornell.obj -o result.ply --count 0
  says "expected a whole number of 1 to 2^40"
  run 2 sample cornell.obj -o result.ply --count 3000000000000000
  run 2 sample cornell.obj -o result.ply --count 3x
  run 2 sample cornell.obj -o result.ply --count 2.7
  run 2 sample cornell.obj -o result.ply --photons -3
  run 2 sample cornell.obj -o result.ply --light-point "1 2 3"
  run 2 view cornell.ply -o result.png --channel nothing
  says radiosity
  run 2 view cornell.ply -o result.jpeg
  run 2 gather cornell.sft cornell.ply -o cornell.sft
  leavesNothing result
}

tooSmallBudgetsSayWhatWouldDo() {
  makeScene 20000
  run 33 index cornell.ply -o result.sft --memory 1M
  says "MiB"
  run 33 gather cornell.sft cornell.ply -o result.ply --memory 1M --threads 1
  says "least that works"
  run 33 tune cornell.sft cornell.ply --memory 1M --threads 1
  says "least that works"
  leavesNothing result
  # What it says works
  local least
  least=$(sed -E 's/.* ([0-9.]+) MiB is the least.*/\1/' <<< "$said")
  run 0 sample cornell.obj -o receivers.ply --count 50 --light-samples 1
  run 33 gather cornell.sft receivers.ply -o result.ply --memory 1M --threads 1
  least=$(sed -E 's/.* ([0-9.]+) MiB is the least.*/\1/' <<< "$said")
  run 0 gather cornell.sft receivers.ply -o result.ply --memory "${least}M" --threads 1
}

damagedScenesAreRefusedAndLeaveNoOutput() {
  makeScene 3000
  local size offset
  size=$(stat --format=%s cornell.sft)
  # First surfel page, a page in the middle, header, scene fields, directory, footer
  for offset in 700 $((size / 2)) 20 80 $((size - 100)) $((size - 60)) $((size - 1)); do
    cp cornell.sft damaged.sft
    flipByte damaged.sft "$offset"
    run 3 verify damaged.sft
    says "damaged.sft"
    run 3 gather damaged.sft cornell.ply -o result.ply
    says "damaged.sft"
    leavesNothing result
  done
  cp cornell.sft damaged.sft
  flipByte damaged.sft 700
  run 3 gather damaged.sft cornell.ply -o result.ply
  says "damaged.sft: page" "at 512" "checksum" "expected"
  run 3 verify damaged.sft
  says "damaged.sft: page" "at 512" "checksum" "expected"
}

cutScenesAreRefused() {
  makeScene 3000
  local size length
  size=$(stat --format=%s cornell.sft)
  for length in 3 100 512 600 $((size / 2)) $((size - 1)); do
    head --bytes="$length" cornell.sft > cut.sft
    run 3 verify cut.sft
    run 3 info cut.sft
    run 3 gather cut.sft cornell.ply -o result.ply
  done
  cp cornell.sft long.sft
  echo >> long.sft
  run 3 verify long.sft
  leavesNothing result
}

# gatherPatch NAME OPTION...: gathers at patch.ply to NAME.ply, with the statistics in NAME.json.
gatherPatch() {
  local name=$1
  shift
  run 0 gather cornell.sft patch.ply -o "$name.ply" --mode bleeding --memory 64M \
    --stats "$name.json" "$@"
}

# A patch of 32 x 32 receivers on the floor, patch.ply: clusters that share a far field.
makePatch() {
  {
    printf '%s\n' ply 'format ascii 1.0' 'element vertex 1024' 'property float x' \
      'property float y' 'property float z' 'property float nx' 'property float ny' \
      'property float nz' end_header
    awk 'BEGIN { for (i = 0; i < 1024; ++i) print .1 + .0005 * (i % 32), 0, .1 + .0005 * int(i / 32), 0, 1, 0 }'
  } > patch.ply
}

optionsOfTheirOwnWinOverThePreset() {
  makeScene 5000
  makePatch
  gatherPatch default
  jsonIs default.json max_solid_angle 0.08 raster_resolution 16 near_field_radii 8
  gatherPatch standard --quality standard
  sameBytes standard.ply default.ply
  gatherPatch draft --quality draft
  jsonIs draft.json max_solid_angle 0.2 raster_resolution 10 near_field_radii 4
  differentBytes draft.ply default.ply
  gatherPatch final --quality final
  jsonIs final.json max_solid_angle 0.012 raster_resolution 40 near_field_radii 16

  # One, all, before and after; what is not given comes from the preset
  local own=(--max-solid-angle 0.2 --raster-resolution 8 --near-field 5)
  gatherPatch own "${own[@]}"
  gatherPatch after --quality final "${own[@]}"
  gatherPatch before "${own[@]}" --quality final
  gatherPatch around --raster-resolution 8 --near-field 5 --quality final \
    --max-solid-angle 0.2
  local name
  for name in own after before around; do
    jsonIs $name.json max_solid_angle 0.2 raster_resolution 8 near_field_radii 5
    sameBytes $name.ply own.ply
  done
  gatherPatch after --quality draft --raster-resolution 8
  gatherPatch before --raster-resolution 8 --quality draft
  for name in after before; do
    jsonIs $name.json max_solid_angle 0.2 raster_resolution 8 near_field_radii 4
  done
  sameBytes after.ply before.ply
  differentBytes after.ply draft.ply

  # No preset touches these
  local limits=(--max-dist 0.7 --sides both --bias 0.3)
  gatherPatch own --max-solid-angle 0.2 --raster-resolution 10 --near-field 4 "${limits[@]}"
  gatherPatch after --quality draft "${limits[@]}"
  gatherPatch before "${limits[@]}" --quality draft
  sameBytes after.ply own.ply
  sameBytes before.ply own.ply
  differentBytes own.ply draft.ply
}

invalidReceiversGetNanOrAreRefused() {
  makeScene 1000
  cat > receivers.ply << 'PLY'
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float nx
property float ny
property float nz
end_header
0.5 0.01 0.5 0 1 0
nan 0.01 0.5 0 1 0
0.4 0.01 0.5 0 1 0
PLY
  run 0 gather cornell.sft receivers.ply -o result.ply --memory 64M
  says "1 record with a non-finite value (first: record 1, whose"
  exists result.ply
  rm result.ply
  run 3 gather cornell.sft receivers.ply -o result.ply --memory 64M --strict
  says "record 1"
  leavesNothing result
}

# A grid of 50 x 50 points half a unit apart, from x = 0 and from x = 20.
makeTiles() {
  awk -v from="${1:-0}" 'BEGIN {
    print "x,y,z,radius,area"
    for (y = 0; y < 50; ++y) for (x = 0; x < 50; ++x) print from + x / 2 "," y / 2 ",1,.4,.25"
  }'
}

tilesThatOverlapAreToldOrThinned() {
  makeTiles 0 > left.csv
  makeTiles 20 > right.csv
  run 0 index left.csv right.csv -o kept.sft
  says "500 surfels repeat another at its place" "--overlap thin"
  run 3 index left.csv right.csv -o strict.sft --strict
  leavesNothing strict
  run 0 index left.csv right.csv -o thin.sft --overlap thin --stats thin.json
  says "500 surfels repeat another at its place: they are left out"
  jsonIs thin.json surfels 4500 repeated_surfels 500
  run 0 verify thin.sft
  run 0 index right.csv left.csv -o turned.sft --overlap thin
  sameBytes thin.sft turned.sft
  run 0 info kept.sft
  says "% of the places have several points: \`index --overlap thin\` keeps one" "spacing        0.443"
  run 0 info thin.sft
  says "repeated       0 % of the places"
}

infoTellsDensityAndWhatIsMissing() {
  makeTiles > grid.csv
  run 0 info grid.csv
  says "spacing        0.4431" "by a sample of 1,000 points" "points per unit of area" \
    "repeated       0 % of the places" "no normals     \`surfeit normals\` finds them" "no colors"
  [[ $said != *"no sizes"* ]] || fail "sizes are there: $said"
  run 0 convert grid.csv grid.csv -o twice.ply --drop radius,area
  run 0 info twice.ply --json
  says '"repeated_places": 1.0' '"median": 0.443' '"sampled_points": 1000' '"sizes": "`surfeit index`'
  printf '1 2 3\n1 2 4\n1 3 3\n' > three.xyz
  run 0 info three.xyz
  says "spacing        "
  printf '1 2 3\n1 2 3\n' > one.xyz
  run 0 info one.xyz
  says "none: all points are at one place"
}

interruptLeavesNoFile() {
  makeScene 60000
  stoppedLeavesNothing result.ply gather cornell.sft cornell.ply --mode bleeding --memory 1G \
    --max-solid-angle 0.002 --raster-resolution 32 --threads 1
}

runCase
