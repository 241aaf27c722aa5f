#!/usr/bin/env bash
# Whether every file of src/ includes only what its room may (rooms.txt), formats do not know the
# table that lists them, no engine room includes a library that it must not link, and who calls the
# library includes its public headers alone.
#
#   check_layering.sh SOURCE_DIRECTORY
set -euo pipefail
rooms=$(dirname "$(readlink -f "$0")")/rooms.txt
cd "$1"

awk -v rooms="$rooms" '
  BEGIN {
    while ((getline line < rooms) > 0) {
      sub(/#.*/, "", line)
      if (line !~ /:/) continue
      split(line, sides, ":")
      known[sides[1]] = 1
      count = split(sides[2], names, " ")
      for (i = 1; i <= count; ++i) may[sides[1], names[i]] = 1
    }
    if (length(known) == 0) { print rooms ": no rooms"; exit 2 }
  }
  # The longest room that holds a path below src/.
  function roomOf(path,   room) {
    room = path
    while (sub(/\/[^\/]*$/, "", room)) if (room in known) return room
    return ""
  }
  function mayInclude(from, to,   parent) {
    if (from == to || (from, to) in may) return 1
    parent = to
    sub(/\/.*/, "/", parent)
    return parent != to && (from, parent) in may
  }
  function complain(what) { print FILENAME ":" FNR ": " what; bad = 1 }
  /^ *# *include *"/ {
    split($0, parts, "\"")
    path = FILENAME
    sub(/^src\//, "", path)
    from = roomOf(path)
    to = parts[2]
    if (from == "") complain("in no room of " rooms)
    if (to ~ /^surfeit\//) next
    if (roomOf(to) == "") complain("includes " to ", which is in no room")
    else if (!mayInclude(from, roomOf(to))) complain("room " from " must not include " to)
    if (from ~ /^cloud\// && to ~ /cloud_formats\.h$/) {
      complain("a format must not include the table that lists it")
    }
  }
  # Third-party libraries stay in the rooms that wrap them
  /^ *# *include *<(oneapi\/tbb|tbb|OpenEXR|Imath|blosc|CLI|openvdb|png|embree|zstd|zlib)/ {
    path = FILENAME
    sub(/^src\//, "", path)
    from = roomOf(path)
    if (from ~ /^(cache|octree|gather|batch|tune|bounce|photons|index|surfels)/) {
      complain("room " from " must not use a library itself: " $0)
    }
    if (from ~ /^(core|storage)$/ && $0 ~ /OpenEXR|Imath|blosc|CLI|openvdb|png|embree/) {
      complain("the engine must not need " $0)
    }
  }
  END { exit bad }
' $(find src -name '*.h' -o -name '*.cpp' | sort)

# What calls the library, or may be called by it, knows no room.
#
#   includes_only WHO ALLOWED FILE...: no file includes another header in quotes than those
#   whose names match ALLOWED; paths that climb are not allowed either
bad=0
includes_only() {
  local who=$1 allowed=$2
  shift 2
  [ $# -gt 0 ] || return 0
  if grep -HnE '^ *# *include *"' "$@" | grep -vE ":[0-9]+: *# *include *\"($allowed)" ||
    grep -HnE '^ *# *include *["<].*\.\./' "$@"; then
    echo "$who must include $allowed alone" >&2
    bad=1
  fi
  # In angle brackets a room would be found as well
  if grep -HnE "^ *# *include *<(src|$rooms_below)/" "$@"; then
    echo "$who must not include rooms" >&2
    bad=1
  fi
}
rooms_below=$(find src -mindepth 1 -maxdepth 1 -type d -printf '%f|')
rooms_below=${rooms_below%|}
shopt -s nullglob
includes_only "public headers" 'surfeit/' include/surfeit/*.h
includes_only "tools/" 'surfeit/|tools/' tools/*.h tools/*.cpp
includes_only "bench/, but for bench/internal," 'surfeit/|bench/[a-z_]*\.h' bench/*.h bench/*.cpp
includes_only "examples/" 'surfeit/|[a-z_]*\.h' examples/*.h examples/*.cpp
includes_only "python/" 'surfeit/|[a-z_]*\.h' python/src/*.h python/src/*.cpp
exit $bad
