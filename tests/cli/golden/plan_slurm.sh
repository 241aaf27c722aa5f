#!/bin/bash
# A gather in 16 shards: 16 tasks of 1536 MiB and 8 threads (surfeit VERSION, docs/farm.md).
# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little
# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; any
# other, such as 2 and 3 (command line, data): not again, it would end the same way.
#
# bash FILE submits the tasks as a job array, and behind it a job that merges. That job submits what
# is missing again, with a merge behind it, up to ROUNDS times. It begins after the tasks by
# `afterany`: `afterok` would cancel it for a task that succeeds when it is tried again. Tasks are not
# requeued (RequeueExit, scontrol requeue): a requeued task waits until its credential expires, two
# minutes by default, keeps its memory, and a running job cannot be given more.
#
# Options of the site go into the environment: SBATCH_PARTITION, SBATCH_ACCOUNT, ... (man sbatch).
# Names are relative to the directory where FILE is run. Logs are in RESULT.farm; its file `end`
# appears when all is over, with the exit status.
set -u
surfeit=${SURFEIT:-surfeit}
scene='it'\''s a $(scene) {''{x}}.sft'
receivers='two  "blanks".ply'
result='lit [1].ply'
options=(--mode=bleeding --color-range=8 --camera=-1,2,3 --no-prefetch '--environment=sky'\''s.exr')
threads=8
memory=1536 # MiB
shards=16
frames=('')
tasks=16

# gather TASK MEMORY: one shard. Tasks count the shards of the first frame, then of the second.
gather() {
  local frame=${frames[($1 - 1) / shards]}
  "$surfeit" gather "$scene" "$receivers" -o "$result" ${options[@]+"${options[@]}"} \
    --threads="$threads" --memory="$2M" --shard="$((($1 - 1) % shards + 1))/$shards" \
    ${frame:+"--frames=$frame"}
}

# merge INDEX MEMORY: the shards of the frame at that place of `frames`; they say how they were made.
merge() {
  local frame=${frames[$1]}
  "$surfeit" merge "$scene" "$receivers" -o "$result" \
    --threads="$threads" --memory="$2M" --shards="$shards" ${frame:+"--frames=$frame"}
}

minutes=90
results=('lit [1].ply')
farm=$result.farm
rounds=${ROUNDS:-6}
script=${BASH_SOURCE[0]:-}

# submit OPTION...: submits this script, and says the number of the job.
submit() {
  local job
  job=$(sbatch --parsable --no-requeue --time="$minutes" --cpus-per-task="$threads" \
    --output=/dev/null "$@") || return
  echo "${job%%;*}"
}

# submitTasks MEMORY TASK...: adds the jobs to `jobs`.
submitTasks() {
  local memory=$1 task most offset job
  local -A lists=()
  shift
  # The numbers of an array are below MaxArraySize, so many tasks are several arrays
  most=$(scontrol show config | sed -n -E 's/^MaxArraySize *= *([0-9]+).*/\1/p')
  most=$((${most:-1001} - 1))
  for task in "$@"; do
    # Killed, until it says otherwise
    echo "137 $memory" > "$farm/task-$task.status"
    offset=$(((task - 1) / most * most))
    lists[$offset]+=,$((task - offset))
  done
  for offset in "${!lists[@]}"; do
    # Beside its budget, a task has the shell that runs it
    job=$(submit --job-name=surfeit-gather --array="${lists[$offset]#,}" \
      --mem="$((memory + 64))M" "$script" task "$memory" "$offset") || return
    jobs+=:$job
  done
}

# submitMerge ROUND MEMORY: behind `jobs`.
submitMerge() {
  submit --job-name=surfeit-merge ${jobs:+"--dependency=afterany$jobs"} --mem="$(($2 + 64))M" \
    "$script" merge "$1" "$2" > /dev/null
}

# end STATUS
end() {
  echo "$1" > "$farm/end"
  exit "$1"
}

shardFile() { printf "%s.shard-%0${#shards}d-of-%d" "${results[$1]}" "$2" "$shards"; }

# missingTasks INDEX: adds the tasks of a frame that are to run again to `again`, by their memory. No
# file missing: one of them is none of this job, and all tasks look.
missingTasks() {
  local shard task status memory all=1
  for ((shard = 1; shard <= shards; ++shard)); do
    [[ -e $(shardFile "$1" "$shard") ]] || all=0
  done
  for ((shard = 1; shard <= shards; ++shard)); do
    if ((!all)) && [[ -e $(shardFile "$1" "$shard") ]]; then continue; fi
    task=$(($1 * shards + shard))
    read -r status memory < "$farm/task-$task.status"
    case $status in
      0 | 74 | 137 | 143) again[$memory]+=" $task" ;;
      33) again[$((2 * memory))]+=" $task" ;;
      *)
        echo "task $task: exit status $status, not again; see task-$task.log"
        failed=1
        ;;
    esac
  done
}

mergeAll() {
  local round=$1 merge_memory=$2 index status memory task waits=0 failed=0 name
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
  # A job within a job would inherit the memory and the processors of this one
  for name in "${!SLURM_@}"; do [[ $name == SLURM_CONF ]] || unset "$name"; done
  jobs=
  for memory in "${!again[@]}"; do
    echo "round $((round + 1)): tasks${again[$memory]} with $memory MiB"
    # shellcheck disable=SC2086
    submitTasks "$memory" ${again[$memory]} && continue
    # More memory than any node has, for example
    for task in ${again[$memory]}; do echo "1 $memory" > "$farm/task-$task.status"; done
  done
  submitMerge "$((round + 1))" "$merge_memory" || end 1
}

case ${1:-submit} in
  submit)
    if [[ ! -f $script ]]; then
      echo "save the plan to a file, and run it by bash FILE" >&2
      exit 2
    fi
    mkdir -p "$farm" || exit
    rm -f "$farm"/task-* "$farm"/merge* "$farm/end"
    jobs=
    # shellcheck disable=SC2046
    submitTasks "$memory" $(seq "$tasks") && submitMerge 1 "$memory"
    ;;
  task)
    task=$(($3 + SLURM_ARRAY_TASK_ID))
    status=0
    gather "$task" "$2" >> "$farm/task-$task.log" 2>&1 || status=$?
    echo "$status $2" > "$farm/task-$task.status"
    exit "$status"
    ;;
  merge) mergeAll "$2" "$3" >> "$farm/merge.log" 2>&1 ;;
esac
