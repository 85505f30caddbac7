#!/usr/bin/env bash
# Trains the semantic rows of the paper's ablation on a machine with a CUDA GPU, in about ten minutes.
#
#   scripts/gpu_ablation.sh OUT
#
# First come rooms, depth and colour, then all rows of all seeds, side by side, each in its own process. To resume, repeat the command. It
# prints the command that evaluates, which needs no GPU. PRESET, STEPS, BATCH, ROOMS, SIZE, SEEDS and ROWS change what is trained.
# All share the GPU; a running MPS daemon (nvidia-cuda-mps-control -d) lets them compute at once. ONLY=base stops before the rows.
# DEVICE=cpu STEPS=4 BATCH=1 ROOMS=2 SIZE=32x48 SEEDS="1 2" ROWS="none full" is a test of this script.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:?a folder for the runs}
python=${PYTHON:-python3}
steps=${STEPS:-1800}
read -r -a seeds <<<"${SEEDS:-1 2 3}"
read -r -a rows <<<"${ROWS:-none shared windows camera full smoothness_sum smoothness_equal}"
export PYTHONPATH="$PWD${PYTHONPATH:+:$PYTHONPATH}" PYTHONUNBUFFERED=1 OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}

command=("$python" -m paper.ablate "${PRESET:-small_plain}" --stage semantic --out "$out" --steps "$steps" --batch "${BATCH:-8}"
    --size "${SIZE:-120x160}" --contexts 2 3 --targets 1 --rooms "${ROOMS:-800}" --augmentation.flip --augmentation.colour 0.3
    --class-weights inverse_root_frequency --validate-every "${VALIDATE:-$((steps / 4))}" --validation-scenes "${VALIDATED:-12}")
train() {  # train SEED ROW WORKERS
    "${command[@]}" --seeds "$1" --rows "$2" --train-only --device "${DEVICE:-cuda}" --workers "$3" --minutes "${MINUTES:-9}" --cache-gib 1.5 \
        >>"$out/seed_$1_$2.log" 2>&1
}

mkdir -p "$out"
echo "${command[@]}" --seeds "${seeds[@]}"
train "${seeds[0]}" base "${WORKERS:-8}"
[ "${ONLY:-}" = base ] && exit
runs=()
for seed in "${seeds[@]}"; do
    for row in "${rows[@]}"; do
        train "$seed" "$row" 1 &
        runs+=($!)
    done
done
failed=0
for run in "${runs[@]}"; do wait "$run" || failed=$?; done  # all of them, also after one that failed
exit "$failed"
