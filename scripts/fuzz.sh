#!/usr/bin/env bash
# Fuzzes every format that is read, one after the other. fuzz/README.md has more.
#
#   scripts/fuzz.sh [SECONDS for each (60)] [FORMAT ...]
#
# What is found and the corpora as they grow are kept in build/fuzz/found/FORMAT. Ends with 1 when
# something was found.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${1:-60}
if [[ ! $seconds =~ ^[1-9][0-9]*$ ]]; then
  echo "fuzz.sh: $seconds, expected a number of seconds" >&2
  exit 2
fi
shift || true
formats=("$@")
if ((${#formats[@]} == 0)); then
  for directory in fuzz/corpus/*/; do formats+=("$(basename "$directory")"); done
fi

cmake --preset fuzz
cmake --build --preset fuzz --parallel "$(nproc)" --target read_cloud_fuzzer

export UBSAN_OPTIONS=print_stacktrace=1
found=0
for format in "${formats[@]}"; do
  work=build/fuzz/found/$format
  mkdir -p "$work/corpus"
  echo "fuzz.sh: $format"
  build/fuzz/fuzz/read_cloud_fuzzer --format="$format" "$work/corpus" "fuzz/corpus/$format" \
    -max_total_time="$seconds" -max_len=65536 -timeout=20 -malloc_limit_mb=512 -rss_limit_mb=2048 \
    -print_final_stats=1 -artifact_prefix="$work/" > "$work/log" 2>&1 || found=1
  grep -E 'ERROR: |runtime error: |surfeit bug: |Test unit written' "$work/log" || true
  grep -E '^stat::(number_of_executed_units|average_exec_per_sec)' "$work/log" || true
done
exit $found
