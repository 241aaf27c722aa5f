#!/usr/bin/env bash
# What shards cost: processor time of a gather in N shards and their merge, over that of one gather;
# and how much faster two tasks at once are than one after the other, with a thread each.
#
#   bench/shards.sh [PROGRAM [RECEIVERS [SHARDS]]]      SHARDS_ONLY=1: not the latter
set -euo pipefail

surfeit=$(realpath "${1:-build/dev/bin/surfeit}")
receivers=${2:-1M} shards=${3:-64}
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
cd "$directory"

"$surfeit" generate -q -o city.ply --kind city --surfels 1M
"$surfeit" index -q city.ply -o city.sft
"$surfeit" generate -q -o receivers.ply --kind city --surfels "$receivers" --seed 3
gather() { "$surfeit" gather -q city.sft receivers.ply -o "$1" --mode bleeding --quality draft --memory 512M "${@:2}"; }

TIMEFORMAT='%U %S %R'
one=$({ time gather one.ply; } 2>&1)
all=$({ time {
  for ((i = 1; i <= shards; ++i)); do gather out.ply --shard "$i/$shards"; done
  "$surfeit" merge -q city.sft receivers.ply -o out.ply --memory 512M --remove-shards
}; } 2>&1)
cmp one.ply out.ply
awk -v one="$one" -v all="$all" -v shards="$shards" 'BEGIN {
  split(one, a); split(all, b)
  printf "one gather: %.1f s of processor time, %.1f s\n", a[1] + a[2], a[3]
  printf "%d shards and their merge: %.1f s, %.1f s: %.3f times the processor time, %.3f the wall time\n",
    shards, b[1] + b[2], b[3], (b[1] + b[2]) / (a[1] + a[2]), b[3] / a[3] }'

[[ -z ${SHARDS_ONLY:-} ]] || exit 0
after=$({ time { gather two.ply --shard 1/2 --threads 1; gather two.ply --shard 2/2 --threads 1; }; } 2>&1)
rm two.ply.shard-*
beside=$({ time {
  gather two.ply --shard 1/2 --threads 1 &
  gather two.ply --shard 2/2 --threads 1
  wait
}; } 2>&1)
awk -v after="$after" -v beside="$beside" 'BEGIN {
  split(after, a); split(beside, b)
  printf "two tasks, one after the other: %.1f s; at once: %.1f s: %.2f times as fast\n", a[3], b[3], a[3] / b[3] }'
