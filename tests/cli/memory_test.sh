#!/usr/bin/env bash
# One case of the tests of memory: --memory is the limit of the process, for every command.
#
# SURFEIT_SANITIZED: set where peak memory means nothing. Exit status 77: cannot be tested here.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# Every command that takes --memory, with what the case's directory holds.
commands=(
  "index cloud.ply -o out.sft"
  "index bare.ply -o out.sft"
  "index cloud.ply cloud.ply -o out.sft --overlap thin"
  "index points.ply -o out.sft --normals estimate"
  "normals points.ply -o out.ply"
  "normals points.ply -o out.ply --orient consistent"
  "verify scene.sft"
  "gather scene.sft receivers.ply -o out.ply --quality draft"
  "gather scene.sft receivers.ply -o out.ply --quality draft --mode bleeding --order input"
  "gather scene.sft receivers.ply -o out.ply --quality draft --max-variation 0.02"
  "gather scene.sft receivers.ply -o out.ply --quality draft --mode glossy --camera 0.5,0.5,2"
  "gather scene.sft receivers.ply -o out.vdb --quality draft"
  "gather scene.sft receivers.ply -o out.ply --quality draft --stage ."
  "tune scene.sft receivers.ply --quality draft"
  "relight scene.sft -o out.sft --light-directional 0,-1,0,1,1,1"
  "bounce scene.sft -o out.sft --bounces 2 --surfels-per-receiver 64 --spare-last"
  "radiance photons.ply -o out.ply"
  "brick cloud.ply --channel radiosity -o out.vdb"
  "lookup cloud.ply receivers.ply -o out.ply --channel radiosity"
  "lookup map.vdb bare.ply -o out.ply"
  "view cloud.ply -o out.png --size 400x300"
  "cube scene.sft --at 0.5,0.1,0.5 --normal 0,1,0 -o out.png"
  "convert cloud.ply -o out.vdb"
  "convert cloud.ply -o out.las"
  "convert cloud.ply cloud.ply -o out.ply --spacing 0.001"
  "convert cloud.ply -o out.vdb --spacing 0.01"
  "merge scene.sft receivers.ply -o shards.ply"
  "composite passes.exr light.exr -o out.png --channel lit"
  "index points.ply -o pass.sft --normals estimate --pass sizes --shard 2/2"
  "index points.ply -o sided.sft --normals estimate --orient consistent --pass merge --shards 2"
  "plan scene.sft receivers.ply -o out.ply --quality draft --shards 2 --slurm"
  "sample cornell.obj -o out.ply --count 100000 --two-sided"
  "sample cornell.obj -o out.las --spacing 0.01"
  "sample cornell.obj -o out.ply --photons 100000"
  "generate -o out.ply --surfels 200k"
  "generate -o out.vdb --surfels 50k"
  "relight scene.sft -o out.sft --mesh cornell.obj --light-directional 0,-1,0,1,1,1 --add"
  "cube scene.sft --at 0.5,0.1,0.5 --normal 0,1,0 -o out.png --reference cornell.obj --rays 2"
  "gather scene.sft passes.exr -o out.exr --quality draft --mode bleeding"
  "gather scene.sft receivers.ply -o out.ply --quality draft --resume"
  "gather scene.sft receivers.ply -o out.ply --quality draft --environment light.exr"
  "view scene.sft --size 400x300 --passes out.exr"
  "view cloud.ply --brick map.vdb -o out.png --size 200x150"
  "convert scene.sft -o out.prt"
  "convert cloud.ply -o out.csv.gz"
  "index scene.sft -o out.sft"
  "ptfilter dim.ply -o out.ply --filter occlusion"
  "ptfilter bright.ply -o out.ply --filter colorbleeding --bounces 2"
  "ptfilter photons.ply -o out.ply --filter photonmap --nphotons 20"
  "brickmake brick.ply -o out.vdb --maxerror 0.01"
)
# Those that forecast take no more than what they forecast.
for forecast in "index cloud.ply -o out.sft" "normals points.ply -o out.ply" \
  "gather scene.sft receivers.ply -o out.ply --quality draft" "radiance photons.ply -o out.ply" \
  "bounce scene.sft -o out.sft --quality draft" "brick cloud.ply --channel radiosity -o out.vdb" \
  "relight scene.sft -o out.sft --mesh cornell.obj --light-directional 0,-1,0,1,1,1" \
  "lookup cloud.ply receivers.ply -o out.ply --channel radiosity" "convert cloud.ply -o out.vdb" \
  "sample cornell.obj -o out.ply --count 100000" "sample cornell.obj -o out.ply --photons 100000"; do
  commands+=("$forecast --dry-run")
done

skipWhereSanitized() {
  [[ -z ${SURFEIT_SANITIZED:-} ]] || { echo "skipped: sanitizers take memory"; exit 77; }
}

makeInputs() {
  skipWhereSanitized
  makeScene 200000
  mv cornell.ply cloud.ply
  mv cornell.sft scene.sft
  run 0 convert cloud.ply -o bare.ply --keep position,normal --quiet
  run 0 convert cloud.ply -o points.ply --keep position --quiet
  run 0 convert cloud.ply -o receivers.ply --every 100 --quiet
  run 0 sample cornell.obj -o photons.ply --photons 50000 --quiet
  run 0 brick cloud.ply --channel radiosity -o map.vdb --quiet
  run 0 convert cloud.ply -o bright.ply --every 50 --quiet
  run 0 convert cloud.ply -o dim.ply --every 8 --quiet # the receivers, too: all would take most of the time
  run 0 convert cloud.ply -o brick.ply --keep position,normal,area,radiosity --quiet
  local shard pass
  for pass in count distribute build places sizes; do
    for shard in 1/2 2/2; do
      run 0 index points.ply -o sided.sft --normals estimate --orient consistent --pass "$pass" \
        --shard $shard --quiet
      [[ $pass == sizes ]] || run 0 index points.ply -o pass.sft --normals estimate --pass "$pass" \
        --shard $shard --quiet
    done
  done
  for shard in 1/2 2/2; do
    run 0 gather scene.sft receivers.ply -o shards.ply --quality draft --shard $shard --quiet
  done
  run 0 view scene.sft --size 200x100 --passes passes.exr --quiet
  run 0 gather scene.sft passes.exr -o light.exr --quality draft --mode bleeding --quiet
}

# peakIsAtMost MEBIBYTES COMMAND: by the statistics that it has written.
peakIsAtMost() {
  local peak
  peak=$(field stats.json peak_resident_bytes)
  echo "peak of $((peak >> 10)) KiB of $1 MiB: $2"
  ((peak <= $1 << 20)) || fail "peak of $peak bytes with $1 MiB: $2"
}

# withPeak PROGRAM ARGUMENT...: writes the one statistic that counts here. Of plan and info, which have
# none.
withPeak() {
  python3 -c '
import resource, subprocess, sys
status = subprocess.run(sys.argv[1:]).returncode
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10
open("stats.json", "w").write("\"peak_resident_bytes\": %d\n" % peak)
sys.exit(status)' "$@"
}

# runWithin MEBIBYTES COMMAND OPTION...: succeeds below that, or says what would do.
runWithin() {
  local command=$2 status=0 start=("$surfeit") stats=(--stats stats.json)
  [[ $command != plan* && $command != info* ]] || start=(withPeak "$surfeit") stats=()
  rm -f out.* pass.sft.sized-* stats.json
  # shellcheck disable=SC2086 # a list of words
  said=$("${start[@]}" $command "${stats[@]}" --progress none "${@:3}" 2>&1) || status=$?
  case $status in
    0) peakIsAtMost "$1" "$command ${*:3}" ;;
    33) least=$(sed -n -E 's/.*[: ]([0-9.]+) MiB (is the least that works|would do).*/\1/p' <<< "$said") ;;
    *) fail "exit status $status, expected 0 or 33: $command ${*:3}: $said" ;;
  esac
  [[ $status == 0 || -n $least ]] || fail "no least budget in: $said"
  ((status == 0))
}

peaksStayBelowTheBudget() {
  local command limit threads options successes=0
  makeInputs
  for command in "${commands[@]}"; do
    # With 32 MiB and most of 80 not all that would help fits
    for limit in "32 1" "80 2" "128 8"; do
      read -r limit threads <<< "$limit"
      options=(--memory "${limit}M" --threads "$threads")
      [[ $command != convert* && $command != composite* ]] || options=(--memory "${limit}M")
      if runWithin "$limit" "$command" "${options[@]}"; then
        ((++successes))
      else
        echo "$least MiB would do: $command ${options[*]}"
      fi
    done
  done
  ((successes >= 2 * ${#commands[@]} - 2)) || fail "only $successes runs"
}

budgetsThatAreNamedDo() {
  local command least rounded step
  makeInputs
  for command in "${commands[@]}"; do
    runWithin 0 "$command" --memory 3M && fail "3 MiB are enough: $command"
    # Named first: what there must be before cube knows its picture, and convert its rows
    for step in 1 2; do
      rounded=$(awk -v least="$least" 'BEGIN { print int(least) + (least > int(least)) }')
      ! runWithin "$rounded" "$command" --memory "${rounded}M" || break
      [[ $step == 1 && $command == c* ]] || fail "$rounded MiB do not do: $said"
    done
  done
}

# Of a cloud of many times its budget, also where buckets are small and many: what is kept for the
# next one must not grow to the largest, nor what planning needed stay.
largeIndexesStayBelowTheBudget() {
  local limit threads
  skipWhereSanitized
  run 0 generate -o city.ply --surfels 4M --quiet
  for limit in "68 2" "74 2"; do
    read -r limit threads <<< "$limit"
    runWithin "$limit" "index city.ply -o out.sft" --memory "${limit}M" --threads "$threads" ||
      fail "$limit MiB do not do"
  done
}

# 79,202 triangles, as text and as PLY.
makeMeshes() {
  skipWhereSanitized
  awk 'BEGIN {
    n = 200
    for (j = 0; j < n; ++j) for (i = 0; i < n; ++i) print "v", i, sin(i / 7) * cos(j / 5), j
    for (j = 0; j + 1 < n; ++j) for (i = 1; i < n; ++i) {
      a = j * n + i
      print "f", a, a + 1, a + n + 1, a + n
    }
  }' > grid.obj
  awk '/^v/ { vertices[++v] = $2 " " $3 " " $4 } /^f/ { faces[++f] = "4 " $2 - 1 " " $3 - 1 " " $4 - 1 " " $5 - 1 }
    END {
      print "ply\nformat ascii 1.0\nelement vertex " v "\nproperty float x\nproperty float y\nproperty float z"
      print "element face " f "\nproperty list uchar int vertex_indices\nend_header"
      for (i = 1; i <= v; ++i) print vertices[i]
      for (i = 1; i <= f; ++i) print faces[i]
    }' grid.obj > grid.ply
}

meshesAreHeldWithinTheBudget() {
  local mesh limit command successes
  makeMeshes
  for mesh in grid.obj grid.ply; do
    for command in "sample $mesh -o out.ply --count 5000 --threads 1" \
      "sample $mesh -o out.ply --photons 5000 --threads 1 --light-point 100,-50,100,1,1,1"; do
      successes=0
      for limit in 12 16 24 32 48 64 96; do
        if runWithin "$limit" "$command" --memory "${limit}M"; then
          ((++successes))
        else
          [[ $successes == 0 ]] || fail "$limit MiB do not do, but less does: $command"
          runWithin "$(awk -v least="$least" 'BEGIN { print int(least) + 1 }')" "$command" --memory "$least"M ||
            fail "$least MiB do not do: $command: $said"
        fi
      done
      ((successes >= 1)) || fail "96 MiB do not do: $command"
    done
  done
  for limit in 16 32 64 128; do
    runWithin "$limit" "generate -o out.vdb --surfels 300k --threads 1" --memory "${limit}M" ||
      echo "$least MiB would do"
    runWithin "$limit" "generate -o out.ply --surfels 300k --threads 1" --memory "${limit}M" ||
      echo "$least MiB would do"
  done
  SLURM_MEM_PER_NODE=24 run 33 sample grid.obj -o out.ply --count 5000
  says "MiB would do"
}

jobsLimitEveryCommand() {
  local command
  makeInputs
  export SLURM_MEM_PER_CPU=64 SLURM_CPUS_ON_NODE=2
  for command in "${commands[@]}"; do
    runWithin 96 "$command" || echo "$least MiB would do: $command"
  done
  # What has no budget
  for command in "info cloud.ply" "info points.ply --json" "info photons.ply" "info scene.sft" \
    "info passes.exr" "info map.vdb"; do
    runWithin 64 "$command" || fail "refused: $command"
  done
  # Nothing that can be asked for is without a test
  for command in $("$surfeit" --help | sed -n '/^Subcommands:/,$s/^  \([a-z]\+\) .*/\1/p'); do
    [[ " info ${commands[*]%% *} " == *" $command "* ]] || fail "no test of the memory of $command"
  done
  run 33 gather scene.sft receivers.ply -o out.ply --memory 5%
  says "a memory budget of 6.4 MiB"
  run 2 gather scene.sft receivers.ply -o out.ply --memory 101%
}

# Really limited to 128 MiB: the system ends what takes more.
cgroupsLimitEveryCommand() {
  local command group=/sys/fs/cgroup/surfeit-test-$$ limit=memory.max
  if [[ $(stat --file-system --format=%T /sys/fs/cgroup) != cgroup2fs ]]; then
    group=/sys/fs/cgroup/memory/surfeit-test-$$ limit=memory.limit_in_bytes # version 1
  fi
  makeInputs
  if ! mkdir "$group" 2> /dev/null || ! (echo 128M > "$group/$limit") 2> /dev/null; then
    rmdir "$group" 2> /dev/null || true
    echo "skipped: no cgroup can be made here"
    exit 77
  fi
  for command in "${commands[@]}"; do
    # Of 3/4 of the limit, which is the default
    (echo "$BASHPID" > "$group/cgroup.procs" && (runWithin 96 "$command" || [[ -n $least ]])) ||
      { rmdir "$group"; fail "in a cgroup of 128 MiB: $command"; }
  done
  rmdir "$group"
}

temporaryFilesGoWhereTheJobWants() {
  skipWhereSanitized
  generate cloud.ply --surfels 300k
  mkdir job given
  SLURM_TMPDIR=nowhere run 74 index cloud.ply -o out.sft --memory 64M
  says nowhere
  TMPDIR=nowhere SLURM_TMPDIR=job run 0 index cloud.ply -o out.sft --memory 64M --stats stats.json
  (($(field stats.json temporary_bytes) > 0)) || fail "nothing was spilled"
  SLURM_TMPDIR=nowhere run 0 index cloud.ply -o out.sft --memory 64M --temp given
  [[ -z $(find job given -type f) ]] || fail "left behind: $(find job given)"
}

runCase
