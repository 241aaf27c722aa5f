#!/usr/bin/env bash
# Frames of a sequence by one call of gather, against a call for each: one scene, receivers that
# change. The scene stays open and its caches warm.
#
#   bench/frames.sh [PROGRAM [FRAMES [SURFELS [RECEIVERS]]]]
set -euo pipefail

surfeit=$(realpath "${1:-build/dev/bin/surfeit}")
frames=${2:-24} surfels=${3:-1M} receivers=${4:-10k}
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
cd "$directory"

"$surfeit" generate -q -o city.ply --surfels "$surfels"
"$surfeit" index -q city.ply -o city.sft
for ((i = 1; i <= frames; ++i)); do "$surfeit" generate -q -o "r.$i.ply" --surfels "$receivers" --seed "$((100 + i))"; done
gather() { "$surfeit" gather -q city.sft "$1" -o "$2" --quality draft --memory 256M "${@:3}"; }

TIMEFORMAT='%U %S %R'
# Once, so that the system has the files in memory
gather r.1.ply warm.ply
one=$({ time gather r.%d.ply one.%d.ply --frames "1-$frames"; } 2>&1)
each=$({ time for ((i = 1; i <= frames; ++i)); do gather "r.$i.ply" "each.$i.ply"; done; } 2>&1)
for ((i = 1; i <= frames; ++i)); do cmp "one.$i.ply" "each.$i.ply"; done
awk -v one="$one" -v each="$each" -v frames="$frames" 'BEGIN {
  split(one, a); split(each, b)
  printf "%d frames by one call: %.1f s, %.1f s of processor time; by %d calls: %.1f s, %.1f s\n",
    frames, a[3], a[1] + a[2], frames, b[3], b[1] + b[2] }'
