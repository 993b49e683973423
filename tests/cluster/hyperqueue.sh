# HyperQueue, as its wheel has it: a server and workers in one process, which is killed once; tasks killed at random.
python=${HYPERQUEUE_PYTHON:-python3}
if ! "$python" -c 'import hyperqueue' 2> /dev/null; then
  echo "skipped: the Python package hyperqueue is not installed"
else
  sed -n '/^```python$/,/^```$/p' "$root/docs/cluster.md" | sed '/^```/d' > submit.py
  killer "$work/hyperqueue/.* --task" 3 &
  pids+=($!)
  "$python" submit.py > hyperqueue.log 2>&1 &
  cluster=$!
  sleep 3
  kill -KILL "$cluster" 2> /dev/null || true
  wait "$cluster" || true
  wait "${pids[-1]}"
  # A task that outlived its worker holds its folder: the next one waits for it or is tried again.
  for _ in $(seq 20); do
    "$python" submit.py > hyperqueue.log 2>&1 || true
    if morphcog sweep plan.toml --status | grep -q '3 tasks: 3 done'; then break; fi
    sleep 1
  done
  same "$work/hyperqueue/runs/plan" "HyperQueue, tasks and a worker killed" || { cat hyperqueue.log; exit 1; }
fi
