# One run over 1, 2, 3 ranks with 1 and 2 threads; a rank that is killed; stopped by a signal.
if [ -z "$mpi_program" ] || ! command -v mpirun > /dev/null; then
  echo "skipped: no MPI, or no program that is built with it"
else
  ln -sf "$mpi_program" "$work/bin/morphcog"
  export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_btl=self,vader
  own="$work/local/runs/plan/tiny-seed1"
  # The page's commands, with fewer ranks.
  sed -i 's/^config = .*/config = "tiny.toml"/' plan.toml
  commands "One run over many nodes" | sed 's/-n 64/-n 3/' | grep mpirun > commands.txt
  test "$(wc -l < commands.txt)" -ge 3
  for ranks in 1 2 3; do
    for threads in 1 2; do
      mpirun -n "$ranks" morphcog evolve -q -c tiny.toml -o "run-$ranks-$threads" --threads "$threads" > mpi.log
      cmp "$own/run.json" "run-$ranks-$threads/run.json"
      mpirun -n "$ranks" morphcog audit -q -a "run-$ranks-$threads" --robots top:2 --threads "$threads" >> mpi.log
      cmp "$own/audit.json" "run-$ranks-$threads/audit.json"
      mpirun -n "$ranks" morphcog eval -q -a "run-$ranks-$threads" --robots top:2 --images 20 --threads "$threads" >> mpi.log
      cmp "$own/eval.json" "run-$ranks-$threads/eval.json"
    done
  done
  echo "MPI: elites, audit and test on 1, 2, 3 ranks with 1 and 2 threads as on one machine ($((SECONDS - begin)) s)"
  # A rank is killed: all end, and the folder goes on.
  mpirun -n 3 morphcog evolve -q -c tiny.toml -o killed --threads 1 > killed.log 2>&1 &
  job=$!
  for _ in $(seq 100); do [ ! -e killed/checkpoint.json ] || break; sleep 0.1; done
  victim=$(pgrep -f -- 'evolve -q -c tiny.toml -o killed' | grep -v "^$job\$" | tail -1)
  kill -KILL "$victim"
  if wait "$job"; then echo "a killed rank went unnoticed"; exit 1; fi
  if pgrep -f -- 'evolve -q -c tiny.toml -o killed' > /dev/null; then sleep 2; fi
  ! pgrep -f -- 'evolve -q -c tiny.toml -o killed'
  mpirun -n 2 morphcog evolve -q -c tiny.toml -o killed --resume > mpi.log
  cmp "$own/run.json" killed/run.json
  # SIGUSR1 stops all ranks at the same generation, with 75.
  mpirun -n 3 morphcog evolve -q -c tiny.toml -o stopped --threads 1 > stopped.log 2>&1 &
  job=$!
  for _ in $(seq 100); do [ ! -e stopped/checkpoint.json ] || break; sleep 0.1; done
  kill -USR1 "$job"
  code=0
  wait "$job" || code=$?
  [ "$code" -eq 75 ] || { echo "expected 75, not $code"; cat stopped.log; exit 1; }
  mpirun -n 3 morphcog evolve -q -c tiny.toml -o stopped --resume > mpi.log
  cmp "$own/run.json" stopped/run.json
  # What is wrong is said once.
  mpirun -n 3 morphcog evolve -c tiny.toml -o stopped > again.log 2>&1 || code=$?
  [ "$code" -eq 5 ] && [ "$(grep -c '^error:' again.log)" -eq 1 ] || { echo "code $code"; cat again.log; exit 1; }
  while read -r command; do bash -c "$command" > page.log 2>&1 || { cat page.log; exit 1; }; done < commands.txt
  ln -sf "$program" "$work/bin/morphcog"
  if mpirun -n 2 morphcog evolve -c tiny.toml -o without > without.log 2>&1; then exit 1; fi
  grep -q 'built without MPI' without.log
  echo "MPI: a killed rank ends all, a signal stops all, both go on to the same bytes ($((SECONDS - begin)) s)"
fi
