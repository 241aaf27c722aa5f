# What the tests of farms are made of, beside cli_steps.sh. Sourced after it.
#
# The program of a farm job is `farm_surfeit`, a script in front of surfeit that makes some tasks fail
# as they do on farms. Its rules are files in the directory faults:
#
#   killed-I    the program of shard I is killed by SIGKILL, once
#   lost-I      so is the shell that called it: it cannot say so
#   stopped-I   it ends with 143, once
#   memory-I    it ends with 33 with less memory than the number of MiB in the file
#   files-I     it ends with 74, so many times as the file has lines
#   data-I      it ends with 3, always
#   removed-I   its shard file is gone when the merge looks for the first time
#
# Every call of a task is a line of faults/log: SHARD FRAME MEMORY STATUS. A shard of a pass of an
# index has the name PASS-I, as count-3.

# The program of the tests' jobs, as SURFEIT of their environment.
makeFarmSurfeit() {
  mkdir -p faults
  printf '#!/bin/bash\nprogram=%q\nfaults=%q\n' "$surfeit" "$PWD/faults" > farm_surfeit
  cat >> farm_surfeit << 'FAULTS'
shard='' memory='' frame='' pass=''
for word in "$@"; do
  case $word in
    --shard=*) shard=${word#*=} shard=${shard%/*} ;;
    --memory=*M) memory=${word#*=} memory=${memory%M} ;;
    --frames=*) frame=${word#*=} ;;
    --pass=*) pass=${word#*=} ;;
  esac
done
[[ -z $pass || -z $shard ]] || shard=$pass-$shard
finish() {
  [[ -z $shard ]] || echo "$shard ${frame:-0} $memory $1" >> "$faults/log"
  exit "$1"
}
if [[ $1 == merge || $pass == merge ]]; then
  for rule in "$faults"/removed-*; do
    [[ -e $rule && -e $(< "$rule") ]] || continue
    rm "$(< "$rule")" "$rule"
  done
  exec "$program" "$@"
fi
echo "${SLURMD_NODENAME:-}" >> "$faults/../nodes"
rule() { [[ -e $faults/$1-$shard ]]; }
once() { rm "$faults/$1-$shard" 2> /dev/null; }
if once killed; then
  echo "$shard ${frame:-0} $memory 137" >> "$faults/log"
  # As the system does it where memory runs out: the shell of the task, if any, lives
  bash -c 'kill -9 $$'
  exit 137
fi
if once lost; then
  echo "$shard ${frame:-0} $memory lost" >> "$faults/log"
  kill -9 "$PPID" $$
fi
if once stopped; then finish 143; fi
if rule data; then finish 3; fi
if rule memory && ((memory < $(< "$faults/memory-$shard"))); then finish 33; fi
if [[ -s $faults/files-$shard ]]; then
  sed -i 1d "$faults/files-$shard"
  finish 74
fi
status=0
"$program" "$@" || status=$?
finish "$status"
FAULTS
  chmod +x farm_surfeit
  export SURFEIT=$PWD/farm_surfeit PAUSE=0
}

# calls SHARD: memory and status of every call of its task, in order, as "64:33 128:0".
calls() { awk -v shard="$1" '$1 == shard { printf "%s%s:%s", n++ ? " " : "", $3, $4 }' faults/log; }

# callsAre SHARD CALLS
callsAre() { [[ $(calls "$1") == "$2" ]] || fail "calls of shard $1: $(calls "$1"), expected $2"; }

# A scene and receivers with names that need quotes, and the result of one machine.
makeFarmScene() {
  scene="it's a \$(scene) {{x}}.sft"
  receivers='two  "blanks".ply'
  generate set.ply --surfels 3k
  "$surfeit" index -q set.ply -o "$scene" --memory 64M
  generate "$receivers" --surfels 300 --seed 2
  "$surfeit" gather -q "$scene" "$receivers" -o expected.ply --mode bleeding --memory 64M
}

# A cloud and the scene that one machine makes of it, of more surfels than one range of the curve.
makeFarmCloud() {
  cloud="it's a \$(cloud) {{x}}.ply"
  generate "$cloud" --surfels 150k
  generate lamp.ply --surfels 1k --seed 2
  "$surfeit" index -q "$cloud" --group lamp=lamp.ply -o one.sft --memory 128M
}

# The same of places alone, whose sizes and normals follow from neighbours.
makeBareFarmCloud() {
  makeFarmCloud
  "$surfeit" convert -q "$cloud" -o bare.ply --keep albedo
  mv bare.ply "$cloud"
  "$surfeit" index -q "$cloud" --group lamp=lamp.ply --normals estimate -o one.sft --memory 128M
}

# planIndex KIND SHARDS RESULT OPTION...: a plan of an index of that cloud, in `said`.
planIndex() {
  run 0 plan --index "$cloud" --group lamp=lamp.ply -o "$3" --shards "$2" --memory 64M --threads 1 \
    "--$1" "${@:4}"
}

# A scheduler that runs every job when it is submitted: sbatch runs its tasks one after the other.
makeFakeSlurm() {
  mkdir -p bin spool
  cat > bin/scontrol << 'FAKE'
#!/bin/bash
echo "MaxArraySize            = ${MOST_ARRAY:-1001}"
FAKE
  cat > bin/sbatch << 'FAKE'
#!/bin/bash
spool=$(dirname "$0")/../spool
id=$((100 + $(ls "$spool" | wc -l)))
array='' depends=''
while [[ $1 == -* ]]; do
  case $1 in
    --array=*) array=${1#*=} ;;
    --dependency=*) depends=${1#*=} ;;
    --mem=*)
      memory=${1//[!0-9]/}
      ((memory <= ${MOST_MEMORY:-9999999})) || { echo "sbatch: no node has $memory" >&2; exit 1; }
      echo "$id $1" >> "$spool.memory"
      ;;
  esac
  shift
done
cp "$1" "$spool/$id" # as slurmd does
shift
echo "$id;cluster"
[[ -z $depends ]] || echo "$id $depends" >> "$spool.depends"
export SLURM_JOB_ID=$id SLURM_MEM_PER_NODE=1
for index in ${array//,/ }; do
  ((index < ${MOST_ARRAY:-1001})) || exit 1
  SLURM_ARRAY_TASK_ID=$index bash "$spool/$id" "$@" > /dev/null 2>&1 < /dev/null
done
[[ -n $array ]] || bash "$spool/$id" "$@" > /dev/null 2>&1 < /dev/null
exit 0
FAKE
  chmod +x bin/*
  export PATH=$PWD/bin:$PATH
}
