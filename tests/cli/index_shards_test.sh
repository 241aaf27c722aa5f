#!/usr/bin/env bash
# One case of the end-to-end tests of an index in shards.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# passes N INPUT...: all passes of all shards, and the merge.
passes() {
  local count=$1 pass shard
  shift
  for pass in ${names:-count distribute build}; do
    for ((shard = 1; shard <= count; ++shard)); do
      run 0 index "$@" -o out.sft --memory 80M --threads 1 --pass "$pass" --shard "$shard/$count"
    done
  done
  run 0 index "$@" -o out.sft --memory 80M --pass merge --shards "$count" --remove-shards
}

# Two clouds, one that cannot be read at any place, and a group.
passesHaveTheBytesOfOneIndex() {
  generate a.ply --surfels 150k
  generate b.ply --surfels 60k --seed 2
  gzip b.ply
  generate lamp.ply --surfels 2k --seed 3
  run 0 index a.ply b.ply.gz --group lamp=lamp.ply -o one.sft --memory 128M --overlap thin
  passes 3 a.ply b.ply.gz --group lamp=lamp.ply --overlap thin
  sameBytes one.sft out.sft
  leavesNothing out.sft. || fail "left behind: $(ls)"
}

# On a globe; and what the statistics say.
farCloudsHaveTheBytesOfOneIndex() {
  generate near.ply --surfels 60k
  run 0 convert near.ply -o far.ply --transform "1 0 0 3500000 0 1 0 5600000 0 0 1 100 0 0 0 1"
  run 0 index far.ply -o one.sft --memory 128M
  run 0 index far.ply -o out.sft --memory 64M --pass count --shard 1/2 --stats count.json
  jsonIs count.json shard 1 shards 2 records 30000 surfels 30000 finished_shards 0
  run 0 index far.ply -o out.sft --memory 64M --pass count --shard 1/2 --stats count.json
  says "was done before"
  jsonIs count.json finished_shards 1
  passes 2 far.ply
  sameBytes one.sft out.sft
}

# Bare places, places with a size, and with a coverage.
bareCloudsHaveTheBytesOfOneIndex() {
  local names="count distribute build places sizes"
  generate a.ply --surfels 120k --duplicates 2
  generate b.ply --surfels 30k --seed 2
  run 0 convert a.ply -o bare.ply --keep albedo
  run 0 convert b.ply -o splats.ply --drop area --set "coverage = 0.4"
  run 0 index bare.ply b.ply splats.ply -o one.sft --memory 128M
  passes 3 bare.ply b.ply splats.ply
  sameBytes one.sft out.sft
  leavesNothing out.sft. || fail "left behind: $(ls)"
  run 0 index bare.ply -o one.sft --memory 128M --normals estimate --orient "sensor 500,80,500"
  local told
  told=$(grep "lie on no surface" <<< "$said")
  passes 2 bare.ply --normals estimate --orient "sensor 500,80,500"
  says "$told"
  sameBytes one.sft out.sft
  # What the passes say
  run 0 index bare.ply -o out.sft --memory 64M --pass count --shard 1/2
  run 0 index bare.ply -o out.sft --memory 64M --pass count --shard 2/2
  run 75 index bare.ply -o out.sft --memory 64M --pass places --shard 1/2
  says "--pass build" "shards 1-2 of 2 are missing"
  run 0 index bare.ply -o out.sft --memory 64M --pass places --shard 2/2
  says "nothing to do, places is of shard 1"
}

# The command lines of docs/farm.md with GNU parallel, as many jobs at once as there are processors.
parallelRunsThePasses() {
  command -v parallel > /dev/null || { echo "skipped: no GNU parallel"; exit 77; }
  local pass
  generate set.ply --surfels 200k
  run 0 index set.ply -o one.sft --memory 128M
  for pass in count distribute build; do
    seq 7 | parallel --jobs 2 --halt now,fail=1 "$surfeit" index -q set.ply -o out.sft \
      --memory 64M --threads 1 --pass "$pass" --shard {}/7
  done
  run 0 index set.ply -o out.sft --memory 64M --pass merge --shards 7
  sameBytes one.sft out.sft
}

# A task that is killed leaves no file of its own; what lacks is named, with the exit status of what
# is to be done first.
killedTasksAreDoneAgain() {
  local pass status before
  generate set.ply --surfels 200k
  run 0 index set.ply -o one.sft --memory 128M
  for pass in count distribute build; do
    run 0 index set.ply -o out.sft --memory 64M --pass "$pass" --shard 1/2
    for before in 0.02 0.05 0.1; do
      status=0
      timeout -s KILL "$before" "$surfeit" index -q set.ply -o out.sft --memory 64M --threads 1 \
        --pass "$pass" --shard 2/2 || status=$?
      ((status == 137 || status == 0)) || fail "status $status"
    done
    case $pass in
      count) rm -f out.sft.count-2-of-2; run 75 index set.ply -o out.sft --memory 64M --pass distribute --shard 1/2 ;;
      distribute) rm -f out.sft.ranges-2-of-2; run 75 index set.ply -o out.sft --memory 64M --pass build --shard 1/2 ;;
      build) rm -f out.sft.slabs-2-of-2; run 75 index set.ply -o out.sft --memory 64M --pass merge --shards 2 ;;
    esac
    says "shards 2 of 2 are missing" "--pass $pass" "--array=2"
    run 0 index set.ply -o out.sft --memory 64M --pass "$pass" --shard 2/2
  done
  run 0 index set.ply -o out.sft --memory 64M --pass merge --shards 2 --remove-shards
  sameBytes one.sft out.sft
}

# The same of the passes for neighbours, also with a disk that is full.
killedSizesAreFoundAgain() {
  local status before index=(index bare.ply -o out.sft --memory 64M --threads 1)
  generate set.ply --surfels 150k
  run 0 convert set.ply -o bare.ply --keep albedo
  run 0 index bare.ply -o one.sft --memory 128M
  passes_before "${index[@]}"
  for before in 0.02 0.05 0.1 0.2; do
    status=0
    timeout -s KILL "$before" "$surfeit" "${index[@]}" -q --pass places --shard 1/2 || status=$?
    ((status == 137 || status == 0)) || fail "status $status"
  done
  rm -f out.sft.places*
  (ulimit -f 1000; trap '' XFSZ; exec "$surfeit" "${index[@]}" --pass places --shard 1/2) && fail "a limit"
  leavesNothing out.sft.places || fail "left behind: $(ls)"
  run 75 "${index[@]}" --pass sizes --shard 1/2
  says "shards 1 of 2 are missing" "--pass places" "--array=1"
  run 0 "${index[@]}" --pass places --shard 1/2
  run 0 "${index[@]}" --pass sizes --shard 1/2
  for before in 0.1 0.2 0.4; do
    status=0
    timeout -s KILL "$before" "$surfeit" "${index[@]}" -q --pass sizes --shard 2/2 || status=$?
    ((status == 137 || status == 0)) || fail "status $status"
  done
  rm -f out.sft.sized-2-of-2
  run 75 "${index[@]}" --pass merge --shards 2
  says "shards 2 of 2 are missing" "--pass sizes" "--array=2"
  run 0 "${index[@]}" --pass sizes --shard 2/2
  run 0 "${index[@]}" --pass merge --shards 2 --remove-shards
  sameBytes one.sft out.sft
  leavesNothing out.sft. || fail "left behind: $(ls)"
}

# passes_before INDEX...: what `places` waits for, of two shards.
passes_before() {
  local pass shard
  for pass in count distribute build; do
    for shard in 1/2 2/2; do run 0 "$@" --pass "$pass" --shard $shard; done
  done
}

badPassesAreRefused() {
  generate set.ply --surfels 1k
  local index=(index set.ply -o out.sft)
  run 2 "${index[@]}" --pass sort --shard 1/2
  run 2 "${index[@]}" --pass count
  says "expected --shard I/N"
  run 2 "${index[@]}" --pass count --shard 3/2
  says "I/N"
  run 2 "${index[@]}" --shard 1/2
  says "expected --pass count|distribute|build|places|sizes|merge"
  run 2 "${index[@]}" --pass merge
  says "--shards N"
  run 2 "${index[@]}" --pass merge --shard 1/2
  run 2 "${index[@]}" --pass build --shard 1/2 --remove-shards
  run 2 "${index[@]}" --pass count --shard 1/2 --dry-run
  run 2 "${index[@]}" --pass places --shards 2
  run 2 "${index[@]}" --pass count --shard 1/2 --normals estimate --orient "trajectory set.ply"
  says "surfeit normals"
  run 2 index set.ply -o - --pass count --shard 1/2
  run 75 "${index[@]}" --pass merge --shards 2
  says "shards 1-2 of 2 are missing" "--pass count"
}

runCase
