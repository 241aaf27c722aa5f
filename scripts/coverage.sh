#!/usr/bin/env bash
# Branches of the cache, the page file and the decoders of pages that the tests take.
#
#   scripts/coverage.sh [DIRECTORY]      of the build: build/coverage
#
# Builds the tests of these folders without optimization, runs them, and prints a line for each file
# and one for each folder. Branches to exceptions of the standard library are left out. Needs gcovr.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v gcovr > /dev/null || { echo "gcovr is missing: apt-get install gcovr" >&2; exit 2; }
build=${1:-build/coverage}
folders=(src/cache src/storage src/octree/page)
tests=(core/core_test cache/cache_test io/io_test io/corpus_test octree/octree_test)

mkdir -p "$build"
cmake -S . -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Debug -D CMAKE_CXX_FLAGS_DEBUG="-O0 -g1 --coverage -fprofile-update=atomic" \
  -D CMAKE_CXX_COMPILER_LAUNCHER=ccache -D SURFEIT_BUILD_BENCH=OFF -D SURFEIT_PYTHON=OFF > "$build.log" 2>&1 ||
  { cat "$build.log" >&2; exit 1; }
cmake --build "$build" ${JOBS:+--parallel $JOBS} --target "${tests[@]##*/}" > "$build.log" 2>&1 || { tail -40 "$build.log" >&2; exit 1; }
find "$build" -name '*.gcda' -delete
for test in "${tests[@]}"; do
  "$build/tests/$test" --gtest_brief=1
done

filters=()
for folder in "${folders[@]}"; do filters+=(--filter "$folder/"); done
gcovr --root . --object-directory "$build" "${filters[@]}" --exclude-throw-branches \
  --exclude-unreachable-branches --branches --csv --output "$build.csv" "$build"
python3 - "$build.csv" <<'PYTHON'
import collections
import csv
import sys

folders = collections.defaultdict(lambda: [0] * 4)
print("| file | branches | taken | lines | run |\n|---|---|---|---|---|")
for row in csv.DictReader(open(sys.argv[1])):
    counts = [int(row[key]) for key in ("branch_total", "branch_covered", "line_total", "line_covered")]
    of = folders[row["filename"].rsplit("/", 1)[0]]
    of[:] = [a + b for a, b in zip(of, counts)]
    print("| {} | {} | {} | {} | {} |".format(row["filename"], *counts))
print()
for folder, (branches, taken, lines, run) in folders.items():
    print(f"{folder}: {100 * taken / max(1, branches):.1f} % of {branches} branches, "
          f"{100 * run / max(1, lines):.1f} % of {lines} lines")
PYTHON
