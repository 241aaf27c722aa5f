#!/usr/bin/env bash
# One case of the tests of --dry-run: what it says is what a run takes, but for chance, and nothing is
# written.
#
# SURFEIT_SANITIZED: set where peak memory means nothing.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# within FACTOR FORECAST FOUND WHAT
within() {
  python3 -c 'import sys; f, a, b = map(float, sys.argv[1:4]); sys.exit(not 1 / f < (a + 1) / (b + 1) < f)' \
    "$1" "$2" "$3" || fail "$4: forecast $2, found $3"
}

# forecast OUTPUT ARGUMENT...: what a dry run says, in dry.json.
forecast() {
  local output=$1
  shift
  rm -rf scratch && mkdir scratch
  TMPDIR=scratch run 0 "$@" -o "$output" --dry-run --stats dry.json
  says "Nothing was written" "memory           at most" "temporary files  about"
  [[ -z $(ls scratch) && ! -e $output ]] || fail "a dry run left something: $*"
  leavesNothing "${output%%.*}"
  jsonHas dry.json command dry_run records sampled_records input_bytes memory_bytes temporary_bytes \
    output_bytes seconds
  [[ $(field dry.json records) -ge $(field dry.json sampled_records) ]] || fail "no sample: $*"
}

# holds OUTPUT ARGUMENT...: forecasts of bytes within a quarter, of memory above what it takes, of time
# within 8 times on a machine that does other things, too. Sets `temporary`, what was forecast.
holds() {
  local output=$1
  forecast "$@"
  shift
  temporary=$(field dry.json temporary_bytes)
  TMPDIR=scratch run 0 "$@" -o "$output" --quiet --stats stats.json
  within 1.25 "$(field dry.json output_bytes)" "$(stat -c %s "$output")" "output bytes: $*"
  if grep -q temporary_bytes stats.json; then
    within 1.25 "$temporary" "$(field stats.json temporary_bytes)" "temporary bytes: $*"
  fi
  within 8 "$(field dry.json seconds)" "$(field stats.json wall_seconds)" "seconds: $*"
  if [[ -z ${SURFEIT_SANITIZED:-} ]]; then
    # What a job without a budget takes was that of the sample
    (($(field stats.json peak_resident_bytes) <= $(field dry.json memory_bytes) * 5 / 4)) ||
      fail "peak memory: $*"
  fi
  rm "$output"
}

cloudsBecomeClouds() {
  generate city.ply --surfels 200k
  "$cornell_scene" .
  run 0 sample cornell.obj -o photons.ply --photons 100k --quiet
  holds none.ptc convert city.ply
  holds none.ply.gz convert city.ply --every 2
  holds none.las convert city.ply
  ((temporary > 5000000)) || fail "rows of LAS wait in a file"
  holds none.csv normals city.ply
  holds none.ply radiance photons.ply
  # Where a sample fits into memory, and all does not
  generate large.ply --surfels 600k
  run 0 sample cornell.obj -o many.ply --photons 400k --quiet
  holds none.ply normals large.ply --memory 66M --threads 1
  ((temporary > 40000000)) || fail "points are not sorted on disk"
  holds none.ply radiance many.ply --memory 64M --threads 1
  ((temporary > 60000000)) || fail "photons are not indexed on disk"
  run 74 normals no_such_file.ply -o none.ply --dry-run
  run 3 radiance city.ply -o none.ply --dry-run
  says "city.ply: element vertex"
  run 0 convert city.ply -o - --dry-run
  run 0 convert city.ply -o -.csv --dry-run
}

meshesBecomeClouds() {
  "$cornell_scene" .
  holds none.ply sample cornell.obj --count 300k
  holds none.las sample cornell.obj --spacing .004
  ((temporary > 5000000)) || fail "surfels of LAS wait in a file"
  holds none.ply sample cornell.obj --camera "0.5 0.5 2 0.5 0.5 0 50" --size 512x512 --pixels 1
  holds none.ply sample cornell.obj --photons 300k
  mkdir -p caustics
  forecast none.ply sample cornell.obj --photons 300k --caustic-photons caustics/none.ply
  run 2 sample cornell.obj -o none.ply --photons 300k --spacing 1 --dry-run
  run 74 sample no_such_file.obj -o none.ply --dry-run
}

scenesBecomeScenes() {
  makeScene 300000
  holds none.sft relight cornell.sft --mesh cornell.obj --light-directional "-1 -2 -1 3 3 3"
  holds none.sft bounce cornell.sft --quality draft --memory 256M
  holds none.sft bounce cornell.sft --quality draft --bounces 2 --surfels-per-receiver 16 --memory 256M
  ((temporary > 5000000)) || fail "bounces before the last are files"
  run 33 bounce cornell.sft -o none.sft --memory 10M --dry-run
  says "is the least that works"
  run 2 relight cornell.sft -o cornell.sft --light-point "0 0 0 1 1 1" --dry-run
  run 0 convert cornell.ply -o bare.ply --keep position,normal,area --quiet
  run 0 index bare.ply -o bare.sft --quiet
  run 3 relight bare.sft -o none.sft --light-point "0 0 0 1 1 1" --dry-run
  says "bare.sft: found no albedo"
  leavesNothing none
}

valuesAreBakedAndLookedUp() {
  makeScene 600000
  run 0 convert cornell.ply -o receivers.ply --every 6 --quiet
  holds none.vdb brick cornell.ply --channel radiosity
  holds none.vdb brick cornell.ply --channel radiosity --voxel-size .004 --max-error 0 --memory 66M
  ((temporary > 20000000)) || fail "points and voxels were not sorted on disk"
  run 0 convert cornell.ply -o shuffled.ply --every 2 --keep position,normal,radiosity --quiet
  holds none.vdb brick shuffled.ply --channel radiosity
  holds none.ply lookup cornell.ply receivers.ply --channel radiosity
  ((temporary > 10000000)) || fail "points lie in a temporary file"
  run 0 brick cornell.ply --channel radiosity -o map.vdb --quiet
  holds none.csv lookup map.vdb receivers.ply
  run 2 lookup cornell.ply receivers.ply --channel no_such_channel -o none.ply --dry-run
  says "cornell.ply"
  run 2 brick cornell.ply --channel no_such_channel -o none.vdb --dry-run
  says "cornell.ply"
  holds none.ply lookup cornell.ply receivers.ply --channel radiosity --memory 48M --threads 1
  ((temporary > 40000000)) || fail "points are not sorted on disk"
}

runCase
