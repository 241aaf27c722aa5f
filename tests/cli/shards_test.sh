#!/usr/bin/env bash
# One case of the end-to-end tests of gathers in shards.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

makeInputs() {
  generate set.ply --surfels 30k
  "$surfeit" index -q set.ply -o set.sft --memory 64M
  generate places.ply --surfels 20k --seed 2
}

# And what one gather makes of them.
makeJob() {
  makeInputs
  "$surfeit" gather -q set.sft places.ply -o one.ply --quality draft --memory 64M
}

# Killed again and again, each time a little later, a resumed gather ends with the bytes of one.
killedGathersGoOn() {
  local kills=0 delay status
  makeJob
  # The last one has all the time that it wants
  for delay in 0.15 0.25 0.35 0.45 0.55 0; do
    status=0
    timeout -s KILL "$delay" "$surfeit" gather -q set.sft places.ply -o out.ply --quality draft --memory 64M \
      --threads 1 --resume --resume-parts 40 || status=$?
    ((status != 0)) || break
    ((status == 137)) || fail "status $status"
    kills=$((kills + 1))
    [[ ! -e out.ply ]] || fail "a result before the end"
  done
  ((kills > 0 && status == 0)) || fail "$kills kills, status $status"
  sameBytes out.ply one.ply
  [[ -z $(ls | grep -E 'shard|\.tmp$') ]] || fail "left behind: $(ls)"
}

# A stopped one says so, and goes on.
stoppedGathersGoOn() {
  local status=0
  makeJob
  "$surfeit" gather -q set.sft places.ply -o out.ply --quality draft --memory 64M --threads 1 \
    --resume --resume-parts 40 --progress none &
  local pid=$!
  until compgen -G 'out.ply.shard-*' > /dev/null; do
    kill -0 "$pid" || fail "it ended without a shard"
    sleep .02
  done
  kill -TERM "$pid"
  wait "$pid" || status=$?
  ((status == 143)) || fail "status $status, expected 143 with shards left"
  run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --resume --resume-parts 40
  says "shards were gathered before and skipped"
  sameBytes out.ply one.ply
}

# Two tasks at once with one stage, then one whose pages are all there, damaged ones among them.
stagesHaveTheSameBytes() {
  makeJob
  mkdir node
  local shard gather=(gather set.sft places.ply -o out.ply --quality draft --memory 64M --threads 1)
  for shard in 1 2; do
    "$surfeit" "${gather[@]}" --stage node --shard "$shard/4" --stats "$shard.json" --quiet &
  done
  wait
  run 0 "${gather[@]}" --stage node --shard 3/4 --stats 3.json
  says "stage: " " read there"
  (($(du -k node | cut -f 1) > 100 && $(field 3.json staged_bytes_read) > 0)) || fail "nothing staged"
  [[ $(ls node) == surfeit-stage-*.pages ]] || fail "$(ls node)"
  # Of the environment, as jobs of a plan have it
  SCRATCH=$PWD run 0 "${gather[@]}" --stage '$SCRATCH/node' --shard 4/4 --stats 4.json
  (($(field 4.json staged_bytes_read) > 0)) || fail "another stage"
  run 0 merge set.sft places.ply -o out.ply --memory 64M --remove-shards
  sameBytes out.ply one.ply
  # Damage in the middle, and a whole gather
  dd if=set.ply of="$(echo node/*)" bs=1k seek=100 count=300 conv=notrunc status=none
  run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --stage node --resume
  says ": damaged at "
  sameBytes out.ply one.ply
  run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --stage node --stage-limit 1G
  [[ $said != *damaged* ]] || fail "not mended"
  sameBytes out.ply one.ply
  # Another scene of this name
  generate other.ply --surfels 30k --seed 7
  run 0 index other.ply -o set.sft --memory 64M
  run 0 gather set.sft places.ply -o one.ply --quality draft --memory 64M
  run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --stage node
  sameBytes out.ply one.ply
  [[ $(ls node | wc -l) == 2 ]] || fail "$(ls node)"
  # No such directory, a limit, a full disk: told, and no failure
  run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --stage nowhere
  says "nowhere/" "cannot open" "what lacks is read from the scene"
  sameBytes out.ply one.ply
  rm node/*
  run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --stage node --stage-limit 100k
  says "the limit is reached"
  sameBytes out.ply one.ply
  (($(du -k node | cut -f 1) <= 140)) || fail "$(du -k node)"
  run 2 gather set.sft places.ply -o out.ply --stage '$NO_SUCH_VARIABLE/node'
  says "a variable of the environment that is set"
  run 2 gather set.sft places.ply -o out.ply --stage-limit 1G
  run 2 gather set.sft places.ply -o out.ply --stage node --stage-limit 50%
  # Plans have it as it is given
  run 0 plan set.sft places.ply -o out.ply --shards 2 --memory 64M --make --stage '$TMPDIR' --stage-limit 20G
  says "'--stage=\$\$TMPDIR'" "--stage-limit=20G"
}

shardsAreNamedWhereTheyLack() {
  makeJob
  local shard
  for shard in 1 3; do
    run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --shard "$shard/4"
  done
  run 75 merge set.sft places.ply -o out.ply
  says "2, 4 of 4" "--array=2,4"
  [[ ! -e out.ply ]] || fail "a result of half of the shards"
  for shard in 2 4; do
    run 0 gather set.sft places.ply -o out.ply --quality draft --memory 64M --shard "$shard/4"
  done
  run 0 merge set.sft places.ply -o out.ply --stats merge.json
  jsonIs merge.json shards 4 receivers 20000 invalid_receivers 0
  sameBytes out.ply one.ply
  run 0 merge set.sft places.ply -o out.ply --remove-shards
  run 75 merge set.sft places.ply -o out.ply
}

badShardsAreRefused() {
  makeInputs
  local shard
  for shard in 0/3 4/3 3 a/b 1/0 1/99999; do
    run 2 gather set.sft places.ply -o out.ply --shard "$shard"
    says "I/N"
  done
  run 2 gather set.sft places.ply -o out.ply --shard 1/2 --resume
  run 2 gather set.sft places.ply -o - --shard 1/2
  run 74 gather set.sft places.ply -o nowhere/out.ply --shard 1/2
}

runCase
