#!/usr/bin/env bash
# Runs semgs batch on all machines of a SLURM job: starts a Ray cluster on them, works, and ends it. docs/batch.md.
#
#     sbatch --nodes 4 --cpus-per-task 32 scripts/slurm_batch.sh reconstruct scans --out out/scans --views 3
#
# All arguments are those of semgs batch. The machines share the folder of the job, DATA and OUT, and have SemGS with the extra [cluster].
#SBATCH --job-name semgs
#SBATCH --ntasks-per-node 1
#SBATCH --time 24:00:00
set -euo pipefail
: "${SEMGS:=semgs}" "${RAY:=ray}" "${PORT:=6379}"
export RAY_USAGE_STATS_ENABLED=0
export RAY_task_oom_retries=1  # a scene without enough memory is tried twice, as without Ray

machines=$(scontrol show hostnames "$SLURM_JOB_NODELIST")
head=$(head -n 1 <<< "$machines")
count=$(wc -l <<< "$machines")
cores=${SLURM_CPUS_PER_TASK:-1}

srun --nodes 1 --ntasks 1 --cpus-per-task "$cores" --nodelist "$head" "$RAY" start --head --port "$PORT" --num-cpus "$cores" --disable-usage-stats --block &
sleep "${WAIT:-20}"
if [ "$count" -gt 1 ]; then
    srun --nodes "$((count - 1))" --ntasks "$((count - 1))" --cpus-per-task "$cores" --exclude "$head" \
        "$RAY" start --address "$head:$PORT" --num-cpus "$cores" --block &
    sleep "${WAIT:-20}"
fi
trap 'kill $(jobs -p) 2> /dev/null || true' EXIT
srun --overlap --nodes 1 --ntasks 1 --nodelist "$head" "$SEMGS" batch "$@" --ray "$head:$PORT"
