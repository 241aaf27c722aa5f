#!/usr/bin/env bash
# Lines and files of every folder below src/, and the arrows between folders: an arrow leads from a folder
# to another when a file of the first includes a header of the second.
#
#   scripts/rooms.sh [COMMIT...]
#
# For each commit a line with the sums, and how many folders lie in a circle of arrows; then the folders of
# the last commit (default: HEAD).
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/.."
(($# > 0)) || set -- HEAD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# sources DIRECTORY: "folder name lines" of every file, and "folder > folder" of every include
sources() {
  (cd "$1" && find . -name '*.h' -o -name '*.cpp' | sort | xargs awk '
    function folder(path) { sub(/\/[^\/]*$/, "", path); return path }
    FNR == 1 { name = substr(FILENAME, 3); files[name] = 0 }
    { ++files[name] }
    /^ *# *include *"/ { split($0, parts, "\""); included[++count] = name "\t" parts[2] }
    END {
      for (name in files) print folder(name), name, files[name]
      for (i = 1; i <= count; ++i) {
        split(included[i], pair, "\t")
        if (pair[2] in files && folder(pair[1]) != folder(pair[2]))
          print folder(pair[1]), ">", folder(pair[2])
      }
    }')
}

# summary SOURCES COMMIT
summary() {
  awk -v commit="$2" '
    $2 == ">" { if (!(($1, $3) in reach)) { reach[$1, $3] = 1; ++arrows }; next }
    { lines += $3; ++files; if (!($1 in count)) ++folders; if (++count[$1] > most) { most = count[$1]; fullest = $1 } }
    END {
      for (k in count) for (i in count) if ((i, k) in reach) for (j in count) if ((k, j) in reach) reach[i, j] = 1
      for (i in count) if ((i, i) in reach) ++circled
      printf "%-10s %8d %8d %8d %8d (%s) %8d %8d\n", commit, lines, files, folders, most, fullest, arrows, circled
    }' "$1"
}

# table SOURCES: folders, with the arrows out of them and into them, and those in a circle marked
table() {
  printf '\n%-20s %8s %8s %8s %8s\n' folder lines files uses "used by"
  awk '
    $2 == ">" { if (!(($1, $3) in reach)) { reach[$1, $3] = 1; ++uses[$1]; ++used[$3] }; next }
    { lines[$1] += $3; ++files[$1] }
    END {
      for (k in files) for (i in files) if ((i, k) in reach) for (j in files) if ((k, j) in reach) reach[i, j] = 1
      for (i in files) printf "%-20s %8d %8d %8d %8d%s\n", i, lines[i], files[i], uses[i], used[i], (i, i) in reach ? "  in a circle" : ""
    }' "$1" | sort
}

printf '%-10s %8s %8s %8s %s\n' commit lines files folders \
  'most files in one (which), arrows between folders, folders in a circle of arrows'
for commit; do
  name=$(git rev-parse --short "$commit")
  mkdir -p "$work/$name"
  git archive "$commit" src | tar -x -C "$work/$name"
  sources "$work/$name/src" >"$work/$name.sources"
  summary "$work/$name.sources" "$name"
done
table "$work/$name.sources"
