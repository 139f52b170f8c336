#!/bin/bash
# cluster.sh start DIR [NODES]: a Slurm of its own in DIR, whose daemons are this machine's processes; nothing of the
#   system's Slurm or munge is touched: own folders, sockets and ports. Prints nothing; DIR/env is to be sourced. 77 where
#   there is no Slurm.
# cluster.sh stop DIR: ends them.
# cluster.sh slurmd DIR NODE: starts the slurmd of one node again, which was killed.
# Ports are taken from where nothing listens.
set -eu
dir=$2
export PATH=$PATH:/usr/sbin:/sbin

need() {
    command -v "$1" >/dev/null || { echo "there is no $1 (deploy/install-deps.sh slurm)"; exit 77; }
}

# A port that nothing listens on; the caller's are all different.
free_port() {
    local port
    while :; do
        port=$((20000 + (RANDOM << 15 | RANDOM) % 12000))
        (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null || { echo "$port"; return; }
    done
}

start_slurmd() {
    SLURM_CONF=$dir/slurm.conf slurmd -N "$1" -D >>"$dir/slurmd-$1.out" 2>&1 &
    echo $! >"$dir/slurmd-$1.job"
}

start() {
    local nodes=${1:-2} user host ports="" i
    for tool in slurmctld slurmd sbatch munged; do need $tool; done
    user=$(id -un)
    host=$(hostname)
    mkdir -p "$dir/state" "$dir/spool" "$dir/munge"
    chmod 700 "$dir/munge"
    head -c 128 /dev/urandom >"$dir/munge/key"
    chmod 400 "$dir/munge/key"
    munged --foreground --force --num-threads=2 --key-file="$dir/munge/key" --socket="$dir/munge.sock" \
        --pid-file="$dir/munge/pid" --log-file="$dir/munge/log" --seed-file="$dir/munge/seed" >"$dir/munged.out" 2>&1 &
    echo $! >"$dir/munged.job"
    for ((i = 1; i <= nodes; i++)); do ports="$ports${ports:+,}$(free_port)"; done
    cat >"$dir/slurm.conf" <<END
ClusterName=unbake
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$dir/munge.sock
CredType=cred/munge
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool/%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd-%n.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
JobCompType=jobcomp/filetxt
JobCompLoc=$dir/jobcomp
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
JobRequeue=1
ReturnToService=2
KillWait=20
MinJobAge=60
SlurmdTimeout=10
BatchStartTimeout=5
MessageTimeout=5
SchedulerParameters=sched_interval=1,bf_interval=1,sched_min_interval=100000,requeue_delay=0
NodeName=n[1-$nodes] NodeHostname=$host NodeAddr=127.0.0.1 Port=[$ports] CPUs=2 RealMemory=4000 State=UNKNOWN
PartitionName=batch Nodes=ALL Default=YES MaxTime=INFINITE State=UP PriorityTier=1 OverSubscribe=NO
PartitionName=urgent Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=10 PreemptMode=OFF
END
    printf 'export SLURM_CONF=%q\nexport PATH=$PATH:/usr/sbin\n' "$dir/slurm.conf" >"$dir/env"
    export SLURM_CONF=$dir/slurm.conf
    for ((i = 0; i < 100; i++)); do [ -S "$dir/munge.sock" ] && break; sleep 0.05; done
    slurmctld -D >"$dir/slurmctld.out" 2>&1 &
    echo $! >"$dir/slurmctld.job"
    for ((i = 1; i <= nodes; i++)); do start_slurmd "n$i"; done
    for ((i = 0; i < 300; i++)); do
        [ "$(sinfo --noheader --Node --partition=batch --format=%T 2>/dev/null | grep -c '^idle$')" = "$nodes" ] && return
        sleep 0.1
    done
    echo "the nodes of Slurm are not idle after 30 s:" >&2
    sinfo >&2 || true
    tail -5 "$dir"/*.log "$dir"/*.out >&2
    exit 1
}

# The steps of its jobs, which outlive slurmd and wait for a controller that is gone; and what they have started.
kill_steps() {
    local pid
    for pid in $(pgrep -x slurmstepd); do
        { tr '\0' '\n' <"/proc/$pid/environ"; } 2>/dev/null | grep -qxF "SLURM_CONF=$dir/slurm.conf" || continue
        pkill -KILL -P "$pid" || true
        kill -KILL "$pid" 2>/dev/null || true
    done
}

stop() {
    local file
    kill_steps
    for file in "$dir"/*.job; do [ -f "$file" ] && kill "$(cat "$file")" 2>/dev/null; done
    for file in "$dir"/*.job; do
        [ -f "$file" ] || continue
        for _ in $(seq 50); do kill -0 "$(cat "$file")" 2>/dev/null || break; sleep 0.1; done
        kill -9 "$(cat "$file")" 2>/dev/null || true
        rm -f "$file"
    done
    kill_steps # one may have begun meanwhile
}

case $1 in
start) start "${3:-2}" ;;
stop) stop ;;
slurmd) start_slurmd "$3" ;;
esac
