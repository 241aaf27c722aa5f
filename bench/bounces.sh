#!/usr/bin/env bash
# What spared bounces cost and how far off they are: two bounces in a Cornell box at every surfel, and with
# --spare-last at one surfel of N. Times are of the processor, over that of a gather at every surfel;
# errors are of the light that the bounces add, weighted by area, over its mean.
#
#   bench/bounces.sh [SURFELS]     surfeit and cornell_scene from PATH or build/dev
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=$PATH:$PWD/build/dev/bin:$PWD/build/dev/examples
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

cornell_scene . > log
surfeit sample -q cornell.obj -o box.ply --count "${1:-300000}"
surfeit index -q box.ply -o box.sft

TIMEFORMAT='%U %S'
seconds() { { time "$@" > log 2>&1; } 2>&1 | awk '{ print $1 + $2 }'; }
rows() { surfeit convert -q "$1" -o "$2" --keep radiosity,area; }
bounce() { surfeit bounce -q box.sft -o "$1" --bounces 2 --threads 1 "${@:2}"; }

one=$(seconds surfeit bounce -q box.sft -o one.sft --bounces 1 --threads 1)
two=$(seconds bounce all.sft)
gather=$(awk -v a="$one" -v b="$two" 'BEGIN { print b - a }')
printf 'a gather at every surfel: %.2f s\n' "$gather"
rows box.sft box.csv
rows all.sft all.csv
for n in 8 16 24 32; do
  spared=$(seconds bounce "spared.sft" --surfels-per-receiver $n --spare-last)
  rows spared.sft spared.csv
  paste -d, box.csv all.csv spared.csv | awk -F, -v n=$n -v each="$spared" -v gather="$gather" '
    NR == 1 { width = NF / 3; for (i = 1; i <= width; i++) at[$i] = i; next }
    {
      a = $(at["area"])
      for (i = 0; i < 3; i++) {
        column = at["radiosity_r"] + i
        added = $(column + width) - $column
        off = $(column + 2 * width) - $(column + width)
        area += a; light += a * added; error += a * off; square += a * off * off
      }
    }
    END {
      mean = light / area
      printf "one surfel of %-2d: a bounce takes %.3f of a gather; RMS error %.2f %%, mean %+.2f %%\n",
        n, each / 2 / gather, 100 * sqrt(square / area) / mean, 100 * error / area / mean
    }'
done
