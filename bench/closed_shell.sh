#!/usr/bin/env bash
# How closed is a closed shell? Gathers occlusion at places within a sphere of disks that face its
# middle, where all of it should be 1, and prints what is covered: the mean and the worst place.
#
#   bench/closed_shell.sh [DISKS ...]     default: 6000 200000; surfeit from PATH or build/dev
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=$PATH:$PWD/build/dev/bin
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Disks along a spiral, each with an equal share of the sphere
makeShell() {
  awk -v n="$1" 'BEGIN {
    pi = atan2(0, -1); turn = pi * (3 - sqrt(5)); print "x,y,z,nx,ny,nz,area"
    for (i = 0; i < n; i++) {
      z = 1 - (2 * i + 1) / n; r = sqrt(1 - z * z); x = r * cos(turn * i); y = r * sin(turn * i)
      printf "%.8f,%.8f,%.8f,%.8f,%.8f,%.8f,%.8g\n", x, y, z, -x, -y, -z, 4 * pi / n
    }
  }'
}

# 2000 places within 0.8 of the radius, each looking somewhere
makePlaces() {
  awk 'BEGIN {
    srand(1); print "x,y,z,nx,ny,nz"
    for (i = 0; i < 2000; ) {
      for (k = 0; k < 6; k++) v[k] = 2 * rand() - 1
      a = v[0] ^ 2 + v[1] ^ 2 + v[2] ^ 2; b = v[3] ^ 2 + v[4] ^ 2 + v[5] ^ 2
      if (a > 1 || b > 1 || b < 0.01) continue
      printf "%.7f,%.7f,%.7f,%.7f,%.7f,%.7f\n", .8 * v[0], .8 * v[1], .8 * v[2],
             v[3] / sqrt(b), v[4] / sqrt(b), v[5] / sqrt(b)
      i++
    }
  }'
}

makePlaces > "$work/places.csv"
[[ $# -gt 0 ]] || set -- 6000 200000
echo "disks      mean   worst"
for disks in "$@"; do
  makeShell "$disks" > "$work/shell.csv"
  surfeit index "$work/shell.csv" -o "$work/shell.sft" --quiet
  surfeit gather "$work/shell.sft" "$work/places.csv" -o "$work/result.csv" --quiet
  awk -F, -v n="$disks" '
    NR == 1 { for (i = 1; i <= NF; i++) if ($i == "occlusion") at = i; worst = 1; next }
    { sum += $at; if ($at < worst) worst = $at }
    END { printf "%-9d %.4f  %.4f\n", n, sum / (NR - 1), worst }' "$work/result.csv"
done
