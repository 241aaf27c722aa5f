#!/usr/bin/env bash
# One case of the tests with a Slurm cluster, label `farm`; scripts/farm_test.sh installs and runs.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"
source "$(dirname "${BASH_SOURCE[0]}")/farm_steps.sh"
source "$(dirname "${BASH_SOURCE[0]}")/slurm_steps.sh"

# runJob RESULT SHARDS OPTION...: plans and runs a gather, and waits for its end.
runJob() {
  local result=$1 shards=$2
  shift 2
  run 0 plan "$scene" "$receivers" -o "$result" --shards "$shards" --memory 64M --time 5m \
    --mode bleeding --threads 1 --slurm "$@"
  printf '%s\n' "$said" > job.sh
  bash job.sh || fail "exit status $? of the job"
  waitUntil 240 test -e "$result.farm/end" ||
    fail "no end: $(squeue; cat "$result.farm"/merge.log; tail -n 20 "$slurm"/*.log)"
  [[ $(cat "$result.farm/end") == 0 ]] || fail "$(cat "$result.farm/end" "$result.farm"/merge.log)"
}

# An array of 7 over two nodes: one task is killed, one is lost with its shell, one has too little
# memory, one is told to stop, and one shard file is removed.
faultsAreOvercome() {
  skipWithoutSlurm
  makeFarmScene
  makeFarmSurfeit
  startSlurm
  : > faults/killed-2
  : > faults/stopped-3
  echo 200 > faults/memory-4
  : > faults/lost-5
  echo "lit [1].ply.shard-6-of-7" > faults/removed-6
  runJob "lit [1].ply" 7
  sameBytes expected.ply "lit [1].ply"
  callsAre 1 "64:0"
  callsAre 2 "64:137 64:0"
  callsAre 3 "64:143 64:0"
  callsAre 4 "64:33 128:33 256:0"
  callsAre 5 "64:lost 64:0"
  callsAre 6 "64:0 64:0"
  # Both nodes worked
  [[ $(cat nodes | sort -u | wc -l) == 2 ]] || fail "worked: $(cat nodes)"
}

anyNumberOfShardsGivesTheSameBytes() {
  skipWithoutSlurm
  makeFarmScene
  makeFarmSurfeit
  startSlurm
  local shards
  for shards in 1 2 64; do
    runJob "lit.$shards.ply" "$shards"
    sameBytes expected.ply "lit.$shards.ply"
  done
}

sequencesAreOneArray() {
  skipWithoutSlurm
  makeFarmScene
  makeFarmSurfeit
  startSlurm
  local frame
  for frame in 1 2 3; do cp "$receivers" "r.000$frame.ply"; done
  receivers=r.####.ply
  echo 100 > faults/memory-2
  runJob "lit.####.ply" 2 --frames 1-3
  for frame in 1 2 3; do sameBytes expected.ply "lit.000$frame.ply"; done
}

# runIndexJob SHARDS OPTION...: plans and runs an index, and waits for its end.
runIndexJob() {
  planIndex slurm "$1" out.sft --time 5m "${@:2}"
  printf '%s\n' "$said" > job.sh
  bash job.sh || fail "exit status $? of the job"
  waitUntil 240 test -e out.sft.farm/end ||
    fail "no end: $(squeue; cat out.sft.farm/merge.log; tail -n 20 "$slurm"/*.log)"
  [[ $(cat out.sft.farm/end) == 0 ]] || fail "$(cat out.sft.farm/end out.sft.farm/merge.log)"
}

# An index by the script of a plan: a task of each pass fails in a way of its own, and a file of the
# build is gone when the merge looks.
indexesGiveTheSameBytes() {
  skipWithoutSlurm
  makeFarmSurfeit
  makeFarmCloud
  startSlurm
  local shards
  : > faults/killed-count-2
  : > faults/lost-distribute-5
  echo 100 > faults/memory-build-4
  echo out.sft.slabs-6-of-7 > faults/removed-build-6
  runIndexJob 7
  sameBytes one.sft out.sft
  [[ $(calls count-2) == "64:137"* ]] || fail "calls of count 2: $(calls count-2)"
  [[ $(calls build-4) == *"64:33"*"128:0"* ]] || fail "calls of build 4: $(calls build-4)"
  for shards in 1 2 ${FARM_SHARDS:-64}; do
    rm -f out.sft
    runIndexJob "$shards"
    sameBytes one.sft out.sft
  done
}

# The same of a cloud whose sizes and normals follow from neighbours; `places` has one task.
sizesGiveTheSameBytes() {
  skipWithoutSlurm
  makeBareFarmCloud
  makeFarmSurfeit
  startSlurm
  echo 100 > faults/memory-places-1
  : > faults/lost-sizes-3
  : > faults/stopped-sizes-2
  runIndexJob 4 --normals estimate
  sameBytes one.sft out.sft
  callsAre places-1 "64:33 128:0"
  callsAre places-2 ""
  [[ $(calls sizes-3) == *"64:lost"*"64:0" ]] || fail "$(calls sizes-3)"
}

runCase
