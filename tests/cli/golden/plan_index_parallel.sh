#!/bin/bash
# An index in 16 shards: 3 passes of 16 tasks of 1024 MiB and 8 threads (surfeit VERSION, docs/farm.md).
# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little
# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; any
# other, such as 2 and 3 (command line, data): not again, it would end the same way.
# 75: the pass before is not complete; again behind it.
#
# bash FILE runs the tasks, as many at a time as JOBS says, and merges. Run again, it goes on with
# what has failed. PARALLEL='--sshloginfile HOSTS' runs them on other machines that share these files;
# a task that failed is then tried on another machine (man parallel). Logs are in RESULT.farm.
set -u
surfeit=${SURFEIT:-surfeit}
clouds=('it'\''s a $(cloud) {''{x}}.ply' 'two  "blanks".ply')
result='city [1].sft'
options=('--group=lamp=la mp.ply' --overlap=thin)
threads=8
memory=1024 # MiB
shards=16
frames=('')
tasks=16 # of each pass
passes=(count distribute build)
remove=yes

# task PASS TASK MEMORY: one shard of a pass. Tasks count the shards of the first frame, then of the
# second.
task() {
  local frame=${frames[($2 - 1) / shards]}
  "$surfeit" index ${clouds[@]+"${clouds[@]}"} -o "$result" ${options[@]+"${options[@]}"} \
    --threads="$threads" --memory="$3M" --pass="$1" --shard="$((($2 - 1) % shards + 1))/$shards" \
    ${frame:+"--frames=$frame"}
}

# merge INDEX MEMORY: the shards of the frame at that place of `frames`.
merge() {
  local frame=${frames[$1]}
  "$surfeit" index ${clouds[@]+"${clouds[@]}"} -o "$result" ${options[@]+"${options[@]}"} \
    --threads="$threads" --memory="$2M" --pass=merge --shards="$shards" ${remove:+--remove-shards} \
    ${frame:+"--frames=$frame"}
}

# tasksOf PASS: the numbers of its tasks. The pass `places` has one for each frame.
tasksOf() {
  local step=1
  [[ $1 != places ]] || step=$shards
  seq 1 "$step" "$tasks"
}

# runTask PASS TASK TRIES: a shard, by the rules above; TRIES limits 74, 137 and 143.
runTask() {
  local memory=$memory most status tries=0
  most=$(awk '/^MemTotal:/ { print int($2 / 1024) }' /proc/meminfo)
  while :; do
    status=0
    task "$1" "$2" "$memory" || status=$?
    case $status in
      33)
        ((2 * memory <= most)) || return 33
        memory=$((2 * memory))
        ;;
      74 | 137 | 143)
        tries=$((tries + 1))
        ((tries < $3)) || return "$status"
        sleep "${PAUSE:-5}"
        ;;
      *) return "$status" ;;
    esac
    echo "$1 $2: exit status $status, again with $memory MiB" >&2
  done
}

farm=$result.farm
script=$(realpath "${BASH_SOURCE[0]:-}" 2> /dev/null)
if [[ ! -f $script ]]; then
  echo "save the plan to a file, and run it by bash FILE" >&2
  exit 2
fi

if [[ ${1:-} == task ]]; then
  # What would end the same way is not tried again, though parallel asks for it
  stop=$farm/$2-$3.stop
  if [[ -e $stop ]]; then exit "$(< "$stop")"; fi
  status=0
  runTask "$2" "$3" 1 || status=$?
  case $status in 0 | 33 | 74 | 137 | 143) ;; *) echo "$status" > "$stop" ;; esac
  exit "$status"
fi

# As many tasks as processors and memory allow
free=$(awk '/^MemAvailable:/ { print int($2 / 1024) }' /proc/meminfo)
most=$((free / memory < $(nproc) / threads ? free / memory : $(nproc) / threads))
jobs=${JOBS:-$((most > 0 ? most : 1))}
mkdir -p "$farm" || exit
rm -f "$farm"/*.stop

# Further rounds are for shards that are gone although their tasks were done, and for what waited for
# them
for _ in 1 2 3; do
  for pass in "${passes[@]}"; do
    tasksOf "$pass" | parallel --quote --joblog "$farm/joblog-$pass-$shards" --resume-failed \
      --retries 3 --jobs "$jobs" --workdir "$PWD" bash "$script" task "$pass" {}
  done
  status=0
  for index in "${!frames[@]}"; do
    merged=0
    merge "$index" "$memory" || merged=$?
    if ((merged != 0 && status != 75)); then status=$merged; fi
  done
  if ((status != 75)); then break; fi
  rm -f "$farm"/joblog-*-"$shards"
  for stop in "$farm"/*.stop; do
    if [[ -e $stop && $(< "$stop") == 75 ]]; then rm -f "$stop"; fi
  done
done
exit "$status"
