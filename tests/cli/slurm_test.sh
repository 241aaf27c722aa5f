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

# submitIndex SHARDS: the passes of an index as arrays behind each other, and the merge; waits for its
# exit status, in `ended`.
submitIndex() {
  local shards=$1 pass job='' index
  index="'$SURFEIT' index set.ply -o out.sft --memory=64M --threads=1"
  local submit=(sbatch --parsable --no-requeue --mem=128M --time=5 --output=/dev/null)
  rm -f end
  for pass in count distribute build; do
    job=$("${submit[@]}" ${job:+"--dependency=afterany:${job%%;*}"} --array="1-$shards" \
      --wrap "$index --pass=$pass --shard=\$SLURM_ARRAY_TASK_ID/$shards") || fail "sbatch: $pass"
  done
  "${submit[@]}" --dependency="afterany:${job%%;*}" \
    --wrap "$index --pass=merge --shards=$shards; echo \$? > end" > /dev/null || fail "sbatch: merge"
  waitUntil 240 test -s end || fail "no end: $(squeue; tail -n 20 "$slurm"/*.log)"
  ended=$(cat end)
}

# An index by arrays. A task that is killed lacks in the merge, and comes again when all is submitted
# again.
indexesGiveTheSameBytes() {
  skipWithoutSlurm
  makeFarmSurfeit
  generate set.ply --surfels 300k
  "$surfeit" index -q set.ply -o one.sft --memory 128M
  startSlurm
  local shards
  : > faults/killed-2
  submitIndex 7
  [[ $ended == 75 ]] || fail "ended with $ended though a task was killed"
  submitIndex 7
  [[ $ended == 0 ]] || fail "ended with $ended"
  sameBytes one.sft out.sft
  for shards in 1 2 ${FARM_SHARDS:-64}; do
    rm -f out.sft
    submitIndex "$shards"
    [[ $ended == 0 ]] || fail "$shards shards ended with $ended"
    sameBytes one.sft out.sft
  done
}

runCase
