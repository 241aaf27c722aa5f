#!/usr/bin/env bash
# Valgrind's memcheck over the tests of what decodes bytes of others: page files, pages, the golden
# scenes. It tells what is read before it was written, which the address sanitizer does not. Ends with
# 1 when it finds something.
#
#   scripts/memcheck.sh [BUILD]      build/dev
#
# Needs valgrind, and a build without sanitizers.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v valgrind > /dev/null || { echo "valgrind is missing: apt-get install valgrind" >&2; exit 2; }
build=${1:-build/dev}

# Not those that limit or measure the memory of the process, which valgrind needs for itself
io='PageFileTest.*:-*HostileFields*'
octree='ColumnCodec.*:ColumnDamage.*:SurfelGroup.*:NodeGroupTest.*:*PageFields.*:LobePages.*'
octree+=':SceneHeader.*:GoldenTest.*:VerifyClaimsTest.*'
# GoogleTest prints the parameters of tests byte by byte, what lies between their fields included
known=$(mktemp)
trap 'rm -f "$known"' EXIT
for kind in Cond Value8; do
  printf '{\n  parameters\n  Memcheck:%s\n  ...\n  fun:*PrintByteSegmentInObjectTo*\n}\n' "$kind"
done > "$known"

SECONDS=0
found=0
check() {
  valgrind --quiet --suppressions="$known" --error-exitcode=99 --leak-check=full --errors-for-leak-kinds=definite \
    "$build/tests/$1" --gtest_brief=1 --gtest_filter="$2" || found=1
}
check io/io_test "$io"
check octree/octree_test "$octree"
echo "$SECONDS s"
exit $found
