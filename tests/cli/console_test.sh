#!/usr/bin/env bash
# One case of the end-to-end tests of standard output and error: what cannot be said stops no job.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"
odd_streams=$(dirname "$surfeit")/../tests/cli/odd_streams

# silent STATUS ARGUMENT...: surfeit must exit with STATUS for every standard error that takes nothing.
silent() {
  local expected=$1 status kind
  shift
  for kind in device closed full broken hungup; do
    rm -f result.ply result.sft
    status=0
    case $kind in
      device) "$surfeit" "$@" 2> /dev/full || status=$? ;;
      closed) "$surfeit" "$@" 2>&- || status=$? ;;
      *) "$odd_streams" "$kind" 2 "$surfeit" "$@" || status=$? ;;
    esac
    [[ $status == "$expected" ]] || fail "status $status with standard error $kind: surfeit $*"
    [[ $expected != 0 || ! -e first.ply ]] || sameBytes result.ply first.ply
  done
}

silentStandardErrorStopsNoJob() {
  generate city.ply --surfels 5k
  "$surfeit" index -q city.ply -o city.sft
  run 0 gather city.sft city.ply -o first.ply --quality draft
  local style
  for style in percent json bar; do
    silent 0 gather city.sft city.ply -o result.ply --quality draft --progress "$style" --verbose
  done
}

silentStandardErrorKeepsTheStatus() {
  generate city.ply --surfels 3k
  "$surfeit" index -q city.ply -o city.sft
  silent 74 gather missing.sft city.ply -o result.ply
  silent 2 gather city.sft city.ply -o city.sft
  silent 2 gather --no-such-option
  silent 33 gather city.sft city.ply -o result.ply --memory 1M
  head -c 2000 city.sft > cut.sft
  silent 3 verify cut.sft
}

answersThatCannotBeWrittenAreErrors() {
  generate city.ply --surfels 3k
  "$surfeit" index -q city.ply -o city.sft
  local command status
  for command in "info city.sft" "info city.sft --json" "info city.ply" "verify city.sft" "--help" \
    "gather --help" "--version" "tune city.sft city.ply --json" \
    "gather city.sft city.ply -o none.ply --dry-run" "index city.ply -o none.sft --dry-run"; do
    for kind in device closed broken hungup; do
      status=0
      # shellcheck disable=SC2086
      case $kind in
        device) said=$("$surfeit" $command 2>&1 > /dev/full) || status=$? ;;
        closed) said=$("$surfeit" $command 2>&1 >&-) || status=$? ;;
        *) said=$("$odd_streams" "$kind" 1 "$surfeit" $command 2>&1 > /dev/null) || status=$? ;;
      esac
      [[ $status == 74 ]] || fail "status $status with standard output $kind: surfeit $command"
      says "standard output"
    done
  done
}

closedStreamsTakeNoFile() {
  generate city.ply --surfels 3k
  "$surfeit" index -q city.ply -o first.sft
  "$surfeit" index city.ply -o result.sft --progress json 0>&- 1>&- 2>&-
  sameBytes result.sft first.sft
  run 0 verify result.sft
  local status=0
  "$surfeit" convert city.ply -o - 1>&- || status=$?
  [[ $status == 74 ]] || fail "status $status for a result to a closed standard output"
}

escapesOfFilesArePrintedAsText() {
  local escape=$'\x1b]0;title\x07\x1b[2J\xc2\x9b2J\xff'
  printf 'ply\nformat ascii 1.0\ncomment %s\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n' \
    "$escape" > odd.ply
  printf '# x y z %s\n0 0 0 1\n1 0 0 1\n' "$escape" > odd.xyz
  local command
  for command in "info odd.ply" "info odd.xyz" "info odd.ply --json" "info odd.xyz --json" \
    "index odd.xyz -o odd.sft" "gather $escape.sft odd.ply -o out.ply" "info $escape"; do
    # shellcheck disable=SC2086
    "$surfeit" $command > said 2>&1 || true
    if LC_ALL=C grep -q $'[\x01-\x08\x0b-\x1f\x7f]\|\xc2[\x80-\x9f]\|\xff' said; then
      fail "escapes in what is said: surfeit $command: $(od -c said)"
    fi
    [[ -s said || $command == index* ]] || fail "nothing said: surfeit $command"
  done
}

runCase
