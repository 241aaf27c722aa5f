#!/usr/bin/env bash
# One case of the end-to-end tests of what a job's surroundings limit.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

largeFilesAreRefusedWithAStatus() {
  generate city.ply --surfels 20k
  "$surfeit" index -q city.ply -o city.sft
  local status=0
  said=$( (ulimit -f 2 && "$surfeit" gather city.sft city.ply -o out.ply --quality draft) 2>&1) || status=$?
  [[ $status == 74 ]] || fail "status $status where files are limited"
  says "ulimit -f"
  leavesNothing out
}

missingThreadsAreAnErrorThatSaysSo() {
  # The superuser has no limit of processes
  if [[ $(id -u) == 0 ]] && ! command -v setpriv > /dev/null; then exit 77; fi
  generate city.ply --surfels 20k
  "$surfeit" index -q city.ply -o city.sft
  chmod 777 .
  chmod 644 city.ply city.sft
  local user=() command status
  if [[ $(id -u) == 0 ]]; then user=(setpriv --reuid 64123 --regid 64123 --clear-groups); fi
  "${user[@]}" "$surfeit" --version > /dev/null 2>&1 || exit 77
  for command in "index city.ply -o x.sft" "gather city.sft city.ply -o x.ply --quality draft" \
    "brick city.ply -o x.vdb" "view city.ply -o x.png"; do
    status=0
    # shellcheck disable=SC2086
    said=$("${user[@]}" bash -c 'ulimit -u 2; exec "$@"' limit "$surfeit" $command --threads 16 2>&1) ||
      status=$?
    [[ $status == 1 ]] || fail "status $status without threads: surfeit $command: $said"
    says "thread"
    leavesNothing x
  done
}

textWithoutAnyNumbersIsGivenUp() {
  { echo "# a survey" && head -c 50000000 /dev/zero | tr '\0' '\n'; } | gzip -1 > lines.xyz.gz
  run 3 info lines.xyz.gz
  says "found no line of numbers in"
  run 3 index lines.xyz.gz -o lines.sft
}

# What a command reads before it can say how far it is stops by a signal, too.
signalsStopTheFirstLook() {
  (for ((i = 0; i < 100000; ++i)); do echo "0.1 0.2 0.3"; done) > part
  (for ((i = 0; i < 300; ++i)); do cat part; done) | gzip -1 > long.xyz.gz
  local process status=0 began
  "$surfeit" index -q long.xyz.gz -o long.sft &
  process=$!
  sleep 0.5
  kill -0 "$process" || fail "ended before the signal"
  began=$(date +%s%N)
  kill -TERM "$process"
  wait "$process" || status=$?
  [[ $status == 143 ]] || fail "status $status after SIGTERM"
  (($(date +%s%N) - began < 1000000000)) || fail "took a second to stop"
}

runCase
