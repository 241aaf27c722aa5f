#!/bin/bash
# An index in 16 shards: 3 passes of 16 tasks of 1024 MiB and 8 threads (surfeit VERSION, docs/farm.md).
# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little
# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; any
# other, such as 2 and 3 (command line, data): not again, it would end the same way.
# 75: the pass before is not complete; again behind it.
#
# bash FILE submits the tasks as a job array for each pass, and behind them a job that merges. That job
# submits what is missing again, with a merge behind it, up to ROUNDS times. Jobs wait for others by
# `afterany`: `afterok` would cancel them for a task that succeeds when it is tried again. Tasks are not
# requeued (RequeueExit, scontrol requeue): a requeued task waits until its credential expires, two
# minutes by default, keeps its memory, and a running job cannot be given more.
#
# Options of the site go into the environment: SBATCH_PARTITION, SBATCH_ACCOUNT, ... (man sbatch).
# Names are relative to the directory where FILE is run. Logs are in RESULT.farm; its file `end`
# appears when all is over, with the exit status.
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

minutes=45
merge_minutes=45
files=(count ranges slabs)
results=('city [1].sft')
# tasksOf PASS: the numbers of its tasks. The pass `places` has one for each frame.
tasksOf() {
  local step=1
  [[ $1 != places ]] || step=$shards
  seq 1 "$step" "$tasks"
}

farm=$result.farm
rounds=${ROUNDS:-6}
script=${BASH_SOURCE[0]:-}

# submit OPTION...: submits this script, and says the number of the job.
submit() {
  local job
  job=$(sbatch --parsable --no-requeue --cpus-per-task="$threads" --output=/dev/null "$@") || return
  echo "${job%%;*}"
}

# submitTasks PASS MEMORY TASK...: behind the jobs `before`; adds the jobs to `jobs`.
submitTasks() {
  local pass=$1 memory=$2 limit=$minutes task most offset job
  local -A lists=()
  shift 2
  [[ $pass != places ]] || limit=$merge_minutes
  # The numbers of an array are below MaxArraySize, so many tasks are several arrays
  most=$(scontrol show config | sed -n -E 's/^MaxArraySize *= *([0-9]+).*/\1/p')
  most=$((${most:-1001} - 1))
  for task in "$@"; do
    # Killed, until it says otherwise
    echo "137 $memory" > "$farm/$pass-$task.status"
    offset=$(((task - 1) / most * most))
    lists[$offset]+=,$((task - offset))
  done
  for offset in "${!lists[@]}"; do
    # Beside its budget, a task has the shell that runs it
    job=$(submit --job-name="surfeit-$pass" --array="${lists[$offset]#,}" --time="$limit" \
      --mem="$((memory + 64))M" ${before:+"--dependency=afterany$before"} \
      "$script" task "$pass" "$memory" "$offset") || return
    jobs+=:$job
  done
}

# submitMerge ROUND MEMORY: behind the jobs `before`.
submitMerge() {
  submit --job-name=surfeit-merge ${before:+"--dependency=afterany$before"} \
    --time="$merge_minutes" --mem="$(($2 + 64))M" "$script" merge "$1" "$2" > /dev/null
}

# submitAll: every task of every pass.
submitAll() {
  local pass
  before=
  for pass in "${passes[@]}"; do
    jobs=
    # shellcheck disable=SC2046
    submitTasks "$pass" "$memory" $(tasksOf "$pass") || return
    before=$jobs
  done
  submitMerge 1 "$memory"
}

# end STATUS
end() {
  echo "$1" > "$farm/end"
  exit "$1"
}

# shardFile INDEX PLACE SHARD: of a frame, and of the pass at that place.
shardFile() {
  printf "%s.%s-%0${#shards}d-of-%d" "${results[$1]}" "${files[$2]}" "$3" "$shards"
}

# missingTasks INDEX: adds the tasks of a frame that are to run again to `again`, by pass and memory.
# Where shards are missing although none of their files is (the merge says so, or a task of the next
# pass, by 75), one of them is none of this job, and all tasks look.
missingTasks() {
  local place pass shard last task status memory looks=1 fails
  local -a absent
  local -A own mine=()
  for ((place = ${#passes[@]} - 1; place >= 0; --place)); do
    pass=${passes[place]} absent=() fails=0 last=$shards
    [[ $pass != places ]] || last=1
    for ((shard = 1; shard <= last; ++shard)); do
      [[ -e $(shardFile "$1" "$place" "$shard") ]] || absent+=("$shard")
    done
    # shellcheck disable=SC2207
    if ((looks && ${#absent[@]} == 0)); then absent=($(seq "$last")); fi
    looks=0 own=()
    for shard in "${absent[@]}"; do
      task=$(($1 * shards + shard))
      read -r status memory < "$farm/$pass-$task.status"
      case $status in
        0 | 74 | 137 | 143) own["$pass $memory"]+=" $task" ;;
        75) own["$pass $memory"]+=" $task" looks=1 ;;
        33) own["$pass $((2 * memory))"]+=" $task" ;;
        *)
          echo "$pass $task: exit status $status, not again; see $pass-$task.log"
          failed=1 fails=1
          ;;
      esac
    done
    # What comes behind a pass that cannot be complete is not tried
    if ((fails)); then mine=(); fi
    for status in "${!own[@]}"; do mine[$status]+=${own[$status]}; done
  done
  for status in "${!mine[@]}"; do again[$status]+=${mine[$status]}; done
}

# submitAgain ROUND MEMORY: the tasks `again`, and the merge behind them.
submitAgain() {
  local pass kind memory task name
  # A job within a job would inherit the memory and the processors of this one
  for name in "${!SLURM_@}"; do [[ $name == SLURM_CONF ]] || unset "$name"; done
  before=
  for pass in "${passes[@]}"; do
    jobs=
    for kind in "${!again[@]}"; do
      [[ $kind == "$pass "* ]] || continue
      memory=${kind#* }
      echo "round $1: $pass${again[$kind]} with $memory MiB"
      # shellcheck disable=SC2086
      submitTasks "$pass" "$memory" ${again[$kind]} && continue
      # More memory than any node has, for example
      for task in ${again[$kind]}; do echo "1 $memory" > "$farm/$pass-$task.status"; done
    done
    before=${jobs:-$before}
  done
  submitMerge "$1" "$2"
}

mergeAll() {
  local round=$1 merge_memory=$2 index status waits=0 failed=0
  local -A again=()
  for index in "${!frames[@]}"; do
    [[ ! -e $farm/merged-$index ]] || continue
    status=0
    merge "$index" "$merge_memory" || status=$?
    case $status in
      0) : > "$farm/merged-$index" ;;
      33) merge_memory=$((2 * merge_memory)) waits=1 ;;
      74 | 137 | 143) waits=1 ;;
      75) missingTasks "$index" ;;
      *) failed=1 ;;
    esac
  done
  if ((waits == 0 && ${#again[@]} == 0)); then end "$failed"; fi
  if ((round >= rounds)); then
    echo "given up after $round rounds"
    end 75
  fi
  submitAgain "$((round + 1))" "$merge_memory" || end 1
}

case ${1:-submit} in
  submit)
    if [[ ! -f $script ]]; then
      echo "save the plan to a file, and run it by bash FILE" >&2
      exit 2
    fi
    mkdir -p "$farm" || exit
    rm -f "$farm"/*.status "$farm"/*.log "$farm"/merged-* "$farm/end"
    submitAll
    ;;
  task)
    task=$(($4 + SLURM_ARRAY_TASK_ID))
    status=0
    task "$2" "$task" "$3" >> "$farm/$2-$task.log" 2>&1 || status=$?
    echo "$status $3" > "$farm/$2-$task.status"
    exit "$status"
    ;;
  merge) mergeAll "$2" "$3" >> "$farm/merge.log" 2>&1 ;;
esac
