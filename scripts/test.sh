#!/usr/bin/env bash
# Builds everything with its tests and runs them.
#
#   scripts/test.sh [dev|asan|tsan] [CTest options, such as -LE slow or -R '^gather']
set -euo pipefail
cd "$(dirname "$0")/.."

preset=dev
if (($# > 0)) && [[ $1 != -* ]]; then
  preset=$1
  shift
fi
case $preset in
  dev | asan | tsan) ;;
  *)
    echo "test.sh: preset $preset, expected dev, asan or tsan" >&2
    exit 2
    ;;
esac

scripts/install-deps.sh
jobs=$(nproc)
cmake --preset "$preset"
cmake --build --preset "$preset" --parallel "$jobs"
# Tests of files wait for the disk most of their time
tests=$jobs
[[ $preset == dev ]] && tests=$((2 * jobs))
ctest --preset "$preset" --parallel "$tests" "$@"
