#!/usr/bin/env bash
# Normals of places on meshes by `surfeit normals` and by CloudCompare (Debian: cloudcompare), in turns on
# the same files: angles, flips, time and memory.
#
#   bench/normals_peers.sh BUILD_DIRECTORY COUNT MESH...
set -euo pipefail

build=$1 count=$2
shift 2
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
export QT_QPA_PLATFORM=offscreen

# measured NAME TRUTH COMMAND...: a row of the table; the command writes out.ply.
measured() {
  local name=$1 truth=$2 cost
  shift 2
  rm -f "$directory/out.ply"
  /usr/bin/time -f '%U %S %e %M' -o "$directory/cost" "$@" > "$directory/log" 2>&1 ||
    { cat "$directory/log" >&2; exit 1; }
  cost=$(awk '{ printf "%.1f | %.1f | %.0f", $1 + $2, $3, $4 / 1024 }' "$directory/cost")
  echo "| $name | $("$build/bench/normals_bench" --check "$directory/out.ply" --truth "$truth") | $cost |"
}

"$build/bench/normals_bench" "$@" --count "$count" --save "$directory" > /dev/null
echo "$count places on each mesh, the lines of a name: clean, and with noise of .2 spacings"
echo
echo '| cloud, by | median, degrees | 90 % | flips, % | without, % | CPU s | wall s | peak MiB |'
echo '|---|---|---|---|---|---|---|---|'
for cloud in "$directory"/*_truth.ply; do
  places=${cloud%_truth.ply}
  name=$(basename "$places")
  measured "$name, surfeit" "$cloud" "$build/bin/surfeit" normals "$places.ply" -o "$directory/out.ply" \
    --orient consistent --quiet
  measured "$name, CloudCompare" "$cloud" CloudCompare -SILENT -O "$places.ply" -AUTO_SAVE OFF \
    -C_EXPORT_FMT PLY -OCTREE_NORMALS auto -ORIENT_NORMS_MST 12 -SAVE_CLOUDS FILE "$directory/out.ply"
done
