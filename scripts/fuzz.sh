#!/usr/bin/env bash
# Fuzzes every format that is read, one after the other. fuzz/README.md has more.
#
#   scripts/fuzz.sh [SECONDS for each (60)] [FORMAT ...]
#   scripts/fuzz.sh --hours HOURS [FORMAT ...]        # in all, on as many cores as there are
#
# What is found and the corpora as they grow are kept in build/fuzz/found/FORMAT; a table of executions
# and findings in build/fuzz/found/table.txt. Ends with 1 when something was found.
set -euo pipefail
cd "$(dirname "$0")/.."

hours=0
if [[ ${1:-} == --hours ]]; then
  hours=${2:-}
  if [[ ! $hours =~ ^[0-9]+(\.[0-9]+)?$ ]]; then
    echo "fuzz.sh: $hours, expected a number of hours" >&2
    exit 2
  fi
  shift 2
  seconds=0
else
  seconds=${1:-60}
  if [[ ! $seconds =~ ^[1-9][0-9]*$ ]]; then
    echo "fuzz.sh: $seconds, expected a number of seconds" >&2
    exit 2
  fi
  shift || true
fi
formats=("$@")
if ((${#formats[@]} == 0)); then
  for directory in fuzz/corpus/*/; do formats+=("$(basename "$directory")"); done
fi
jobs=1
if ((seconds == 0)); then
  jobs=$(nproc)
  seconds=$(awk -v h="$hours" -v n=${#formats[@]} -v j="$jobs" \
    'BEGIN { s = int(3600 * h * j / n); print s < 1 ? 1 : s }')
fi

cmake --preset fuzz
cmake --build --preset fuzz --parallel "$(nproc)" --target read_cloud_fuzzer

export UBSAN_OPTIONS=print_stacktrace=1
fuzz() {
  local format=$1 work=build/fuzz/found/$1 found=none
  mkdir -p "$work/corpus"
  build/fuzz/fuzz/read_cloud_fuzzer --format="$format" "$work/corpus" "fuzz/corpus/$format" \
    -max_total_time="$seconds" -max_len=65536 -timeout=20 -malloc_limit_mb=512 -rss_limit_mb=2048 \
    -print_final_stats=1 -artifact_prefix="$work/" > "$work/log" 2>&1 ||
    found=$(grep -m 1 -oE '(ERROR: |runtime error: |surfeit bug: ).*' "$work/log" || echo "see $work/log")
  printf '%-12s %14s executions, %8s a second, findings: %s\n' "$format" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$work/log")" \
    "$(sed -n 's/^stat::average_exec_per_sec: *//p' "$work/log")" "$found" | tee "$work/row"
  [[ $found == none ]]
}

pids=()
for format in "${formats[@]}"; do
  while (($(jobs -rp | wc -l) >= jobs)); do sleep 1; done
  fuzz "$format" &
  pids+=($!)
done
found=0
for pid in "${pids[@]}"; do wait "$pid" || found=1; done
for format in "${formats[@]}"; do cat "build/fuzz/found/$format/row"; done > build/fuzz/found/table.txt
exit $found
