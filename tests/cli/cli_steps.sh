# What the cases of the end-to-end tests are made of. Sourced by a script that has a function per case
# and ends with runCase; CMakeLists.txt lists the cases.
#
#   SCRIPT CASE SURFEIT CORNELL_SCENE WORK_DIR
set -euo pipefail

case_name=$1
surfeit=$2
cornell_scene=$3
work_dir=$4
# In memory, where the run of all tests says so
[[ -z ${TMPDIR:-} || -n ${SURFEIT_IN_NAMESPACE:-} ]] || work_dir=$TMPDIR/${work_dir##*/}
script=$(realpath "$0")
# Limits and places of the job that runs the tests are none of their business
unset SLURM_TMPDIR TMPDIR SLURM_MEM_PER_NODE SLURM_MEM_PER_CPU SLURM_CPUS_ON_NODE SLURM_CPUS_PER_TASK

# Runs the case in its own directory.
runCase() {
  rm -rf "$work_dir"
  mkdir -p "$work_dir"
  cd "$work_dir"
  "$case_name"
  echo "passed: $case_name"
}

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# run STATUS ARGUMENT...: runs surfeit, which must exit with STATUS; what it said is in `said`.
run() {
  local expected=$1 status=0
  shift
  said=$("$surfeit" "$@" 2>&1) || status=$?
  printf '$ surfeit %s\n%s\n' "$*" "$said"
  [[ $status == "$expected" ]] || fail "exit status $status, expected $expected: surfeit $*"
}

# says TEXT...: every text must stand in what the last run said.
says() {
  local text
  for text in "$@"; do
    [[ $said == *"$text"* ]] || fail "expected \"$text\" in: $said"
  done
}

exists() { [[ -s $1 ]] || fail "$1 is missing or empty"; }

# Neither a file of that name nor a temporary one beside it.
leavesNothing() {
  local left
  left=$(find . -name "$1*" -o -name '*.tmp')
  [[ -z $left ]] || fail "left behind: $left"
}

sameBytes() { cmp "$1" "$2" || fail "$1 and $2 differ"; }

# jsonHas FILE KEY...
jsonHas() {
  local file=$1 key
  shift
  for key in "$@"; do
    grep -q "\"$key\":" "$file" || fail "$file has no \"$key\": $(cat "$file")"
  done
}

# A field of a statistics file that is a number.
field() { sed -n -E "s/^ *\"$2\": ([-+.0-9e]+),?$/\1/p" "$1"; }

# jsonIs FILE [KEY NUMBER]...: every key has that value, as near as a float comes.
jsonIs() {
  local file=$1 found
  shift
  while (($# > 0)); do
    found=$(field "$file" "$1")
    awk -v found="$found" -v expected="$2" \
      'BEGIN { e = found - expected; exit !(found != "" && e * e <= 1e-12 * expected * expected) }' ||
      fail "$file: $1 is \"$found\", expected $2"
    shift 2
  done
}

differentBytes() {
  if cmp -s "$1" "$2"; then fail "$1 and $2 are the same"; fi
}

# A scene of about that many surfels: cornell.obj, cornell.ply and cornell.sft. `cornell_scene` writes
# its meshes.
makeScene() {
  "$cornell_scene" .
  run 0 sample cornell.obj -o cornell.ply --count "$1" --light-samples 2 --quiet
  run 0 index cornell.ply -o cornell.sft --memory 64M --quiet
}

# generate NAME OPTION...: a cloud.
generate() { "$surfeit" generate --quiet -o "$1" "${@:2}"; }

# Whether a process has a file open that has no name (yet), or a temporary one.
resultIsOpen() { ls -l "/proc/$1/fd" 2> /dev/null | grep -q -e '(deleted)' -e '\.tmp$'; }

# stoppedLeavesNothing NAME ARGUMENT...: runs surfeit, which is to write NAME and takes long, and
# stops it by each signal when it has begun.
stoppedLeavesNothing() {
  local name=$1 signal expected process status began i
  shift
  set -m # jobs of their own take SIGINT
  for signal in INT TERM; do
    expected=$([[ $signal == INT ]] && echo 130 || echo 143)
    "$surfeit" "$@" -o "$name" --quiet &
    process=$!
    began=no
    for ((i = 0; i < 1500; ++i)); do
      if resultIsOpen "$process"; then
        began=yes
        break
      fi
      sleep 0.02
    done
    [[ $began == yes ]] || fail "did not begin: surfeit $*; open are $(ls -l "/proc/$process/fd" 2>&1)"
    kill -"$signal" "$process" || fail "ended before SIG$signal: surfeit $*"
    status=0
    wait "$process" || status=$?
    [[ $status == "$expected" ]] || fail "exit status $status after SIG$signal, expected $expected"
    leavesNothing "${name%%.*}"
  done
}
