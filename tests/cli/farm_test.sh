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
    isGolden "plan_index_neighbours_$kind.$extension" --index scan.####.las -o scan.####.sft \
      --shards 3 --frames 1-2 --memory 1G --time 45m --threads 2 --normals estimate "--$kind"
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
  generate scan.las --surfels 3k
  "$surfeit" convert -q scan.las -o scan.ply --keep position
  export TMPDIR=$PWD/scratch
  mkdir scratch
  bash -euxo pipefail -c "$commands" || fail "a command of $docs"
  "$surfeit" gather -q city.sft street.ply -o one.ply --mode bleeding --memory 64M
  for name in lit staged; do sameBytes one.ply "$name.ply"; done
  for frame in 1 2 3; do exists "lit.000$frame.ply"; done
  "$surfeit" index -q crowd.0001.ply crowd.0002.ply -o one.sft --memory 64M
  sameBytes one.sft two.sft
  "$surfeit" index -q scan.ply -o one.sft --normals estimate --memory 80M
  sameBytes one.sft scan.sft
}

runCase
