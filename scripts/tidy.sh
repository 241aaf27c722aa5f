#!/usr/bin/env bash
# clang-tidy over what reads and keeps bytes that nobody vouches for: storage, cache, pages, their
# readers. Ends with 1 when it finds something.
#
#   scripts/tidy.sh [FOLDER ...]     of src/; without: the four below
#
# Needs the build of preset dev for its compile_commands.json, and clang-tidy (Debian's is 14). The
# checks are bugprone, clang-analyzer and performance, but for those that are against our style:
# parameters of one type beside each other, numbers that are made smaller or rounded on purpose, macros
# whose arguments are declarations, and room between what threads share.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v clang-tidy > /dev/null || { echo "clang-tidy is missing: apt-get install clang-tidy" >&2; exit 2; }
[[ -e build/dev/compile_commands.json ]] || cmake --preset dev > /dev/null

folders=("$@")
((${#folders[@]} > 0)) || folders=(storage cache octree/page octree/read)
checks='-*,bugprone-*,clang-analyzer-*,performance-*'
checks+=',-bugprone-easily-swappable-parameters,-bugprone-narrowing-conversions,-bugprone-macro-parentheses'
checks+=',-bugprone-incorrect-roundings,-clang-analyzer-optin.performance.Padding'

files=()
for folder in "${folders[@]}"; do files+=("src/$folder"/*.cpp); done
SECONDS=0
found=0
# xargs ends with 123 when any of them does not end with 0
printf '%s\0' "${files[@]}" | xargs -0 -n 4 -P "${JOBS:-$(nproc)}" clang-tidy -p build/dev --quiet \
  --warnings-as-errors='*' --header-filter='/src/|/include/surfeit/' --checks="$checks" 2> /dev/null || found=1
echo "${#files[@]} files in $SECONDS s"
exit $found
