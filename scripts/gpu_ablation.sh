#!/usr/bin/env bash
# Trains the semantic rows of the paper's ablation at the paper's sizes (`base`) on a machine with a CUDA GPU, in under ten minutes.
#
#   scripts/gpu_ablation.sh OUT
#
# First come rooms, depth and colour, then the rows of three seeds, side by side. To resume, repeat the command. The last line that it prints
# is the command that evaluates, which needs no GPU. STEPS, BATCH and ROOMS set the length; they are estimates for an H200 with 16 cores.
# DEVICE=cpu PRESET=small_plain STEPS=4 BATCH=1 ROOMS=2 SIZE=32x48 SEEDS="1 2" is a test of this script.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:?a folder for the runs}
python=${PYTHON:-python3}
read -r -a seeds <<<"${SEEDS:-1 2 3}"
export PYTHONPATH="$PWD${PYTHONPATH:+:$PYTHONPATH}" PYTHONUNBUFFERED=1 OMP_NUM_THREADS=${OMP_NUM_THREADS:-2}

command=("$python" -m semgs ablate "${PRESET:-base}" --stage semantic --out "$out" --steps "${STEPS:-400}" --batch "${BATCH:-16}"
    --size "${SIZE:-120x160}" --contexts 2 3 --targets 1 --rooms "${ROOMS:-1600}" --augmentation.flip --augmentation.colour 0.3
    --validate-every "${STEPS:-400}" --validation-scenes "${VALIDATED:-24}")
train() {  # train SEED
    "${command[@]}" --seeds "$1" --train-only --device "${DEVICE:-cuda}" --workers "${WORKERS:-4}" --minutes "${MINUTES:-9}" >>"$out/seed_$1.log" 2>&1
}

mkdir -p "$out"
runs=()
for seed in "${seeds[@]}"; do
    train "$seed" &
    runs+=($!)
    until [ -e "$out/base/colour/weights.safetensors" ] || ! kill -0 "${runs[0]}" 2>/dev/null; do sleep 1; done
done
for run in "${runs[@]}"; do wait "$run"; done
echo "${command[@]}" --seeds "${seeds[@]}"
