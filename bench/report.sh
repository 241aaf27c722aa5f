#!/usr/bin/env bash
# Runs the commands of docs/benchmarks.md and puts what they print below them.
#
#   bench/report.sh [SECTION...]      all sections, or those whose heading is named
#
# A block of the page is a fence "console" with lines "$ COMMAND". What a command prints follows it,
# and the block ends with a line of the commit, the machine and the seconds that it took. Commands run
# at the root of the repository with build/dev/bin, build/dev/bench and bench in PATH; what they keep
# lies in out/bench. Where a command fails, its block stays as it was, and the status is 1.
#
# Rates need a quiet machine; errors do not. Everything takes some 90 minutes of two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=$PWD/build/dev/bin:$PWD/build/dev/bench:$PWD/bench:$PATH
page=docs/benchmarks.md
mkdir -p out/bench

# "# commit 0123456, 2 x AMD EPYC (avx2), 12 s"
measured_by() {
  local commit changed='' model isa=scalar wider
  commit=$(git rev-parse --short HEAD)
  git diff --quiet HEAD -- src include tools bench || changed=' and changes'
  model=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)
  for wider in sse4_2 avx2 avx512f; do
    if grep -qw "$wider" /proc/cpuinfo; then isa=$wider; fi
  done
  printf '# commit %s%s, %s x %s (%s), %s s\n' "$commit" "$changed" "$(nproc)" "$model" "$isa" "$1"
}

is_wanted() { # HEADING NAME...
  local heading=$1 name
  shift
  (($# > 0)) || return 0
  for name; do [[ $heading == "$name" ]] && return 0; done
  return 1
}

# Runs the commands of a block and prints the block anew.
run_block() {
  local line start=$SECONDS
  printf '```console\n'
  while IFS= read -r line; do
    [[ $line == '$ '* ]] || continue
    printf '%s\n' "$line"
    printf '%s\n' "$line" >&2
    bash -o pipefail -c "${line#'$ '}" || return 1
  done
  measured_by $((SECONDS - start))
  printf '```\n'
}

new=$(mktemp) block=$(mktemp)
trap 'rm -f "$new" "$block" "$block.new"' EXIT
heading='' failed=0
while IFS= read -r line; do
  if [[ $line =~ ^#+\ (.*)$ ]]; then heading=${BASH_REMATCH[1]}; fi
  if [[ $line != '```console' ]]; then
    printf '%s\n' "$line" >> "$new"
    continue
  fi
  : > "$block"
  while IFS= read -r line && [[ $line != '```' ]]; do printf '%s\n' "$line" >> "$block"; done
  if is_wanted "$heading" "$@"; then
    if run_block < "$block" > "$block.new"; then
      cat "$block.new" >> "$new"
      continue
    fi
    printf 'report.sh: a command of "%s" failed; its block stays as it was\n' "$heading" >&2
    failed=1
  fi
  { printf '```console\n'; cat "$block"; printf '```\n'; } >> "$new"
done < "$page"
cp "$new" "$page"
exit $failed
