#!/usr/bin/env bash
# How fast `verify` checks a scene: bytes of the file a second, of processor time and of wall time,
# beside those of reading the file from memory and from the disk (where the cache can be emptied for
# it: dd's nocache).
#
#   bench/verify_speed.sh [PROGRAM [SURFELS [THREADS]]]
set -euo pipefail

surfeit=$(realpath "${1:-build/dev/bin/surfeit}")
surfels=${2:-1M} threads=${3:-1}
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
cd "$directory"

"$surfeit" generate -q -o city.ply --kind city --surfels "$surfels"
"$surfeit" index -q city.ply -o city.sft
bytes=$(stat -c %s city.sft)

TIMEFORMAT='%U %S %R'
# told NAME COMMAND...
told() {
  local name=$1 spent
  shift
  spent=$({ time "$@" > /dev/null 2>&1; } 2>&1)
  awk -v name="$name" -v bytes="$bytes" -v spent="$spent" 'BEGIN {
    split(spent, t)
    printf "%-28s %8.1f MB/s of processor time, %8.1f MB/s\n", name, bytes / 1e6 / (t[1] + t[2] + 1e-4), bytes / 1e6 / (t[3] + 1e-4) }'
}
awk -v bytes="$bytes" 'BEGIN { printf "a scene of %.1f MB\n", bytes / 1e6 }'
sync city.sft
dd if=city.sft iflag=nocache count=0 status=none
told "read from the disk" cat city.sft
told "read from memory" cat city.sft
told "sha256sum" sha256sum city.sft
told "verify, threads: $threads" "$surfeit" verify -q city.sft --threads "$threads"
