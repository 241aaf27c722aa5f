# An index in 3 shards for each of 2 frames: 5 passes of 6 tasks of 1024 MiB and 2 threads (surfeit VERSION, docs/farm.md).
# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little
# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; any
# other, such as 2 and 3 (command line, data): not again, it would end the same way.
# 75: the pass before is not complete; again behind it.
# The pass `places` has one task for each frame, and no other.
#
# make -k -j JOBS -f FILE runs JOBS tasks at a time and merges the frames that are complete; run again,
# it goes on with what has failed. `make -f FILE count-3` is one task.
define surfeit_plan
set -u
surfeit=$${SURFEIT:-surfeit}
clouds=('scan.####.las')
result='scan.####.sft'
options=(--normals=estimate)
threads=2
memory=1024 # MiB
shards=3
frames=(1 2)
tasks=6 # of each pass
passes=(count distribute build places sizes)
remove=

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

count_tasks := $(addprefix count-,$(shell seq 1 1 6))
.PHONY: $(count_tasks)
$(count_tasks): count-%:
	@bash -c "$$surfeit_plan" surfeit-plan count $*

distribute_tasks := $(addprefix distribute-,$(shell seq 1 1 6))
.PHONY: $(distribute_tasks)
$(distribute_tasks): distribute-%:
	@bash -c "$$surfeit_plan" surfeit-plan distribute $*

build_tasks := $(addprefix build-,$(shell seq 1 1 6))
.PHONY: $(build_tasks)
$(build_tasks): build-%:
	@bash -c "$$surfeit_plan" surfeit-plan build $*

places_tasks := $(addprefix places-,$(shell seq 1 3 6))
.PHONY: $(places_tasks)
$(places_tasks): places-%:
	@bash -c "$$surfeit_plan" surfeit-plan places $*

sizes_tasks := $(addprefix sizes-,$(shell seq 1 1 6))
.PHONY: $(sizes_tasks)
$(sizes_tasks): sizes-%:
	@bash -c "$$surfeit_plan" surfeit-plan sizes $*

.PHONY: all-count-1
all-count-1: $(addprefix count-,$(shell seq 1 3))
$(addprefix distribute-,$(shell seq 1 3)): all-count-1
.PHONY: all-distribute-1
all-distribute-1: $(addprefix distribute-,$(shell seq 1 3))
$(addprefix build-,$(shell seq 1 3)): all-distribute-1
.PHONY: all-build-1
all-build-1: $(addprefix build-,$(shell seq 1 3))
places-1: all-build-1
.PHONY: all-places-1
all-places-1: places-1
$(addprefix sizes-,$(shell seq 1 3)): all-places-1
all: merge-1
.PHONY: merge-1
merge-1: $(addprefix sizes-,$(shell seq 1 3))
	@bash -c "$$surfeit_plan" surfeit-plan merge 0
.PHONY: all-count-2
all-count-2: $(addprefix count-,$(shell seq 4 6))
$(addprefix distribute-,$(shell seq 4 6)): all-count-2
.PHONY: all-distribute-2
all-distribute-2: $(addprefix distribute-,$(shell seq 4 6))
$(addprefix build-,$(shell seq 4 6)): all-distribute-2
.PHONY: all-build-2
all-build-2: $(addprefix build-,$(shell seq 4 6))
places-4: all-build-2
.PHONY: all-places-2
all-places-2: places-4
$(addprefix sizes-,$(shell seq 4 6)): all-places-2
all: merge-2
.PHONY: merge-2
merge-2: $(addprefix sizes-,$(shell seq 4 6))
	@bash -c "$$surfeit_plan" surfeit-plan merge 1
