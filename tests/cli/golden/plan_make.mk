# A gather in 16 shards: 16 tasks of 1536 MiB and 8 threads (surfeit VERSION, docs/farm.md).
# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little
# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; any
# other, such as 2 and 3 (command line, data): not again, it would end the same way.
#
# make -k -j JOBS -f FILE runs JOBS tasks at a time and merges the frames that are complete; run again,
# it goes on with what has failed. `make -f FILE gather-3` is one task.
define surfeit_plan
set -u
surfeit=$${SURFEIT:-surfeit}
scene='it'\''s a $$(scene) {''{x}}.sft'
receivers='two  "blanks".ply'
result='lit [1].ply'
options=(--mode=bleeding --color-range=8 --camera=-1,2,3 --no-prefetch '--environment=sky'\''s.exr')
threads=8
memory=1536 # MiB
shards=16
frames=('')
tasks=16 # of each pass
passes=(gather)

# task PASS TASK MEMORY: one shard. Tasks count the shards of the first frame, then of the second.
task() {
  local frame=$${frames[($$2 - 1) / shards]}
  "$$surfeit" gather "$$scene" "$$receivers" -o "$$result" $${options[@]+"$${options[@]}"} \
    --threads="$$threads" --memory="$$3M" --shard="$$((($$2 - 1) % shards + 1))/$$shards" \
    $${frame:+"--frames=$$frame"}
}

# merge INDEX MEMORY: the shards of the frame at that place of `frames`; they say how they were made.
merge() {
  local frame=$${frames[$$1]}
  "$$surfeit" merge "$$scene" "$$receivers" -o "$$result" \
    --threads="$$threads" --memory="$$2M" --shards="$$shards" $${frame:+"--frames=$$frame"}
}

# runTask PASS TASK TRIES: a shard, by the rules above; TRIES limits 74, 137 and 143.
runTask() {
  local memory=$$memory most status tries=0
  most=$$(awk '/^MemTotal:/ { print int($$2 / 1024) }' /proc/meminfo)
  while :; do
    status=0
    task "$$1" "$$2" "$$memory" || status=$$?
    case $$status in
      33)
        ((2 * memory <= most)) || return 33
        memory=$$((2 * memory))
        ;;
      74 | 137 | 143)
        tries=$$((tries + 1))
        ((tries < $$3)) || return "$$status"
        sleep "$${PAUSE:-5}"
        ;;
      *) return "$$status" ;;
    esac
    echo "$$1 $$2: exit status $$status, again with $$memory MiB" >&2
  done
}

case $$1 in
  merge) merge "$$2" "$$memory" ;;
  *) runTask "$$1" "$$2" 3 ;;
esac
endef
export surfeit_plan

.PHONY: all
all:

gather_tasks := $(addprefix gather-,$(shell seq 1 1 16))
.PHONY: $(gather_tasks)
$(gather_tasks): gather-%:
	@bash -c "$$surfeit_plan" surfeit-plan gather $*

all: merge
.PHONY: merge
merge: $(addprefix gather-,$(shell seq 1 16))
	@bash -c "$$surfeit_plan" surfeit-plan merge 0
