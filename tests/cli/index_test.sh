#!/usr/bin/env bash
# One case of the indexer's reliability tests, on clouds that spill.
#
# SURFEIT_KILLS: how many runs are killed (default 20). SURFEIT_SANITIZED: set where peak memory
# means nothing. Exit status 77: cannot be tested here.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

spilling=(--memory 72M --threads 2 --quiet)

# staysInBudget STATS MEBIBYTES
staysInBudget() {
  local peak
  peak=$(field "$1" peak_resident_bytes)
  [[ -n ${SURFEIT_SANITIZED:-} ]] || ((peak <= $2 << 20)) || fail "peak memory of $peak bytes"
}

# sameSceneByEveryWay OPTION...: the cloud of these options makes the same scene, however it is made.
sameSceneByEveryWay() {
  local threads memory parts k
  generate cloud.ply "$@"
  run 0 index cloud.ply -o expected.sft --quiet
  for threads in 1 2 5; do
    for memory in 128M 256M 1G; do
      run 0 index cloud.ply -o scene.sft --memory "$memory" --threads "$threads" --quiet
      sameBytes scene.sft expected.sft
    done
  done
  for k in 1 2 3 4 5; do generate "part$k.ply" "$@" --part "$k/5"; done
  for parts in "4 1 5 3 2" "2 5 1 4 3"; do
    # shellcheck disable=SC2046,SC2086 # lists of words
    run 0 index $(printf 'part%s.ply ' $parts) -o scene.sft "${spilling[@]}"
    sameBytes scene.sft expected.sft
  done
}

scenesDoNotDependOnThreadsBudgetOrOrder() {
  local memory
  sameSceneByEveryWay --kind terrain --duplicates 50 --surfels 300k
  sameSceneByEveryWay --kind city --surfels 300k
  generate shuffled.ply --kind city --surfels 300k --order shuffled
  for memory in 72M 1G; do
    run 0 index shuffled.ply -o scene.sft --memory "$memory" --quiet
    sameBytes scene.sft expected.sft
  done
}

hostileCloudsAreIndexedWithinTheBudget() {
  local options expected
  for options in "--outlier 1e5" "--outlier 1e9" "--kind volume" "--duplicates 50" \
    "--duplicates 100"; do
    # shellcheck disable=SC2086 # a list of words
    generate cloud.ply --surfels 2M --order shuffled $options
    run 0 index cloud.ply -o scene.sft "${spilling[@]}" --stats stats.json
    staysInBudget stats.json 72
    (($(field stats.json temporary_bytes) > 0)) || fail "nothing was spilled"
    expected=$([[ $options == --outlier* ]] && echo 2000001 || echo 2000000)
    [[ $(field stats.json surfels) == "$expected" ]] || fail "expected $expected surfels"
    run 0 verify scene.sft
    run 0 index cloud.ply -o again.sft --memory 1G --quiet
    sameBytes scene.sft again.sft
  done
}

# plyOf COUNT: the header of a cloud of bare positions.
plyOf() {
  printf 'ply\nformat binary_little_endian 1.0\nelement vertex %d\n' "$1"
  printf 'property float %s\n' x y z
  printf 'end_header\n'
}

degenerateCloudsAreSoundOrRefused() {
  local count
  for count in 1 300000; do
    { plyOf "$count"; head --bytes=$((12 * count)) /dev/zero; } > equal.ply
    # Without sizes: an octree of full precision comes first
    run 0 index equal.ply -o scene.sft --memory 96M --threads 2 --quiet --stats stats.json
    [[ $(field stats.json surfels) == "$count" ]] || fail "expected $count surfels"
    staysInBudget stats.json 96
    run 0 verify scene.sft
  done
  plyOf 0 > empty.ply
  run 3 index empty.ply -o result.sft
  says "empty.ply: no valid surfel in 0 records"
  generate cloud.ply --surfels 300k
  head --bytes=$(($(stat --format=%s cloud.ply) * 77 / 100)) cloud.ply > cut.ply
  run 3 index cut.ply -o result.sft "${spilling[@]}"
  says cut.ply 300000
  leavesNothing result
}

# Runs the case again where it may mount file systems, which go when it ends.
inMountNamespace() {
  [[ -z ${SURFEIT_IN_NAMESPACE:-} ]] || return 0
  if ! unshare --user --map-root-user --mount true 2> /dev/null; then
    echo "skipped: no file system can be mounted here"
    exit 77
  fi
  SURFEIT_IN_NAMESPACE=1 exec unshare --user --map-root-user --mount \
    bash "$script" "$case_name" "$surfeit" "$cornell_scene" "$work_dir"
}

# withDisk MEBIBYTES COMMAND...: with disk/ a file system of that size, which must end up empty but
# for what is named scene.sft.
withDisk() {
  mkdir -p disk
  if ! mount -t tmpfs -o "size=$1m" none disk; then
    echo "skipped: no tmpfs can be mounted here"
    exit 77
  fi
  "${@:2}"
  [[ -z $(find disk -type f ! -name scene.sft) ]] || fail "left behind: $(ls disk)"
  umount disk
}

# Scene and temporary files on one disk: too small until it is large enough.
indexOnDisk() {
  local status=0
  said=$("$surfeit" index cloud.ply -o disk/scene.sft "${spilling[@]}" 2>&1) || status=$?
  echo "exit status $status: $said"
  case $status in
    0)
      sameBytes disk/scene.sft expected.sft
      ((++successes))
      ;;
    74)
      # What is needed, and what is there
      [[ $said =~ "MiB are free, expected at least" || $said =~ "bytes are available" ]] ||
        fail "no sizes in: $said"
      [[ ! -e disk/scene.sft ]] || fail "a scene in spite of the error"
      ((successes == 0)) || fail "a larger disk did not do"
      ((++failures))
      ;;
    *) fail "exit status $status, expected 0 or 74" ;;
  esac
}

temporaryDiskIsFull() {
  run 74 index cloud.ply -o result.sft --temp disk "${spilling[@]}"
  says disk "--temp"
  leavesNothing result
}

# The file system fills up while the scene is there already, and is freed.
diskIsFreed() {
  cp cloud.ply disk/filler
  run 74 index cloud.ply -o disk/scene.sft "${spilling[@]}"
  rm disk/filler
  run 0 index cloud.ply -o disk/scene.sft "${spilling[@]}"
  sameBytes disk/scene.sft expected.sft
}

fullDisksAreToldAndLeaveNothing() {
  local size successes=0 failures=0
  inMountNamespace
  generate cloud.ply --surfels 300k
  run 0 index cloud.ply -o expected.sft --quiet
  for size in 1 2 4 6 8 10 12 13 14 15 16 17 18 19 20 22 24 28 32 40; do
    withDisk "$size" indexOnDisk
  done
  ((successes > 0 && failures > 5)) || fail "$successes successes and $failures failures"
  for size in 1 8 14 15; do withDisk "$size" temporaryDiskIsFull; done
  withDisk 32 diskIsFreed
}

# Less and less address space: a message and exit status 1, no crash, nothing left.
scarceMemoryIsAnErrorThatLeavesNothing() {
  local mebibytes status successes=0 failures=0
  if [[ -n ${SURFEIT_SANITIZED:-} ]]; then
    echo "skipped: sanitizers take address space"
    exit 77
  fi
  generate cloud.ply --surfels 300k
  for ((mebibytes = 60; mebibytes < 320; mebibytes += 7)); do
    status=0
    said=$(ulimit -c 0 -v $((mebibytes << 10)) &&
      "$surfeit" index cloud.ply -o result.sft "${spilling[@]}" 2>&1) || status=$?
    echo "$mebibytes MiB, exit status $status: $said"
    case $status in
      0) ((++successes)) && rm result.sft ;;
      1) ((++failures)) ;;
      127) ;; # not even the libraries fit
      *) fail "exit status $status, expected 0 or 1" ;;
    esac
    leavesNothing result
  done
  ((successes > 0 && failures > 0)) || fail "$successes successes and $failures failures"
}

# A cloud that spills, the scene it makes (expected.sft), and an older scene (old.sft).
makeScenes() {
  local begin
  generate cloud.ply --surfels 300k
  generate old.ply --surfels 1k
  run 0 index old.ply -o old.sft --quiet
  run 0 index cloud.ply -o expected.sft "${spilling[@]}"
  begin=$(date +%s%N)
  run 0 index cloud.ply -o expected.sft "${spilling[@]}"
  run_us=$((($(date +%s%N) - begin) / 1000))
}

# interrupt SIGNAL: indexes over the old scene and sends the signal at a random moment; the exit
# status is in `status`.
interrupt() {
  local process moment=$(((RANDOM * 32768 + RANDOM) % (run_us * 11 / 10)))
  cp old.sft scene.sft
  "$surfeit" index cloud.ply -o scene.sft "${spilling[@]}" 2> said &
  process=$!
  sleep "$(printf '%d.%06d' $((moment / 1000000)) $((moment % 1000000)))"
  kill -"$1" "$process" 2> /dev/null || true
  status=0
  wait "$process" 2> /dev/null || status=$?
}

# The scene is the old one or the new one, whole; with status 0 the new one.
sceneIsWhole() {
  if ((status == 0)); then
    sameBytes scene.sft expected.sft
  else
    cmp --quiet scene.sft old.sft || sameBytes scene.sft expected.sft
  fi
}

killedRunsLeaveTheOldSceneOrTheNew() {
  local status run_us killed=0 i
  makeScenes
  for ((i = 0; i < ${SURFEIT_KILLS:-20}; ++i)); do
    interrupt KILL
    ((status == 0 || status == 137)) || fail "exit status $status: $(< said)"
    ((status == 0)) || ((++killed))
    sceneIsWhole
    # Whatever was left goes with the next run
    run 0 index cloud.ply -o scene.sft "${spilling[@]}"
    sameBytes scene.sft expected.sft
    [[ -z $(find . -name '*.tmp' -o -name '*density*') ]] || fail "left behind: $(ls)"
  done
  echo "$killed of $i runs were killed"
  ((killed > 0)) || fail "no run was killed"
}

signalledRunsLeaveNothing() {
  local status run_us signal expected stopped=0 i
  makeScenes
  set -m # jobs of their own take SIGINT
  for ((i = 0; i < 10; ++i)); do
    for signal in INT TERM; do
      expected=$([[ $signal == INT ]] && echo 130 || echo 143)
      interrupt "$signal"
      ((status == 0 || status == expected)) || fail "exit status $status after SIG$signal: $(< said)"
      ((status == 0)) || ((++stopped))
      sceneIsWhole
      [[ -z $(find . -name '*.tmp' -o -name '*density*') ]] || fail "left behind: $(ls)"
    done
  done
  echo "$stopped of $((2 * i)) runs were stopped"
  ((stopped > 0)) || fail "no run was stopped"
}

runCase
