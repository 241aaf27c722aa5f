#!/usr/bin/env bash
# What the shared library exports, against the exports of the last release (exports.txt). Programs
# that were linked with that release need all of them as long as the SONAME is the same.
#
#   abi_test.sh LIBRARY.so EXPORTS.txt [--write]
set -euo pipefail
library=$1 expected=$2
soname=$(objdump -p "$library" | awk '$1 == "SONAME" { print $2 }')
found=$(mktemp)
trap 'rm -f "$found"' EXIT
{
  echo "$soname"
  nm --dynamic --defined-only "$library" | awk '$2 == "T" { print $3 }' | LC_ALL=C sort
} > "$found"
if [[ ${3:-} == --write ]]; then
  cp "$found" "$expected"
  exit 0
fi

failed=0
others=$(tail -n +2 "$found" | grep -v surfeit || true)
if [[ -n $others ]]; then
  echo "exports what no header of include/surfeit declares:"
  c++filt <<< "$others"
  failed=1
fi
gone=$(LC_ALL=C comm -13 <(tail -n +2 "$found") <(tail -n +2 "$expected" | LC_ALL=C sort))
if [[ -n $gone && $soname == $(head -1 "$expected") ]]; then
  echo "$soname no longer exports these. Keep them, or raise the minor version, which is in the SONAME:"
  c++filt <<< "$gone"
  failed=1
fi
new=$(LC_ALL=C comm -23 <(tail -n +2 "$found") <(tail -n +2 "$expected" | LC_ALL=C sort))
if [[ -n $new || $soname != $(head -1 "$expected") ]]; then
  echo "new exports ($soname). Write them down: $0 $library $expected --write"
  c++filt <<< "$new"
  failed=1
fi
echo "$soname: $(($(wc -l < "$found") - 1)) exports, of which $(grep -c '^surfeit_' "$found") are of the C API"
exit $failed
