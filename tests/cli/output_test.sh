#!/usr/bin/env bash
# One case of the end-to-end tests of outputs and pipes.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

inputsAreNoOutputs() {
  generate city.ply --surfels 3k
  ln -s city.ply link.ply
  ln city.ply hard.ply
  cp city.ply before.ply
  local output
  for output in city.ply link.ply hard.ply ./city.ply; do
    run 2 index city.ply -o "$output"
    says "--output would replace its input city.ply" "give another name"
  done
  run 2 index city.ply -o city.sft --stats city.ply
  says "--stats would replace its input"
  run 2 index city.ply -o city.sft --stats city.sft
  says "would write the same file"
  run 0 index city.ply -o city.sft
  run 2 gather city.sft city.ply -o city.ply
  run 2 gather city.sft city.ply -o city.sft
  run 2 convert before.ply -o out.ply --stats before.ply
  run 2 tune city.sft city.ply --plot city.sft
  run 2 gather city.sft city.ply -o out.ply --stats out.ply
  run 2 gather city.sft city.ply -o out.ply --stats ./out.ply
  says "would write the same file"
  run 2 gather city.sft city.ply -o out.ply --cache-series city.sft
  says "--cache-series would replace its input"
  run 2 gather city.sft city.ply -o out.ply --cache-series "$PWD/out.ply"
  run 2 gather city.sft city.ply -o out.ply --stats s.json --cache-series s.json
  [[ ! -e out.ply ]] || fail "worked before it looked at its outputs"
  sameBytes city.ply before.ply
  run 0 verify city.sft
  run 0 convert city.ply -o city.ply # works in place
  sameBytes city.ply before.ply
}

linksAndPermissionsStay() {
  generate city.ply --surfels 3k
  mkdir sub
  ln -s sub/target.csv link.csv
  run 0 convert city.ply -o link.csv # the target is not there yet
  [[ -L link.csv && -f sub/target.csv ]] || fail "the link is gone"
  cp sub/target.csv first.csv
  echo old > sub/target.csv
  chmod 640 sub/target.csv
  run 0 convert city.ply -o link.csv
  [[ -L link.csv && $(stat -c %a sub/target.csv) == 640 ]] || fail "link or permissions are gone"
  sameBytes sub/target.csv first.csv
  ln -s circle.csv circle.csv
  run 74 convert city.ply -o circle.csv
}

devicesAndPipesAreWrittenTo() {
  generate city.ply --surfels 3k
  run 0 convert city.ply -o file.csv
  run 0 convert city.ply -o file.ply
  ln -s /dev/null null.csv
  run 0 convert city.ply -o null.csv
  [[ -c /dev/null && -L null.csv ]] || fail "the device is gone"
  run 0 index city.ply -o /dev/null
  [[ -c /dev/null ]] || fail "the device is gone"
  mkfifo pipe.csv
  cat pipe.csv > read.csv &
  run 0 convert city.ply -o pipe.csv
  wait
  [[ -p pipe.csv ]] || fail "the FIFO is gone"
  sameBytes read.csv file.csv
  "$surfeit" convert city.ply -q -o - > out.ply
  sameBytes out.ply file.ply
  "$surfeit" convert city.ply -q -o -.csv | cat > out.csv
  sameBytes out.csv file.csv
  echo first > out.csv
  "$surfeit" convert city.ply -q -o -.csv >> out.csv
  [[ $(head -n 1 out.csv) == first ]] || fail "what stood before is gone"
}

inputsMayBePipes() {
  generate city.ply --surfels 3k
  run 0 index city.ply -o city.sft
  "$surfeit" index -q - -o piped.sft < <(cat city.ply)
  "$surfeit" index -q /dev/stdin -o named.sft < <(cat city.ply)
  "$surfeit" index -q - -o file.sft < city.ply
  "$surfeit" convert -q city.ply -o - | "$surfeit" convert -q - -o through.csv
  run 0 convert city.ply -o plain.csv
  sameBytes through.csv plain.csv
  # A FIFO, whose writer comes once
  mkfifo fifo.ply
  cat city.ply > fifo.ply &
  timeout 60 "$surfeit" index -q fifo.ply -o fifo.sft || fail "a FIFO"
  wait
  local scene
  for scene in piped named file fifo; do
    run 0 verify "$scene.sft"
    [[ $("$surfeit" info city.sft | sed -n 's/^ *surfels *//p') == \
      $("$surfeit" info "$scene.sft" | sed -n 's/^ *surfels *//p') ]] || fail "other surfels"
  done
  run 74 index /dev/null -o none.sft
  says "found a device"
  run 74 index . -o none.sft
  says "found a directory"
}

badPlacesAreRefusedFirst() {
  generate city.ply --surfels 3k
  mkdir sub.ply
  run 2 convert city.ply -o sub.ply
  says "is a directory"
  run 2 index city.ply -o ./
  run 74 index city.ply -o nowhere/city.sft
  says "the directory nowhere" "make it first"
  run 74 index city.ply -o city.sft --stats nowhere/stats.json
  [[ ! -e city.sft ]] || fail "worked before it looked at its outputs"
  run 74 index city.ply -o city.ply/city.sft
  local long
  long=$(printf 'x%.0s' {1..260}).ply
  run 74 convert city.ply -o "$long"
  says "shorten it"
  run 74 convert city.ply -o out.ply --stats "$long"
  [[ ! -e out.ply ]] || fail "worked before it looked at its outputs"
  if [[ $(id -u) != 0 ]]; then
    mkdir -m 555 closed
    run 74 index city.ply -o closed/city.sft
    says "cannot write in the directory"
  fi
}

resultsThatWillNotFitAreRefusedFirst() {
  generate city.ply --surfels 300k
  "$surfeit" index -q city.ply -o city.sft
  mkdir small
  mount -t tmpfs -o size=2m none small 2> /dev/null || exit 77
  trap 'umount small' EXIT
  local began
  began=$(date +%s)
  run 74 gather city.sft city.ply -o small/out.ply --quality final
  says "MiB are free in small" "write elsewhere"
  run 74 convert city.ply -o small/out.ply
  (($(date +%s) - began < 20)) || fail "gathered before it looked whether the result will fit"
  [[ -z $(ls small) ]] || fail "left behind: $(ls small)"
}

answersGoToStandardOutput() {
  generate city.ply --surfels 3k
  "$surfeit" index -q city.ply -o city.sft
  local command
  for command in "info city.sft" "info city.ply" "verify city.sft"; do
    # shellcheck disable=SC2086
    [[ -n $("$surfeit" $command 2> error) && ! -s error ]] || fail "no answer: $command"
  done
}

runCase
