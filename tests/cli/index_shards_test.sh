#!/usr/bin/env bash
# One case of the end-to-end tests of an index in shards.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# passes N INPUT...: all passes of all shards, and the merge.
passes() {
  local count=$1 pass shard
  shift
  for pass in count distribute build; do
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

badPassesAreRefused() {
  generate set.ply --surfels 1k
  local index=(index set.ply -o out.sft)
  run 2 "${index[@]}" --pass sort --shard 1/2
  run 2 "${index[@]}" --pass count
  says "expected --shard I/N"
  run 2 "${index[@]}" --pass count --shard 3/2
  says "I/N"
  run 2 "${index[@]}" --shard 1/2
  says "expected --pass count|distribute|build|merge"
  run 2 "${index[@]}" --pass merge
  says "--shards N"
  run 2 "${index[@]}" --pass merge --shard 1/2
  run 2 "${index[@]}" --pass build --shard 1/2 --remove-shards
  run 2 "${index[@]}" --pass count --shard 1/2 --dry-run
  run 2 "${index[@]}" --pass count --shard 1/2 --normals estimate
  says "surfeit normals"
  run 2 index set.ply -o - --pass count --shard 1/2
  run 75 "${index[@]}" --pass merge --shards 2
  says "shards 1-2 of 2 are missing" "--pass count"
  # What needs neighbours, and the way out
  printf '%s\n' "1 2 3" "2 3 4" "3 4 5" "5 6 7" > bare.xyz
  run 2 index bare.xyz -o out.sft --pass count --shard 1/2
  says "no area of their own"
}

runCase
