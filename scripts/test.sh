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
cmake --preset "$preset"
cmake --build --preset "$preset" --parallel "$(nproc)"

# The files of the tests are in memory where there is room for them: on a disk tests wait for it most
# of their time
if [[ -z ${TMPDIR:-} && $(df --output=avail -B1M /dev/shm 2> /dev/null | tail -n 1) -ge 4096 ]]; then
  TMPDIR=$(mktemp -d /dev/shm/surfeit_tests.XXXXXX)
  export TMPDIR
  trap 'rm -rf "$TMPDIR"' EXIT
fi
ctest --preset "$preset" --parallel "$(($(nproc) + 1))" "$@"
