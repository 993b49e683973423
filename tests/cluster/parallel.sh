# GNU parallel and xargs, with tasks killed at random.
if ! command -v parallel > /dev/null; then
  echo "skipped: GNU parallel is not installed"
else
  killer "$work/parallel/.* --task" 6 &
  pids+=($!)
  morphcog sweep plan.toml --list | parallel --retries 20 --jobs 2 > parallel.log 2>&1 || { cat parallel.log; exit 1; }
  wait "${pids[-1]}"
  same "$work/parallel/runs/plan" "GNU parallel, tasks killed"
  commands "GNU parallel, xargs" | while read -r command; do
    rm -r runs
    bash -c "$command" > parallel.log 2>&1 || { cat parallel.log; exit 1; }
    same "$work/parallel/runs/plan" "${command#*| }"
  done
fi
