#!/usr/bin/env bash
# Whether every file of src/ includes only what its room may, rooms stand on each other in no circle
# (rooms.txt), no engine room includes a library that it must not link, and who calls the library
# includes its public headers alone.
#
#   check_layering.sh SOURCE_DIRECTORY
set -euo pipefail
rooms=$(dirname "$(readlink -f "$0")")/rooms.txt
cd "$1"

awk -v rooms="$rooms" '
  function refuse(what) { print rooms ": " what; is_refused = 1; exit 2 }
  # A room may include those above it alone, so that they stand on each other in no circle
  BEGIN {
    while ((getline line < rooms) > 0) {
      sub(/#.*/, "", line)
      if (line !~ /:/) continue
      split(line, sides, ":")
      if (sides[1] in known) refuse("room " sides[1] " is there twice")
      count = split(sides[2], names, " ")
      for (i = 1; i <= count; ++i) {
        if (names[i] ~ /\/$/) {
          for (room in known) if (index(room, names[i]) == 1) may[sides[1], room] = 1
        } else if (names[i] in known) {
          may[sides[1], names[i]] = 1
        } else {
          refuse("room " sides[1] " must not include " names[i] ", which does not stand above it")
        }
      }
      known[sides[1]] = 1
    }
    if (length(known) == 0) refuse("no rooms")
  }
  # The folder of a path below src/, where it is a room.
  function roomOf(path,   room) {
    room = path
    sub(/\/[^\/]*$/, "", room)
    return room in known ? room : ""
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
    else if (from != roomOf(to) && !((from, roomOf(to)) in may)) complain("room " from " must not include " to)
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
  END { exit is_refused ? 2 : bad }
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
