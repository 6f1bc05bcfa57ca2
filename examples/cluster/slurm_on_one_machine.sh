#!/usr/bin/env bash
# A Slurm cluster of two nodes on this machine, for trying things out; needs root, and Debian's slurmctld, slurmd, slurm-client, munge.
#   examples/cluster/slurm_on_one_machine.sh FOLDER COMMAND ARGUMENT…
# runs the command with the cluster up, and takes the cluster down. FOLDER holds its state and logs, and FOLDER/n2.pid the process of
# node n2, which may be killed to see what becomes of its task.
set -euo pipefail
mkdir -p "$1"
state=$(cd "$1" && pwd)
shift
export SLURM_CONF=$state/slurm.conf
host=$(hostname)
mkdir -p "$state/ctld" "$state/n1" "$state/n2" "$state/munge"
[ -s "$state/munge/key" ] || (umask 077 && head -c 1024 /dev/urandom >"$state/munge/key")
chmod 755 "$state"
chmod 700 "$state/munge"
cat >"$SLURM_CONF" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=17000
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$state/munge/socket
CryptoType=crypto/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
SlurmdTimeout=10
SchedulerParameters=batch_sched_delay=1,sched_interval=2
StateSaveLocation=$state/ctld
SlurmdSpoolDir=$state/%n
SlurmctldPidFile=$state/ctld.pid
SlurmdPidFile=$state/%n.pid
SlurmctldLogFile=$state/ctld.log
SlurmdLogFile=$state/%n.log
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=1
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=1
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
CONF
end() {
    # By the ids that these processes wrote themselves.
    for name in n1 n2 ctld munge/munged; do
        [ ! -s "$state/$name.pid" ] || kill "$(cat "$state/$name.pid")" 2>/dev/null || true
    done
}
trap end EXIT
munged --force --key-file="$state/munge/key" --socket="$state/munge/socket" --pid-file="$state/munge/munged.pid" \
    --log-file="$state/munge/log" --seed-file="$state/munge/seed"
slurmctld
slurmd -N n1
slurmd -N n2
for _ in $(seq 60); do
    [ "$(sinfo -h -t idle -o %D 2>/dev/null || true)" != 2 ] || break
    sleep 1
done
"$@"
