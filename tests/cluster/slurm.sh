# Slurm on this machine alone, as root: an array job; tasks killed; SIGUSR1 before the time limit, 75, requeue, end.
if ! command -v sbatch > /dev/null || [ "$(id -u)" != 0 ]; then
  echo "skipped: Slurm is not installed, or this is not root"
else
  mkdir -p /etc/munge /run/munge state spool
  if [ ! -s /etc/munge/munge.key ]; then
    head -c 1024 /dev/urandom > /etc/munge/munge.key
  fi
  chown -R munge /etc/munge /run/munge /var/log/munge /var/lib/munge
  chmod 400 /etc/munge/munge.key
  chmod 755 /run/munge
  pgrep -x munged > /dev/null || { setpriv --reuid munge --regid munge --init-groups munged --foreground > munged.log 2>&1 & pids+=($!); }
  name=$(hostname -s)
  cat > slurm.conf <<EOF
ClusterName=here
SlurmctldHost=$name(127.0.0.1)
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmUser=root
SlurmdUser=root
ReturnToService=2
KillWait=5
StateSaveLocation=$PWD/state
SlurmdSpoolDir=$PWD/spool
SlurmctldPidFile=$PWD/slurmctld.pid
SlurmdPidFile=$PWD/slurmd.pid
SlurmctldLogFile=$PWD/slurmctld.log
SlurmdLogFile=$PWD/slurmd.log
NodeName=$name NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF
  export SLURM_CONF="$PWD/slurm.conf"
  slurmctld -D > /dev/null 2>&1 &
  pids+=($!)
  slurmd -D > /dev/null 2>&1 &
  pids+=($!)
  for _ in $(seq 60); do
    if sinfo -h -o %T 2> /dev/null | grep -q idle; then break; fi
    sleep 0.5
  done
  sinfo -h -o %T | grep -q idle || { tail -20 slurmctld.log slurmd.log; exit 1; }
  # Waits until no job is left. A requeued job would wait two minutes; it is told not to, but only after some seconds: a node
  # refuses a job for the second in which it revoked the job's last credential ("already killed, do not launch").
  finished() {
    local end=$((SECONDS + $1)) pending
    while [ "$SECONDS" -lt "$end" ]; do
      if [ -z "$(squeue -h)" ]; then return 0; fi
      pending=$(squeue -h -t PENDING -o %A)
      sleep 3
      for job in $pending; do scontrol update "JobId=$job" StartTime=now 2> /dev/null || true; done
    done
    squeue
    return 1
  }
  # The page's commands.
  while read -r command; do bash -c "$command"; done < <(commands Slurm)
  finished 240 || { cat runs/plan/slurm-*.log; exit 1; }
  same "$work/slurm/runs/plan" "Slurm" || { cat runs/plan/slurm-*.log; exit 1; }
  # The signal before a time limit of a minute. Slurm looks every 30 seconds, and sends it up to 30 seconds early: 15 to 45
  # seconds after the start. The run takes longer than that.
  mkdir limit
  plan limit 4000
  morphcog sweep limit/plan.toml --set 'seeds=[1]' --out limit/runs --slurm > limit/job.sh
  sbatch --time=1 --signal=B:USR1@15 limit/job.sh
  # A task is killed, and the job is submitted again.
  rm -r runs
  morphcog sweep plan.toml --slurm > job.sh
  sbatch job.sh
  killer "$work/slurm/.*runs/plan .* --task" 3
  finished 600 || { cat limit/runs/slurm-*.log; exit 1; }
  sbatch job.sh
  finished 240 || { cat runs/plan/slurm-*.log; exit 1; }
  same "$work/slurm/runs/plan" "Slurm, tasks killed" || { cat runs/plan/slurm-*.log; exit 1; }
  grep -q 'stopped; ' limit/runs/slurm-*-1.log || { cat limit/runs/slurm-*-1.log; exit 1; }
  morphcog sweep limit/plan.toml --set 'seeds=[1]' --out limit/runs --status | tee status | grep '1 task: 1 done' > /dev/null ||
    { cat status limit/runs/slurm-*-1.log; tail -n 40 slurmctld.log slurmd.log; exit 1; }
  echo "Slurm: stopped before the time limit $(grep -c 'stopped; ' limit/runs/slurm-*-1.log) times, requeued, done ($((SECONDS - begin)) s)"
fi
