#!/bin/bash
# Runs study.sh as an array of four tasks under a real slurmctld and slurmd on this machine, merges the shards, and compares the results with those of the
# study that was not divided: local.sh FOLDER, with `calib` on the path. Needs Debian's packages slurmctld, slurmd and munge; ends what it started.
set -euo pipefail
export PATH=$PATH:/usr/sbin
mkdir -p "$1"
folder=$(cd "$1" && pwd)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "$folder"/{state,spool,munge,work}
host=$(hostname -s)
cpus=$(nproc)

# A key, a socket and daemons of our own: nothing of the system's configuration is used.
chmod 700 "$folder/munge"
head -c 1024 /dev/urandom >"$folder/munge/key"
chmod 400 "$folder/munge/key"
# Two free ports, so that another Slurm on this machine is not disturbed.
read -r control node < <(python3 -c '
import socket
held = [socket.socket() for _ in range(2)]
for s in held: s.bind(("127.0.0.1", 0))
print(*(s.getsockname()[1] for s in held))')
cat >"$folder/slurm.conf" <<CONF
ClusterName=local
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$control
SlurmdPort=$node
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MpiDefault=none
NodeName=$host NodeAddr=127.0.0.1 Port=$node CPUs=$cpus State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf

started=()
# shellcheck disable=SC2317 # called by the trap
end() { for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done; wait; }
trap end EXIT
munged --foreground --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" --pid-file="$folder/munge/pid" \
  --log-file="$folder/munge/log" --seed-file="$folder/munge/seed" >"$folder/munge/out" 2>&1 & started+=($!)
for _ in $(seq 100); do [ -S "$folder/munge/socket" ] && break; sleep 0.1; done
slurmctld -D >"$folder/slurmctld.out" 2>&1 & started+=($!)
slurmd -D -N "$host" >"$folder/slurmd.out" 2>&1 & started+=($!)
for _ in $(seq 300); do [ "$(sinfo -h -o %T 2>/dev/null)" = idle ] && break; sleep 0.1; done
[ "$(sinfo -h -o %T)" = idle ] || { echo "error: the node did not come up; see $folder" >&2; exit 1; }

cd "$folder/work"
study=(aor --trials 1 --seed 1)
sbatch --wait --array=1-4 --output="$folder/task-%a.log" "$here/study.sh" "${study[@]}"
calib merge shards/*/*.parquet --out aor.parquet
calib study "${study[@]}" --from aor.parquet --out results --quiet >/dev/null
calib study "${study[@]}" --out undivided --quiet >/dev/null
diff -r -x '*.state.jsonl' results undivided
echo "four tasks of a Slurm array: the bytes of the undivided study"
