#!/usr/bin/env bash
# One case of the soak: commands with budgets and threads by chance, one after the other. Each ends
# with 0 or with 33 and a budget that would do, stays below its budget, has the bytes of the run
# before it, and leaves nothing behind.
#
# SURFEIT_SOAK_SECONDS: how long (10); SURFEIT_SOAK_SEED: of what is chosen (1).
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

seconds=${SURFEIT_SOAK_SECONDS:-10}
RANDOM=${SURFEIT_SOAK_SEED:-1}

commands=(
  "index cloud.ply -o out.sft"
  "index bare.ply -o out.sft"
  "index cloud.ply bare.ply -o out.sft --overlap thin"
  "index cloud.ply -o out.sft --normals estimate"
  "gather scene.sft receivers.ply -o out.ply --quality draft"
  "gather scene.sft receivers.ply -o out.vdb --quality draft"
  "gather scene.sft receivers.ply -o out.las --quality draft --mode bleeding --order morton"
  "gather scene.sft receivers.ply -o out.ply --quality draft --mode bleeding --resume --resume-parts 3"
  "bounce scene.sft -o out.sft --bounces 1 --surfels-per-receiver 64 --spare-last"
  "relight scene.sft -o out.sft --light-directional 0,-1,0,1,1,1"
  "lookup cloud.ply receivers.ply -o out.ply --channel radiosity"
  "brick cloud.ply --channel radiosity -o out.vdb"
  "convert cloud.ply -o out.las"
  "convert cloud.ply -o out.ply --spacing 0.01"
  "convert scene.sft -o out.ply"
  "verify scene.sft"
)

# runOnce NUMBER: with one of the budgets and numbers of threads, by chance.
runOnce() {
  local number=$1 command=${commands[$1]} status=0 file
  local memory=$((12 + RANDOM % 120)) options=() sum
  [[ $command == convert* ]] || options=(--threads $((1 + RANDOM % 4)))
  rm -f out.* stats.json
  # shellcheck disable=SC2086 # a list of words
  said=$("$surfeit" $command "${options[@]}" --memory "${memory}M" --stats stats.json --quiet 2>&1) || status=$?
  [[ $status == 0 || ($status == 33 && $said == *MiB*) ]] ||
    fail "exit status $status: surfeit $command ${options[*]} --memory ${memory}M: $said"
  # A gather that goes on another time keeps its parts
  file=$(find . -maxdepth 1 -name 'out.*' ! -name '*.shard*')
  if ((status != 0)); then
    [[ -z $file ]] || fail "left behind: $file: surfeit $command --memory ${memory}M"
    ((++refused))
    return
  fi
  if [[ -z ${SURFEIT_SANITIZED:-} ]]; then
    (($(field stats.json peak_resident_bytes) <= memory << 20)) ||
      fail "peak of $(field stats.json peak_resident_bytes) bytes: surfeit $command --memory ${memory}M"
  fi
  [[ $command == verify* ]] || {
    sum=$(sha256sum < "$file")
    [[ ${sums[$number]:-$sum} == "$sum" ]] ||
      fail "other bytes than before: surfeit $command ${options[*]} --memory ${memory}M"
    sums[number]=$sum
  }
  ((++done))
}

commandsByChanceAgree() {
  declare -A sums=()
  local done=0 refused=0 end=$((SECONDS + seconds)) files
  makeScene 20000
  mv cornell.ply cloud.ply
  mv cornell.sft scene.sft
  run 0 convert cloud.ply -o bare.ply --keep position,normal --quiet
  run 0 convert cloud.ply -o receivers.ply --every 10 --quiet
  while ((SECONDS < end)); do
    runOnce $((RANDOM % ${#commands[@]}))
  done
  rm -f out.* stats.json
  files=$(find . -type f | wc -l)
  ((files == 6)) || fail "left behind: $(find . -type f)"
  echo "$done runs, $refused refused for their budget"
  ((done > 5)) || fail "only $done runs"
}

runCase
