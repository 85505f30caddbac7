#!/usr/bin/env bash
# Trains the included network further on a machine with a CUDA GPU, in about nine minutes: classes, and beside them depth and then colour.
#
#   scripts/gpu_day.sh OUT ROOMS PHOTOS
#
# ROOMS is a folder of rooms from `semgs rooms --frames 3`; PHOTOS a folder of labelled images (docs/train.md). OUT gets three runs, and
# OUT/weights.safetensors: the new classes with the new depth and colour. To resume, repeat the command. The numbers of steps are those that one H200
# takes in this time with 16 cores; CLASSES, DEPTH and COLOUR change them. START has the weights to start from (small).
# DEVICE=cpu CLASSES=2 DEPTH=2 COLOUR=2 SIZE=48x64 CROP=48x64 BATCH=2 WORKERS=1 is a test of this script.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:?a folder for the runs}
rooms=${2:?a folder of rooms}
photos=${3:?a folder of labelled photos}
python=${PYTHON:-python3}
start=${START:-small}
size=${SIZE:-240x320}
export PYTHONPATH="$PWD${PYTHONPATH:+:$PYTHONPATH}" PYTHONUNBUFFERED=1 OMP_NUM_THREADS=${OMP_NUM_THREADS:-2}

train() {  # train RUN STEPS OPTIONS...; with replace set, instead of the shell, so that a signal reaches it
    ${replace:+exec} "$python" -m semgs train small --out "$out/$1" --steps "$2" --validate-every "$2" --validation "$rooms" --validation-scenes 4 \
        --device "${DEVICE:-cuda}" --augmentation.flip "${@:3}" >>"$out/$1.log" 2>&1
}
mkdir -p "$out"

replace=shell train classes "${CLASSES:-2978}" --supervision pictures --init "$start" --seed 401 --data "$rooms=2" "$photos=1" --size "${CROP:-176x224}" \
    --batch "${BATCH:-48}" --workers "${WORKERS:-10}" --learning-rate 6e-4 --shared-rate 0 --clip 2 --average-decay 0.998 \
    --class-weights inverse_fourth_root_frequency --augmentation.crop 0.4 --augmentation.colour 0.4 --augmentation.camera 1 --augmentation.roll 8 &
classes=$!
trap 'kill "$classes" 2>/dev/null || true' EXIT  # if depth or colour fail, classes save a checkpoint and end, too

train depth "${DEPTH:-578}" --supervision depth --init "$start" --seed 402 --data "$rooms" --size "$size" --contexts 2 2 --targets 1 \
    --batch "${BATCH:-24}" --workers "${WORKERS:-6}" --learning-rate 6e-4 --average-decay 0.995 --depth-losses.sharp 1 --augmentation.crop 0.6 \
    --augmentation.colour 0.3 --augmentation.exposure 0.25

train colour "${COLOUR:-404}" --init "$out/depth/weights.safetensors" --seed 403 --data "$rooms" --size "$size" --contexts 2 2 --targets 1 \
    --batch "${BATCH:-12}" --workers "${WORKERS:-6}" --learning-rate 5e-4 --average-decay 0.99 --sweep-rate 0.25 --class-rate 0 --losses.semantic 0 \
    --losses.smoothness 0 --depth-weight 0.3 --augmentation.crop 0.75 --augmentation.colour 0.2

wait "$classes"
"$python" scripts/average_weights.py --start "$start" "$out/weights.safetensors" "$out/classes/weights.safetensors" "$out/colour/weights.safetensors"
