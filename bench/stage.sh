#!/usr/bin/env bash
# Whether --stage pays: a gather in shards in little memory, of a scene on a slow shared file system,
# two tasks at a time as on a node: without, with --stage, and from a copy that is made first.
# The file system is an emulation (bench/slow_share.cpp): MS milliseconds a read, MBS megabytes a
# second for each task.
#
#   bench/stage.sh [PROGRAM [SURFELS [RECEIVERS [SHARDS [MS [MBS [MEMORY]]]]]]]
set -euo pipefail

surfeit=$(realpath "${1:-build/dev/bin/surfeit}")
surfels=${2:-4M} receivers=${3:-100k} shards=${4:-8} milliseconds=${5:-2} rate=${6:-50} memory=${7:-64M}
shim=$(realpath "$(dirname "$0")")/slow_share.cpp
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
cd "$directory"
mkdir share node
"${CXX:-c++}" -O2 -shared -fPIC "$shim" -o slow_share.so -ldl

"$surfeit" generate -q -o city.ply --surfels "$surfels"
"$surfeit" index -q city.ply -o share/city.sft
"$surfeit" generate -q -o receivers.ply --surfels "$receivers" --seed 3
size=$(stat -c %s share/city.sft)
echo "scene of $((size >> 20)) MiB, $receivers receivers in $shards shards of $memory; $milliseconds ms a read, $rate MB/s"

# run NAME SCENE OPTION...: all shards, two at a time, and what was read of the share.
run() {
  local name=$1 scene=$2 begin end
  shift 2
  rm -f report
  begin=$(date +%s.%N)
  seq "$shards" | LD_PRELOAD=$PWD/slow_share.so SLOW_SHARE=$PWD/share/ SLOW_SHARE_MS=$milliseconds \
    SLOW_SHARE_MBS=$rate SLOW_SHARE_REPORT=$PWD/report xargs -P 2 -I{} "$surfeit" gather -q "$scene" \
    receivers.ply -o "$name.ply" --quality draft --memory "$memory" --threads 1 --shard "{}/$shards" "$@"
  end=$(date +%s.%N)
  "$surfeit" merge -q "$scene" receivers.ply -o "$name.ply" --memory "$memory" --remove-shards
  cmp -s without.ply "$name.ply" || { echo "$name: other bytes"; exit 1; }
  [[ -e report ]] || touch report
  awk -v name="$name" -v begin="$begin" -v end="$end" -v extra="${copied:-0}" '
    { reads += $1; bytes += $2 }
    END { printf "%s: %.1f s; %d reads of the share, %.0f MiB\n", name, end - begin + extra, reads, bytes / 1048576 }' report /dev/null
}

run without share/city.sft
run stage share/city.sft --stage node
run stage-again share/city.sft --stage node
# A copy reads at the rate of one task, in large reads
copied=$(awk -v size="$size" -v rate="$rate" 'BEGIN { print size / rate / 1e6 }')
cp share/city.sft node/
run copy-first node/city.sft
du -k node/surfeit-stage-* | awk '{ printf "the stage has %d MiB\n", $1 / 1024 }'
