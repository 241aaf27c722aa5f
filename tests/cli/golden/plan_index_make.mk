# An index in 16 shards: 3 passes of 16 tasks of 1024 MiB and 8 threads (surfeit VERSION, docs/farm.md).
# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little
# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; any
# other, such as 2 and 3 (command line, data): not again, it would end the same way.
# 75: the pass before is not complete; again behind it.
#
# make -k -j JOBS -f FILE runs JOBS tasks at a time and merges the frames that are complete; run again,
# it goes on with what has failed. `make -f FILE count-3` is one task.
define surfeit_plan
set -u
surfeit=$${SURFEIT:-surfeit}
clouds=('it'\''s a $$(cloud) {''{x}}.ply' 'two  "blanks".ply')
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
  local frame=$${frames[($$2 - 1) / shards]}
  "$$surfeit" index $${clouds[@]+"$${clouds[@]}"} -o "$$result" $${options[@]+"$${options[@]}"} \
    --threads="$$threads" --memory="$$3M" --pass="$$1" --shard="$$((($$2 - 1) % shards + 1))/$$shards" \
    $${frame:+"--frames=$$frame"}
}

# merge INDEX MEMORY: the shards of the frame at that place of `frames`.
merge() {
  local frame=$${frames[$$1]}
  "$$surfeit" index $${clouds[@]+"$${clouds[@]}"} -o "$$result" $${options[@]+"$${options[@]}"} \
    --threads="$$threads" --memory="$$2M" --pass=merge --shards="$$shards" $${remove:+--remove-shards} \
    $${frame:+"--frames=$$frame"}
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

count_tasks := $(addprefix count-,$(shell seq 1 1 16))
.PHONY: $(count_tasks)
$(count_tasks): count-%:
	@bash -c "$$surfeit_plan" surfeit-plan count $*

distribute_tasks := $(addprefix distribute-,$(shell seq 1 1 16))
.PHONY: $(distribute_tasks)
$(distribute_tasks): distribute-%:
	@bash -c "$$surfeit_plan" surfeit-plan distribute $*

build_tasks := $(addprefix build-,$(shell seq 1 1 16))
.PHONY: $(build_tasks)
$(build_tasks): build-%:
	@bash -c "$$surfeit_plan" surfeit-plan build $*

.PHONY: all-count
all-count: $(addprefix count-,$(shell seq 1 16))
$(addprefix distribute-,$(shell seq 1 16)): all-count
.PHONY: all-distribute
all-distribute: $(addprefix distribute-,$(shell seq 1 16))
$(addprefix build-,$(shell seq 1 16)): all-distribute
all: merge
.PHONY: merge
merge: $(addprefix build-,$(shell seq 1 16))
	@bash -c "$$surfeit_plan" surfeit-plan merge 0
