#!/usr/bin/env bash
# One case of the tests of jobs for farms.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"
source "$(dirname "${BASH_SOURCE[0]}")/farm_steps.sh"
golden=$(dirname "$script")/golden

# isGolden NAME ARGUMENT...: what `surfeit plan` prints is tests/cli/golden/NAME, but for the version.
# SURFEIT_UPDATE_GOLDEN=1 writes that file instead.
isGolden() {
  local name=$1
  shift
  "$surfeit" plan "$@" > printed || fail "surfeit plan $*"
  sed -E 's/\(surfeit [0-9.]+,/(surfeit VERSION,/' printed > "$name"
  if [[ -n ${SURFEIT_UPDATE_GOLDEN:-} ]]; then cp "$name" "$golden/$name"; fi
  diff "$golden/$name" "$name" || fail "surfeit plan $* prints another job"
}

plansAreGolden() {
  local kind extension
  for kind in slurm parallel make openjd; do
    case $kind in make) extension=mk ;; openjd) extension=yaml ;; *) extension=sh ;; esac
    isGolden "plan_$kind.$extension" "it's a \$(scene) {{x}}.sft" 'two  "blanks".ply' \
      -o 'lit [1].ply' --shards 16 --memory 1.5G --time 1:30:00 --threads 8 "--$kind" \
      --mode bleeding --color-range 8 --camera=-1,2,3 --no-prefetch --environment "sky's.exr"
    isGolden "plan_frames_$kind.$extension" city.sft street.####.ply -o lit.####.ply --shards 7 \
      --frames 1-7x3,-2,20 --memory 512M --time 90s --threads 1 "--$kind"
    isGolden "plan_index_$kind.$extension" --index "it's a \$(cloud) {{x}}.ply" 'two  "blanks".ply' \
      --group "lamp=la mp.ply" -o 'city [1].sft' --shards 16 --memory 1G --time 45m --threads 8 \
      --overlap thin --remove-shards "--$kind"
    isGolden "plan_index_frames_$kind.$extension" --index crowd.####.ply -o crowd.####.sft \
      --shards 7 --frames 1-7x3,-2 --memory 512M --time 90s --threads 1 "--$kind"
  done
}

# The forecast of memory and time.
plansFindMemoryAndTime() {
  local memory
  makeFarmScene
  run 0 plan "$scene" "$receivers" -o lit.ply --shards 4 --slurm --threads 1
  says "plan: 300 receivers" "limit of a task 6 min" "minutes=6"
  memory=$(sed -n -E 's/^memory=([0-9]+) # MiB$/\1/p' <<< "$said")
  run 0 gather "$scene" "$receivers" -o lit.ply --memory "${memory}M" --threads 1
  # Both given: no file is read
  run 0 plan none.sft none.ply -o lit.ply --shards 4 --slurm --memory 64M --time 1h
  [[ $said != *plan:* ]] || fail "read files without need"
  run 0 plan none.sft none.ply -o lit.ply --shards 4 --make --memory 64M
  run 74 plan none.sft none.ply -o lit.ply --shards 4 --slurm --memory 64M
  # The first frame of a sequence
  cp "$receivers" r.0003.ply
  run 0 plan "$scene" r.####.ply -o lit.####.ply --shards 4 --slurm --frames 3-5 --threads 1
  says "plan: 300 receivers" "results=(lit.0003.ply lit.0004.ply lit.0005.ply)"
}

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
  run 2 "${plan[@]}" --shards 2 --normals estimate
  says "surfeit normals"
  run 2 "${plan[@]}" --shards 2 --mode bleeding
  run 2 "${plan[@]}" --shards 2 --leaf 0
  run 2 "${plan[@]}" --shards 20000
  run 2 plan a.ply b.ply -o o.sft --shards 2 --slurm --overlap thin
  run 2 plan --index a.##.ply -o o.sft --shards 2 --slurm --frames 1-2 --memory 64M --time 1h
  says "o.sft: with --frames every frame would replace"
  # What follows from neighbours
  printf '%s\n' "1 2 3" "2 3 4" "3 4 5" "5 6 7" > bare.xyz
  run 2 plan --index bare.xyz -o o.sft --shards 2 --slurm
  says "neither radii nor areas"
}

badPlansAreRefused() {
  local plan=(plan a.sft r.ply -o o.ply --memory 64M --time 1h)
  run 2 "${plan[@]}" --slurm
  says "--shards"
  run 2 "${plan[@]}" --shards 0 --slurm
  run 2 "${plan[@]}" --shards 2
  says "found 0 kinds of jobs, expected one of --slurm"
  run 2 "${plan[@]}" --shards 2 --slurm --make
  says "found 2 kinds"
  run 2 "${plan[@]}" --shards 2 --slurm --mode shiny
  run 2 "${plan[@]}" --shards 2 --slurm --frames 1-2
  says "o.ply: with --frames every frame would replace"
  run 2 plan a.sft r.##.ply -o o.##.ply --shards 2 --slurm --memory 64M --time 1h
  says "this is a pattern of frames"
  run 2 plan a.sft r.##.ply -o o.##.ply --shards 1000 --frames 1-2000 --slurm --memory 64M --time 1h
  says "found 2000000 tasks"
  run 2 plan a.sft r.ply -o - --shards 2 --slurm --memory 64M --time 1h
  says "must be a file"
  run 2 plan $'a\nb.sft' r.ply -o o.ply --shards 2 --slurm --memory 64M --time 1h
  says "control characters"
  local time
  for time in 0 -5 1x "" 1:2:3:4 h inf nan 1:; do
    run 2 plan a.sft r.ply -o o.ply --shards 2 --slurm --memory 64M "--time=$time"
    says "--time"
  done
  local -A minutes=([90s]=2 [30m]=30 [2h]=120 [1.5h]=90 [1d]=1440 [45]=45 [1:30]=90 [0:10:30]=11)
  for time in "${!minutes[@]}"; do
    run 0 plan a.sft r.ply -o o.ply --shards 2 --slurm --memory 64M --time "$time"
    says "minutes=${minutes[$time]}"$'\n'
  done
}

# faultsOf RESULT: all that can go wrong, for 7 shards, 64 MiB at first.
makeFaults() {
  : > faults/killed-2
  : > faults/stopped-3
  echo 200 > faults/memory-4
  echo once > faults/files-5
  echo "$1.shard-6-of-7" > faults/removed-6
}

faultsAreOvercome() {
  callsAre 1 "64:0"
  callsAre 2 "64:137 64:0"
  callsAre 3 "64:143 64:0"
  callsAre 4 "64:33 128:33 256:0"
  callsAre 5 "64:74 64:0"
  [[ $(calls 6) == "64:0"*"64:0" ]] || fail "calls of shard 6: $(calls 6)"
}

parallelRunsTheJob() {
  command -v parallel > /dev/null || { echo "skipped: no GNU parallel"; exit 77; }
  makeFarmScene
  makeFarmSurfeit
  mkdir "a dir"
  run 0 plan "$scene" "$receivers" -o "a dir/lit [1].ply" --shards 7 --memory 64M --mode bleeding \
    --threads 1 --parallel
  printf '%s\n' "$said" > "the job's.sh"
  makeFaults "a dir/lit [1].ply"
  JOBS=2 bash "the job's.sh" || fail "exit status $? of the job"
  sameBytes expected.ply "a dir/lit [1].ply"
  # The second round, for the shard that is gone, calls all again
  callsAre 2 "64:137 64:0 64:0"
  [[ $(calls 4) == "64:33 128:33 256:0 "* ]] || fail "calls of shard 4: $(calls 4)"
  callsAre 5 "64:74 64:0 64:0"
  # A shard that cannot be is not tried again, the others are there, and another run goes on
  rm -rf "a dir"/lit* faults/log
  : > faults/data-3
  local status=0
  JOBS=2 bash "the job's.sh" || status=$?
  [[ $status == 75 ]] || fail "exit status $status with a shard that fails"
  callsAre 3 "64:3"
  rm faults/data-3 faults/log
  JOBS=2 bash "the job's.sh" || fail "exit status $? of the second run"
  sameBytes expected.ply "a dir/lit [1].ply"
  callsAre 3 "64:0"
  # Not from a pipe: the job calls its own file
  status=0
  bash < "the job's.sh" 2> said || status=$?
  [[ $status == 2 ]] && grep -q "save the plan to a file" said || fail "from a pipe: $status"
}

makeRunsTheJob() {
  command -v make > /dev/null || { echo "skipped: no make"; exit 77; }
  makeFarmScene
  makeFarmSurfeit
  run 0 plan "$scene" "$receivers" -o "lit \$(1)%.ply" --shards 7 --memory 64M --mode bleeding \
    --threads 1 --make
  printf '%s\n' "$said" > job.mk
  makeFaults "lit \$(1)%.ply"
  local status=0
  make -f job.mk -j 2 > said 2>&1 || status=$?
  # The shard that is removed is missing once
  [[ $status == 2 ]] && grep -q "Error 75" said || fail "status $status: $(cat said)"
  make -f job.mk -j 2
  sameBytes expected.ply "lit \$(1)%.ply"
  faultsAreOvercome_in_place
}

# What runTask does by itself, before the second run calls all tasks again.
faultsAreOvercome_in_place() {
  callsAre 1 "64:0 64:0"
  callsAre 2 "64:137 64:0 64:0"
  callsAre 3 "64:143 64:0 64:0"
  [[ $(calls 4) == "64:33 128:33 256:0 "* ]] || fail "calls of shard 4: $(calls 4)"
  callsAre 5 "64:74 64:0 64:0"
}

# Frames of a sequence, one of which lacks its receivers.
makeRunsSequences() {
  command -v make > /dev/null || { echo "skipped: no make"; exit 77; }
  makeFarmScene
  makeFarmSurfeit
  local frame
  for frame in 1 2 4; do cp "$receivers" "r.000$frame.ply"; done
  run 0 plan "$scene" r.####.ply -o lit.####.ply --shards 3 --frames 1-4 --memory 64M \
    --mode bleeding --threads 1 --make
  printf '%s\n' "$said" > job.mk
  local status=0
  make -k -j 2 -f job.mk > said 2>&1 || status=$?
  [[ $status == 2 ]] || fail "status $status: $(cat said)"
  for frame in 1 2 4; do sameBytes expected.ply "lit.000$frame.ply"; done
  [[ ! -e lit.0003.ply ]] || fail "a result of a frame without receivers"
  # 74 is tried three times
  [[ $(awk '$1 == 2 && $2 == 3 && $4 == 74' faults/log | wc -l) == 3 ]] || fail "$(cat faults/log)"
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

# A scheduler that runs every job when it is submitted: sbatch runs its tasks one after the other.
makeFakeSlurm() {
  mkdir -p bin spool
  cat > bin/scontrol << 'FAKE'
#!/bin/bash
echo "MaxArraySize            = ${MOST_ARRAY:-1001}"
FAKE
  cat > bin/sbatch << 'FAKE'
#!/bin/bash
spool=$(dirname "$0")/../spool
id=$((100 + $(ls "$spool" | wc -l)))
array='' depends=''
while [[ $1 == -* ]]; do
  case $1 in
    --array=*) array=${1#*=} ;;
    --dependency=*) depends=${1#*=} ;;
    --mem=*)
      memory=${1//[!0-9]/}
      ((memory <= ${MOST_MEMORY:-9999999})) || { echo "sbatch: no node has $memory" >&2; exit 1; }
      echo "$id $1" >> "$spool.memory"
      ;;
  esac
  shift
done
cp "$1" "$spool/$id" # as slurmd does
shift
echo "$id;cluster"
[[ -z $depends ]] || echo "$id $depends" >> "$spool.depends"
export SLURM_JOB_ID=$id SLURM_MEM_PER_NODE=1
for index in ${array//,/ }; do
  ((index < ${MOST_ARRAY:-1001})) || exit 1
  SLURM_ARRAY_TASK_ID=$index bash "$spool/$id" "$@" > /dev/null 2>&1 < /dev/null
done
[[ -n $array ]] || bash "$spool/$id" "$@" > /dev/null 2>&1 < /dev/null
exit 0
FAKE
  chmod +x bin/*
  export PATH=$PWD/bin:$PATH
}

slurmRunsTheJob() {
  makeFarmScene
  makeFarmSurfeit
  makeFakeSlurm
  run 0 plan "$scene" "$receivers" -o "lit [1].ply" --shards 7 --memory 64M --mode bleeding \
    --threads 1 --time 5m --slurm
  printf '%s\n' "$said" > job.sh
  makeFaults "lit [1].ply"
  MOST_ARRAY=4 bash job.sh || fail "exit status $? of the job"
  [[ $(cat "lit [1].ply.farm/end") == 0 ]] || fail "ended with $(cat "lit [1].ply.farm/end" "lit [1].ply.farm/merge.log")"
  sameBytes expected.ply "lit [1].ply"
  faultsAreOvercome
  callsAre 6 "64:0 64:0"
  # 3 arrays of at most 3 tasks, and a merge behind them
  grep -qx "103 afterany:100:101:102\|103 afterany:102:101:100\|103 afterany:.*" spool.depends ||
    fail "$(cat spool.depends)"
  grep -qx -e "100 --mem=128M" spool.memory || fail "$(cat spool.memory)"
  grep -q -e "--mem=192M" spool.memory || fail "$(cat spool.memory)"
}

# What is not tried again, and what is given up.
slurmGivesUp() {
  makeFarmScene
  makeFarmSurfeit
  makeFakeSlurm
  run 0 plan "$scene" "$receivers" -o lit.ply --shards 3 --memory 64M --threads 1 --time 5m --slurm
  printf '%s\n' "$said" > job.sh
  : > faults/data-2
  bash job.sh
  [[ $(cat lit.ply.farm/end) == 1 ]] || fail "ended with $(cat lit.ply.farm/end)"
  grep -q "gather 2: exit status 3, not again" lit.ply.farm/merge.log || fail "$(cat lit.ply.farm/merge.log)"
  callsAre 2 "64:3"
  rm faults/* lit.ply*-3-of-3
  echo 1000000 > faults/memory-3
  ROUNDS=3 bash job.sh
  [[ $(cat lit.ply.farm/end) == 75 ]] || fail "ended with $(cat lit.ply.farm/end)"
  callsAre 3 "64:33 128:33 256:33"
  # More memory than a node has
  rm lit.ply.shard-1-of-3 faults/log
  MOST_MEMORY=400 bash job.sh
  [[ $(cat lit.ply.farm/end) == 1 ]] || fail "ended with $(cat lit.ply.farm/end)"
  grep -q "sbatch: no node has 576" lit.ply.farm/merge.log || fail "$(cat lit.ply.farm/merge.log)"
  callsAre 3 "64:33 128:33 256:33"
  callsAre 1 "64:0"
  # Run again, it goes on: shards that are there stay
  rm faults/*
  bash job.sh
  [[ $(cat lit.ply.farm/end) == 0 ]] || fail "ended with $(cat lit.ply.farm/end)"
  exists lit.ply
}

slurmRunsSequences() {
  makeFarmScene
  makeFarmSurfeit
  makeFakeSlurm
  local frame
  for frame in 1 2 4; do cp "$receivers" "r.000$frame.ply"; done
  run 0 plan "$scene" r.####.ply -o lit.####.ply --shards 3 --frames 1,2,4 --memory 64M \
    --mode bleeding --threads 1 --time 5m --slurm
  printf '%s\n' "$said" > job.sh
  echo 100 > faults/memory-2
  bash job.sh
  [[ $(cat lit.####.ply.farm/end) == 0 ]] || fail "ended with $(cat lit.####.ply.farm/end)"
  for frame in 1 2 4; do sameBytes expected.ply "lit.000$frame.ply"; done
  callsAre 2 "64:33 64:33 64:33 128:0 128:0 128:0"
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

# A template of OpenJD is run as the specification says, by a scheduler of a few lines.
openJdRunsTheJob() {
  python3 -c "import yaml" 2> /dev/null || { echo "skipped: no PyYAML"; exit 77; }
  makeFarmScene
  makeFarmSurfeit
  local frame
  for frame in 2 5; do cp "$receivers" "r.000$frame.ply"; done
  run 0 plan "$scene" "$receivers" -o "lit [1].ply" --shards 7 --memory 64M --mode bleeding \
    --threads 1 --time 5m --openjd
  printf '%s\n' "$said" > one.yaml
  makeFaults none
  rm faults/removed-6
  python3 "$(dirname "$script")/run_openjd.py" one.yaml "$PWD" || fail "one.yaml"
  sameBytes expected.ply "lit [1].ply"
  faultsAreOvercome_once
  run 0 plan "$scene" r.####.ply -o lit.####.ply --shards 2 --frames 5,2 --memory 64M \
    --mode bleeding --threads 1 --time 5m --openjd
  printf '%s\n' "$said" > frames.yaml
  python3 "$(dirname "$script")/run_openjd.py" frames.yaml "$PWD" || fail "frames.yaml"
  for frame in 2 5; do sameBytes expected.ply "lit.000$frame.ply"; done
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

faultsAreOvercome_once() {
  callsAre 1 "64:0"
  callsAre 2 "64:137 64:0"
  callsAre 3 "64:143 64:0"
  callsAre 4 "64:33 128:33 256:0"
  callsAre 5 "64:74 64:0"
}

# The command lines of docs/farm.md under <!-- tested -->, in their order, with Slurm's commands faked.
documentedCommandsWork() {
  command -v parallel > /dev/null && command -v make > /dev/null ||
    { echo "skipped: no GNU parallel or no make"; exit 77; }
  local commands frame n docs
  docs=$(dirname "$script")/../../docs/farm.md
  commands=$(awk '/^<!-- tested -->/ { tested = 1 }
                  /^```/ { if (inside) { inside = tested = 0 } else inside = 1; next }
                  inside && tested' "$docs")
  [[ $(grep -c '^surfeit ' <<< "$commands") -ge 10 ]] || fail "found few commands in $docs"
  makeFarmScene
  makeFarmSurfeit
  makeFakeSlurm
  ln -s "$PWD/farm_surfeit" bin/surfeit
  mv "$scene" city.sft
  cp city.sft set.sft
  mv "$receivers" street.ply
  for ((frame = 1; frame <= 24; ++frame)); do
    n=$(printf %04d "$frame")
    generate "crowd.$n.ply" --surfels 200 --seed "$frame"
    cp street.ply "street.$n.ply"
  done
  export TMPDIR=$PWD/scratch
  mkdir scratch
  bash -euxo pipefail -c "$commands" || fail "a command of $docs"
  "$surfeit" gather -q city.sft street.ply -o one.ply --mode bleeding --memory 64M
  for name in lit staged; do sameBytes one.ply "$name.ply"; done
  for frame in 1 2 3; do exists "lit.000$frame.ply"; done
  "$surfeit" index -q crowd.0001.ply crowd.0002.ply -o one.sft --memory 64M
  sameBytes one.sft two.sft
}

runCase
