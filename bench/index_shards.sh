#!/usr/bin/env bash
# What an index in shards costs where sizes and normals follow from neighbours: processor time of
# each pass and of all, over that of one index; and the bytes per surfel of its files.
#
#   bench/index_shards.sh [PROGRAM [SURFELS [SHARDS [OPTION...]]]]    options of index
set -euo pipefail

surfeit=$(realpath "${1:-build/dev/bin/surfeit}")
surfels=${2:-4M} shards=${3:-8}
options=("${@:4}")
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
cd "$directory"

"$surfeit" generate -q -o city.ply --surfels "$surfels"
"$surfeit" convert -q city.ply -o bare.ply --keep position
count=$("$surfeit" info bare.ply --json | python3 -c 'import json, sys; print(json.load(sys.stdin)["elements"][0]["count"])')
index() { "$surfeit" index -q bare.ply --memory 256M ${options[@]+"${options[@]}"} "$@" 2> said || { cat said; false; }; }

TIMEFORMAT='%U %S %R'
said=$({ time index -o one.sft; } 2>&1)
all=0
one=$(awk '{ print $1 + $2 }' <<< "$said")
echo "one index: $one s of processor time, $(awk '{ print $3 }' <<< "$said") s"
for pass in count distribute build places sizes; do
  tasks=$shards
  [[ $pass != places ]] || tasks=1
  said=$({ time for ((i = 1; i <= tasks; ++i)); do index -o out.sft --pass $pass --shard "$i/$shards"; done; } 2>&1)
  echo "$pass: $(awk '{ print $1 + $2 }' <<< "$said") s"
  all=$(awk -v all="$all" '{ print all + $1 + $2 }' <<< "$said")
done
for file in ranges slabs places sized; do
  cat out.sft."$file"* | wc -c | awk -v name=$file -v count="$count" '{ printf "%s: %.1f bytes a surfel\n", name, $1 / count }'
done
said=$({ time index -o out.sft --pass merge --shards "$shards"; } 2>&1)
echo "merge: $(awk '{ print $1 + $2 }' <<< "$said") s"
cmp one.sft out.sft
wc -c < out.sft | awk -v count="$count" '{ printf "scene: %.1f bytes a surfel\n", $1 / count }'
awk -v all="$all" -v one="$one" '{ printf "all: %.1f s: %.2f times one index\n", all + $1 + $2, (all + $1 + $2) / one }' <<< "$said"
