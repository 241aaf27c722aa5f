#!/usr/bin/env bash
# Do results step where the cut changes between tree levels? Gathers along straight lines in the
# Cornell box of the demo, at 10,000 places each, and prints the largest difference of occlusion
# between neighbours, its step, and that of irradiance over its mean. A slope has steps, too, below
# a sphere that touches the floor of half a percent; a level that comes or goes would be a jump: a
# step that differs from the mean of those before and after it. Then over the whole floor, as a
# picture has it: second differences along rows, where 10, 1 and .1 % are larger.
#
#   bench/line_steps.sh [GATHER OPTIONS ...]     surfeit and cornell_scene from PATH or build/dev
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=$PATH:$PWD/build/dev/bin:$PWD/build/dev/examples
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# line NAME FROM TO NORMAL, each "x y z"
line() {
  awk -v from="$2" -v to="$3" -v normal="$4" 'BEGIN {
    split(from, a, " "); split(to, b, " "); split(normal, n, " "); print "x,y,z,nx,ny,nz"
    for (i = 0; i < 10000; i++) {
      t = i / 9999
      printf "%.7f,%.7f,%.7f,%s,%s,%s\n", a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]),
             a[3] + t * (b[3] - a[3]), n[1], n[2], n[3]
    }
  }' > "$work/$1.csv"
  surfeit gather "$work/cornell.sft" "$work/$1.csv" -o "$work/$1.result.csv" --mode bleeding \
    --quiet "${options[@]}"
  awk -F, -v name="$1" '
    NR == 1 {
      for (i = 1; i <= NF; i++) { if ($i == "occlusion") o = i; if ($i == "irradiance_r") r = i }
      next
    }
    {
      light = ($r + $(r + 1) + $(r + 2)) / 3
      sum += light
      if (NR > 2) {
        step = $o - before; if (step < 0) step = -step
        light_step = light - light_before; if (light_step < 0) light_step = -light_step
        total += step
        if (step > largest) largest = step
        if (light_step > light_largest) light_largest = light_step
        change = light - light_before
        if (NR > 4) {
          jump = last_change - (change + change_before) / 2; if (jump < 0) jump = -jump
          if (jump > light_jump) light_jump = jump
        }
        change_before = last_change; last_change = change
      }
      before = $o; light_before = light
    }
    END {
      percent = 100 * (NR - 1) / sum
      printf "%-12s %.5f   %.5f         %.2f %%          %.2f %%\n", name, total / (NR - 2), largest,
             percent * light_largest, percent * light_jump
    }' "$work/$1.result.csv"
}

# second_differences NAME COLUMN, in rows of 500 places; those that the boxes cover are left out
second_differences() {
  awk -F, -v name="$2" '
    NR == 1 { for (i = 1; i <= NF; i++) { if ($i == "occlusion") o = i; if ($i == name) r = i } next }
    {
      value = name == "occlusion" ? $r : ($r + $(r + 1) + $(r + 2)) / 3
      if (place++ % 500 == 0) known = 0
      if ($o < 0.9) known++
      else known = 0
      if (known > 2) {
        bend = value - 2 * before + before_that
        print bend < 0 ? -bend : bend
      }
      before_that = before
      before = value
    }' "$work/floor.result.csv" | sort -g | awk -v name="$1" '
    { bends[NR] = $1 }
    END {
      printf "%-14s %.5f   %.5f   %.5f\n", name, bends[int(NR * .9)], bends[int(NR * .99)],
             bends[int(NR * .999)]
    }'
}

options=("$@")
cornell_scene "$work" > "$work/log"
surfeit sample "$work/cornell.obj" -o "$work/cornell.ply" --count 1000000 --quiet
surfeit index "$work/cornell.ply" -o "$work/cornell.sft" --quiet
echo "line         mean step   largest step    of irradiance   largest jump of it"
line floor "0.03 0 0.7" "0.97 0 0.7" "0 1 0"
line diagonal "0.03 0 0.97" "0.97 0 0.55" "0 1 0"
line wall "0 0.03 0.8" "0 0.97 0.8" "1 0 0"
line back "0.03 0.7 0" "0.97 0.7 0" "0 0 1"
line ceiling "0.03 1 0.8" "0.97 1 0.8" "0 -1 0"

awk 'BEGIN {
  print "x,y,z,nx,ny,nz"
  for (i = 0; i < 250000; i++)
    printf "%.6f,0,%.6f,0,1,0\n", .02 + .96 * (i % 500 + .5) / 500, .02 + .96 * (int(i / 500) + .5) / 500
}' > "$work/floor.csv"
surfeit gather "$work/cornell.sft" "$work/floor.csv" -o "$work/floor.result.csv" --mode bleeding \
  --quiet "${options[@]}"
echo "floor          10 %      1 %       .1 % of second differences"
second_differences occlusion occlusion
second_differences irradiance irradiance_r
