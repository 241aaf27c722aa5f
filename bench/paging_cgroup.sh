#!/usr/bin/env bash
# Gathers in memory cgroups whose limit is the budget plus 64 MiB, page cache of the system included:
# cached and with --direct-io. Prints time, the most memory charged, how often the limit was met, and
# whether the result is that of the first run. Needs the right to make cgroups.
#
# Before every gather the scene leaves the page cache.
#
#   bench/paging_cgroup.sh SCENE.sft RECEIVERS.ply BUDGET_MIB... [-- OPTIONS OF GATHER]
set -euo pipefail
if (($# < 3)); then
  sed -n '2,8s/^# \{0,1\}//p' "$0"
  exit 2
fi
scene=$1 receivers=$2
shift 2
budgets=()
while (($# > 0)) && [[ $1 != -- ]]; do
  budgets+=("$1")
  shift
done
if (($# > 0)); then shift; fi
surfeit=${SURFEIT:-$(dirname "$0")/../build/dev/bin/surfeit}
work=$(mktemp -d "${TMPDIR:-.}/paging.XXXXXX")

if [[ -d /sys/fs/cgroup/memory ]]; then # version 1
  group=/sys/fs/cgroup/memory/surfeit_paging.$$
  limit_file=memory.limit_in_bytes
else
  group=/sys/fs/cgroup/surfeit_paging.$$
  limit_file=memory.max
fi
cleanup() {
  rm -rf "$work"
  rmdir "$group" 2> /dev/null || true
}
trap cleanup EXIT

# The most charged so far and how often the limit was met
peak() {
  if [[ -f $group/memory.max_usage_in_bytes ]]; then
    echo "$(($(cat "$group/memory.max_usage_in_bytes") >> 20)) $(cat "$group/memory.failcnt")"
  else
    echo "$(($(cat "$group/memory.peak" 2> /dev/null || echo 0) >> 20))" \
      "$(awk '$1 == "max" {print $2}' "$group/memory.events")"
  fi
}

printf '%10s %10s %8s %8s %12s %12s %8s\n' 'budget MiB' reads 'exit' 'wall s' 'charged MiB' 'limit met' result
first=
for budget in "${budgets[@]}"; do
  for reads in cached direct; do
    options=("$@")
    if [[ $reads == direct ]]; then options+=(--direct-io); fi
    dd if="$scene" iflag=nocache count=0 status=none # what the system has of it goes
    mkdir "$group"
    echo $(((budget + 64) << 20)) > "$group/$limit_file"
    begin=$(date +%s.%N)
    status=0
    (
      echo "$BASHPID" > "$group/cgroup.procs"
      exec "$surfeit" gather "$scene" "$receivers" -o "$work/result.ply" --memory "${budget}M" \
        --quiet "${options[@]}"
    ) || status=$?
    wall=$(echo "$(date +%s.%N) $begin" | awk '{printf "%.1f", $1 - $2}')
    read -r charged met <<< "$(peak)"
    result=none
    if ((status == 0)); then
      sum=$(cksum < "$work/result.ply")
      first=${first:-$sum}
      if [[ $sum == "$first" ]]; then result=equal; else result=OTHER; fi
    fi
    printf '%10s %10s %8s %8s %12s %12s %8s\n' \
      "$budget" "$reads" "$status" "$wall" "$charged" "$met" "$result"
    rm -f "$work/result.ply"
    for ((try = 0; try < 50; ++try)); do rmdir "$group" 2> /dev/null && break || sleep 0.1; done
  done
done
