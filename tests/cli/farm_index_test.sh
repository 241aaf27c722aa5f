#!/usr/bin/env bash
# One case of the tests of jobs for farms that index. Their golden scripts are cases of farm_test.sh.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"
source "$(dirname "${BASH_SOURCE[0]}")/farm_steps.sh"

# The forecast of an index, and that its memory is enough.
indexPlansFindMemoryAndTime() {
  local memory pass shard
  makeFarmCloud
  run 0 plan --index "$cloud" --group lamp=lamp.ply -o out.sft --shards 3 --slurm --threads 1
  says "plan: 151,000 surfels" "limits 6 and 6 min" "minutes=6" "merge_minutes=6" "files: "
  memory=$(sed -n -E 's/^memory=([0-9]+) # MiB$/\1/p' <<< "$said")
  ((memory >= 64 && memory < 200)) || fail "memory of a task: $memory MiB"
  for pass in count distribute build; do
    for shard in 1 2 3; do
      run 0 index "$cloud" --group lamp=lamp.ply -o out.sft --memory "${memory}M" --threads 1 \
        --pass "$pass" --shard "$shard/3"
    done
  done
  run 0 index "$cloud" --group lamp=lamp.ply -o out.sft --memory "${memory}M" --pass merge --shards 3
  sameBytes one.sft out.sft
  # More shards, less time and memory of each; both given, no file is read
  run 0 plan --index none.ply -o out.sft --shards 3 --openjd --memory 64M --time 1h
  [[ $said != *plan:* ]] || fail "read files without need"
  run 74 plan --index none.ply -o out.sft --shards 3 --slurm --memory 64M
  # The first frame of a sequence
  cp lamp.ply crowd.0003.ply
  run 0 plan --index crowd.####.ply -o crowd.####.sft --shards 2 --slurm --frames 3-5 --threads 1
  says "plan: 1,000 surfels" "results=(crowd.0003.sft crowd.0004.sft crowd.0005.sft)"
}

badIndexPlansAreRefused() {
  local plan=(plan --index a.ply -o o.sft --memory 64M --time 1h --slurm)
  run 2 "${plan[@]}"
  says "--shards"
  run 2 "${plan[@]}" --shards 2 --make
  says "found 2 kinds"
  run 2 plan --index -o o.sft --shards 2 --slurm --memory 64M --time 1h
  says "no input cloud"
  run 2 "${plan[@]}" --shards 2 --mode bleeding
  run 2 "${plan[@]}" --shards 2 --leaf 0
  run 2 "${plan[@]}" --shards 20000
  run 2 plan a.ply b.ply -o o.sft --shards 2 --slurm --overlap thin
  run 2 plan --index a.##.ply -o o.sft --shards 2 --slurm --frames 1-2 --memory 64M --time 1h
  says "o.sft: with --frames every frame would replace"
}

# Whether the job has the passes for neighbours: by channels, options, and what is asked for.
plansSeeWhoNeedsNeighbours() {
  local plan=(-o o.sft --shards 2 --memory 64M --time 1h --slurm) five="count distribute build places sizes"
  printf '%s\n' "1 2 3" "2 3 4" "3 4 5" "5 6 7" > bare.xyz
  generate set.ply --surfels 1k
  run 0 plan --index bare.xyz "${plan[@]}"
  says "passes=($five)" "files=(count ranges slabs places sized)" "5 passes of 2 tasks"
  run 0 plan --index set.ply "${plan[@]}"
  says "passes=(count distribute build)" "files=(count ranges slabs)"
  run 0 plan --index set.ply --group lamp=bare.xyz "${plan[@]}"
  says "passes=($five)"
  run 0 plan --index set.ply --normals estimate "${plan[@]}"
  says "passes=($five)" "--normals=estimate"
  run 0 plan --index set.ply --neighbours "${plan[@]}"
  says "passes=($five)" "options=()"
  run 0 plan --index none.ply "${plan[@]}"
  says "none.ply" "planned as if every surfel had a size (--neighbours)" "passes=(count distribute build)"
  run 0 plan --index none.ply --neighbours "${plan[@]}"
  says "passes=($five)"
  [[ $said != *planned* ]] || fail "$said"
  # By a sample, and of the first frame
  run 0 plan --index bare.xyz -o o.sft --shards 2 --slurm
  says "passes=($five)"
  cp bare.xyz c.3.xyz
  run 0 plan --index c.%d.xyz -o o.%d.sft --shards 2 --memory 64M --make --frames 3-4
  says "passes=($five)" "places-1" "places-3"
}

# Faults of the passes for neighbours, beside those below.
makeNeighbourFaults() {
  echo 100 > faults/memory-places-1
  : > faults/killed-sizes-2
  echo once > faults/files-sizes-3
}

neighbourFaultsAreOvercome() {
  callsAre places-1 "64:33 128:0"
  callsAre places-2 ""
  callsAre sizes-2 "64:137 64:0"
  callsAre sizes-3 "64:74 64:0"
}

parallelFindsSizes() {
  command -v parallel > /dev/null || { echo "skipped: no GNU parallel"; exit 77; }
  makeBareFarmCloud
  makeFarmSurfeit
  planIndex parallel 3 "out [1].sft" --normals estimate
  printf '%s\n' "$said" > job.sh
  makeNeighbourFaults
  JOBS=2 bash job.sh || fail "exit status $? of the job"
  sameBytes one.sft "out [1].sft"
  neighbourFaultsAreOvercome
  # The places are gone when the merge looks
  rm -f faults/log "out [1].sft" "out [1].sft.sized-1-of-3"
  echo "out [1].sft.sized-2-of-3" > faults/removed-sizes-2
  rm -f "out [1].sft.places"
  rm -f "out [1].sft.farm"/joblog-*
  JOBS=2 bash job.sh || fail "exit status $? of the second run"
  sameBytes one.sft "out [1].sft"
}

makeFindsSizes() {
  command -v make > /dev/null || { echo "skipped: no make"; exit 77; }
  makeBareFarmCloud
  makeFarmSurfeit
  planIndex make 3 "out [1].sft" --normals estimate --remove-shards
  printf '%s\n' "$said" > job.mk
  makeNeighbourFaults
  make -f job.mk -j 2
  sameBytes one.sft "out [1].sft"
  neighbourFaultsAreOvercome
  leavesNothing "out [1].sft." || fail "left behind: $(ls)"
  # Frames
  rm faults/log
  local frame
  for frame in 1 2; do
    generate set.ply --surfels 20k --seed "$frame"
    "$surfeit" convert -q set.ply -o "c.$frame.ply" --keep albedo
    "$surfeit" index -q "c.$frame.ply" -o "one.$frame.sft" --memory 64M
  done
  run 0 plan --index c.%d.ply -o f.%d.sft --shards 2 --frames 1-2 --memory 64M --threads 1 --make
  printf '%s\n' "$said" > job.mk
  make -j 2 -f job.mk
  for frame in 1 2; do sameBytes "one.$frame.sft" "f.$frame.sft"; done
}

slurmFindsSizes() {
  makeBareFarmCloud
  makeFarmSurfeit
  makeFakeSlurm
  planIndex slurm 3 "out [1].sft" --time 5m --normals estimate
  printf '%s\n' "$said" > job.sh
  makeNeighbourFaults
  echo "out [1].sft.sized-1-of-3" > faults/removed-sizes-1
  bash job.sh || fail "exit status $? of the job"
  [[ $(cat "out [1].sft.farm/end") == 0 ]] || fail "ended with $(cat "out [1].sft.farm/end" "out [1].sft.farm/merge.log")"
  sameBytes one.sft "out [1].sft"
  # A round of places, one of sizes, and one of the shard that is gone
  callsAre places-1 "64:33 128:0"
  callsAre places-2 ""
  callsAre count-1 "64:0"
  callsAre build-2 "64:0"
  [[ $(calls sizes-2) == "64:137 "*"64:0" ]] || fail "$(calls sizes-2)"
  # The scene of places is gone, although the pass was done: it looks again
  rm -f faults/log "out [1].sft" "out [1].sft.places" "out [1].sft.sized-2-of-3"
  bash job.sh
  [[ $(cat "out [1].sft.farm/end") == 0 ]] || fail "ended with $(cat "out [1].sft.farm/end" "out [1].sft.farm/merge.log")"
  sameBytes one.sft "out [1].sft"
}

openJdFindsSizes() {
  python3 -c "import yaml" 2> /dev/null || { echo "skipped: no PyYAML"; exit 77; }
  makeBareFarmCloud
  makeFarmSurfeit
  planIndex openjd 3 "out [1].sft" --time 5m --normals estimate
  printf '%s\n' "$said" > one.yaml
  makeNeighbourFaults
  python3 "$(dirname "$script")/run_openjd.py" one.yaml "$PWD" || fail "one.yaml"
  sameBytes one.sft "out [1].sft"
  neighbourFaultsAreOvercome
}

# What can go wrong in the passes of an index in 3 shards, 64 MiB at first.
makeIndexFaults() {
  : > faults/killed-count-2
  : > faults/stopped-distribute-3
  echo 100 > faults/memory-build-1
  echo once > faults/files-build-2
}

indexFaultsAreOvercome() {
  callsAre count-1 "${1:-64:0}"
  callsAre count-2 "64:137 64:0"
  callsAre distribute-3 "64:143 64:0"
  callsAre build-1 "64:33 128:0"
  callsAre build-2 "64:74 64:0"
}

# The same with a shard that is gone when the merge looks: all is called again.
parallelRunsTheIndex() {
  command -v parallel > /dev/null || { echo "skipped: no GNU parallel"; exit 77; }
  makeFarmCloud
  makeFarmSurfeit
  planIndex parallel 3 "out [1].sft"
  printf '%s\n' "$said" > job.sh
  makeIndexFaults
  JOBS=2 bash job.sh || fail "exit status $? of the job"
  sameBytes one.sft "out [1].sft"
  indexFaultsAreOvercome
  rm -rf out*
  rm faults/log
  echo "out [1].sft.slabs-2-of-3" > faults/removed-build-2
  JOBS=2 bash job.sh || fail "exit status $? with a shard that is gone"
  sameBytes one.sft "out [1].sft"
  callsAre build-2 "64:0 64:0"
  # A shard that cannot be ends the job; what is behind it waits, and is not called thrice
  rm -rf out*
  rm faults/log
  : > faults/data-distribute-3
  local status=0
  JOBS=2 bash job.sh || status=$?
  [[ $status == 75 ]] || fail "exit status $status with a shard that fails"
  callsAre distribute-3 "64:3"
  rm faults/data-distribute-3
  JOBS=2 bash job.sh || fail "exit status $? of the second run"
  sameBytes one.sft "out [1].sft"
}

makeRunsTheIndex() {
  command -v make > /dev/null || { echo "skipped: no make"; exit 77; }
  makeFarmCloud
  makeFarmSurfeit
  planIndex make 3 "out \$(1)%.sft" --remove-shards
  printf '%s\n' "$said" > job.mk
  makeIndexFaults
  make -f job.mk -j 2
  sameBytes one.sft "out \$(1)%.sft"
  indexFaultsAreOvercome
  [[ -z $(find . -name 'out*-of-3') ]] || fail "shards stay: $(ls)"
  # One task by itself; what waits for a pass that fails is not called
  rm faults/log
  make -f job.mk count-3
  callsAre count-3 "64:0"
  : > faults/data-distribute-1
  local status=0
  make -k -f job.mk -j 2 || status=$?
  [[ $status == 2 ]] || fail "exit status $status with a shard that fails"
  callsAre distribute-1 "64:3"
  callsAre build-2 ""
}

# Frames of a sequence, one of which lacks its cloud.
makeRunsSequencesOfIndexes() {
  command -v make > /dev/null || { echo "skipped: no make"; exit 77; }
  makeFarmSurfeit
  local frame
  for frame in 1 3; do
    generate "c.$frame.ply" --surfels 20k --seed "$frame"
    "$surfeit" index -q "c.$frame.ply" -o "one.$frame.sft" --memory 64M
  done
  run 0 plan --index c.%d.ply -o out.%d.sft --shards 2 --frames 1-3 --memory 64M --threads 1 --make
  printf '%s\n' "$said" > job.mk
  local status=0
  make -k -j 2 -f job.mk > said 2>&1 || status=$?
  [[ $status == 2 ]] || fail "status $status: $(cat said)"
  for frame in 1 3; do sameBytes "one.$frame.sft" "out.$frame.sft"; done
  [[ ! -e out.2.sft ]] || fail "a scene of a frame without a cloud"
}

# Every fault costs a round of what is missing, with all passes behind it.
slurmRunsTheIndex() {
  local pass
  makeFarmCloud
  makeFarmSurfeit
  makeFakeSlurm
  planIndex slurm 3 "out [1].sft" --time 5m
  printf '%s\n' "$said" > job.sh
  makeIndexFaults
  echo "out [1].sft.slabs-3-of-3" > faults/removed-build-3
  bash job.sh || fail "exit status $? of the job"
  [[ $(cat "out [1].sft.farm/end") == 0 ]] || fail "ended with $(cat "out [1].sft.farm/end" "out [1].sft.farm/merge.log")"
  sameBytes one.sft "out [1].sft"
  # The others of a pass that was not complete wait, with 75
  # Whoever distributes a part counts it where nobody has. So no count is missing in the second round,
  # although a task has waited for one, and all counts look
  indexFaultsAreOvercome "64:0 64:0"
  callsAre distribute-1 "64:75 64:0"
  callsAre build-3 "64:75 64:0 64:0"
  # The arrays wait for the one before, and the merge for the last
  grep -qx "101 afterany:100" spool.depends || fail "$(cat spool.depends)"
  grep -qx "102 afterany:101" spool.depends || fail "$(cat spool.depends)"
  grep -qx "103 afterany:102" spool.depends || fail "$(cat spool.depends)"
  # Shards of another job: all look, and make them again
  run 0 index lamp.ply -o other.sft --memory 64M
  rm -f faults/log "out [1].sft"
  for pass in count ranges slabs; do cp other.sft "out [1].sft.$pass-2-of-3"; done
  bash job.sh
  [[ $(cat "out [1].sft.farm/end") == 0 ]] || fail "ended with $(cat "out [1].sft.farm/end" "out [1].sft.farm/merge.log")"
  sameBytes one.sft "out [1].sft"
}

slurmGivesUpAnIndex() {
  makeFarmCloud
  makeFarmSurfeit
  makeFakeSlurm
  planIndex slurm 3 out.sft --time 5m
  printf '%s\n' "$said" > job.sh
  : > faults/data-distribute-2
  bash job.sh
  [[ $(cat out.sft.farm/end) == 1 ]] || fail "ended with $(cat out.sft.farm/end)"
  grep -q "distribute 2: exit status 3, not again" out.sft.farm/merge.log ||
    fail "$(cat out.sft.farm/merge.log)"
  callsAre distribute-2 "64:3"
  callsAre build-1 "64:75"
  # Run again, it goes on
  rm faults/*
  bash job.sh
  [[ $(cat out.sft.farm/end) == 0 ]] || fail "ended with $(cat out.sft.farm/end)"
  sameBytes one.sft out.sft
}

openJdRunsTheIndex() {
  python3 -c "import yaml" 2> /dev/null || { echo "skipped: no PyYAML"; exit 77; }
  makeFarmCloud
  makeFarmSurfeit
  planIndex openjd 3 "out [1].sft" --time 5m
  printf '%s\n' "$said" > one.yaml
  makeIndexFaults
  python3 "$(dirname "$script")/run_openjd.py" one.yaml "$PWD" || fail "one.yaml"
  sameBytes one.sft "out [1].sft"
  indexFaultsAreOvercome
}

runCase
