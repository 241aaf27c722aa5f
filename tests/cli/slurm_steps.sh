# A Slurm cluster of two nodes on this machine, for tests: munge, slurmctld and two slurmd, without
# systemd, in a directory and with ports of their own. Sourced after cli_steps.sh. Ends the test as
# skipped (77) where Slurm is not installed or this is not root.
#
#   startSlurm DIRECTORY    exports SLURM_CONF; all of it ends with the script
#
# waitUntil SECONDS COMMAND...
waitUntil() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    ((SECONDS < end)) || return 1
    sleep 0.2
  done
}

skipWithoutSlurm() {
  local program
  for program in munged slurmctld slurmd sbatch; do
    PATH=$PATH:/usr/sbin command -v "$program" > /dev/null && continue
    echo "skipped: no $program; scripts/farm_test.sh installs slurm-wlm and munge"
    exit 77
  done
  if [[ $(id -u) != 0 ]]; then
    echo "skipped: a cluster of its own needs the superuser"
    exit 77
  fi
}

# A port that nobody listens at, in `port`, from $1 on.
findPort() {
  port=$1
  while (: < "/dev/tcp/127.0.0.1/$port") 2> /dev/null; do port=$((port + 1)); done
}

stopSlurm() {
  local process
  for process in "${slurm_processes[@]}"; do kill "$process" 2> /dev/null; done
  # What does not end by itself
  for process in "${slurm_processes[@]}"; do
    waitUntil 5 eval "! kill -0 $process 2> /dev/null" || kill -9 "$process"
  done
  rm -rf "$slurm"
}

slurmConf() {
  local controller_port=$1 first_port=$2 second_port=$3
  cat << CONF
ClusterName=surfeit
SlurmctldHost=localhost(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$slurm/munge.socket
CredType=cred/munge
SlurmctldPort=$controller_port
SlurmctldPidFile=$slurm/slurmctld.pid
SlurmctldLogFile=$slurm/slurmctld.log
StateSaveLocation=$slurm/state
SlurmdPidFile=$slurm/%n.pid
SlurmdLogFile=$slurm/%n.log
SlurmdSpoolDir=$slurm/%n
# No cgroups, which a container may lack
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
KillWait=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=0,bf_interval=1,defer_batch
SlurmdParameters=config_overrides
NodeName=node1 NodeHostname=localhost NodeAddr=127.0.0.1 Port=$first_port CPUs=2 RealMemory=2000
NodeName=node2 NodeHostname=localhost NodeAddr=127.0.0.1 Port=$second_port CPUs=2 RealMemory=2000
PartitionName=all Nodes=node1,node2 Default=YES MaxTime=60 State=UP
CONF
}

nodesAreIdle() { [[ $(sinfo --noheader --format=%T --Node 2> /dev/null) == $'idle\nidle' ]]; }

startSlurm() {
  export PATH=$PATH:/usr/sbin
  # Sockets have short names, and munge wants a directory that only the superuser writes to
  slurm=$(mktemp -d /tmp/slurm.XXXXXX)
  slurm_processes=()
  trap stopSlurm EXIT
  chmod 755 "$slurm"
  mkdir "$slurm/state" "$slurm/node1" "$slurm/node2"
  local controller_port first_port second_port port
  findPort $((20000 + $$ % 20000))
  controller_port=$port
  findPort $((port + 1))
  first_port=$port
  findPort $((port + 1))
  second_port=$port
  export SLURM_CONF=$slurm/slurm.conf
  slurmConf "$controller_port" "$first_port" "$second_port" > "$SLURM_CONF"

  head -c 128 /dev/urandom > "$slurm/munge.key"
  chmod 400 "$slurm/munge.key"
  munged --foreground --force --num-threads=2 --key-file="$slurm/munge.key" \
    --socket="$slurm/munge.socket" --pid-file="$slurm/munge.pid" --seed-file="$slurm/munge.seed" \
    --log-file="$slurm/munge.log" > "$slurm/munged.out" 2>&1 &
  slurm_processes+=($!)
  waitUntil 10 test -S "$slurm/munge.socket" || fail "munged: $(cat "$slurm"/munged.out)"
  slurmctld -D -c > "$slurm/slurmctld.out" 2>&1 &
  slurm_processes+=($!)
  local node
  for node in node1 node2; do
    slurmd -D -N "$node" > "$slurm/$node.out" 2>&1 &
    slurm_processes+=($!)
  done
  waitUntil 30 nodesAreIdle || fail "no cluster: $(sinfo; tail -n 5 "$slurm"/*.log)"
}
