#!/usr/bin/env bash
# How the classes of the weights that ship were trained, on two CPU cores in two hours; SHARE=5 takes 5 % of the steps.
#
#   scripts/recipe_small.sh FOLDER ASSETS BACKBONE [TEACHER]
#
# ASSETS is a folder of meshes and images with its lock (docs/assets.md). BACKBONE is a file of published MobileNetV2 weights, or "random", the clean
# alternative that nothing else has gone into (docs/train.md). TEACHER is a published segmentation network for scripts/teach.py. FOLDER
# gets the rooms (one CPU hour; those of an earlier call are kept) and two runs for each SEED; the same command goes on. Depth and colour are
# those of the weights that ship, to the bit. SEMGS is the command (semgs). At the end it prints mIoU and accuracy of single views in 24 rooms with
# meshes that are held out.
set -euo pipefail
folder=${1:?a folder to work in}
assets=${2:?a folder of assets}
backbone=${3:?published weights of a MobileNetV2, or random}
teacher=${4-}
semgs=${SEMGS:-semgs}
share=${SHARE:-100}
seed=${SEED:-72}
steps() { echo $(($1 * share / 100)); }

rooms() { $semgs rooms "$folder/$1" --scenes "$2" --frames "$3" --seed "$4" --size "$5" --assets "$assets"; }
rooms many 1000 4 2200 120x160
rooms wide 500 3 2300 240x320
python - "$folder/held" "$assets" <<'PYTHON'
import sys
from semgs.rooms.assets.library import Library
from semgs.rooms.sets.dataset import Recipe, write_dataset
from semgs.training.settings import VALIDATION_SEED

held, assets = sys.argv[1:]
write_dataset(held, Recipe(VALIDATION_SEED, (240, 320), 6, library=Library((assets,), "validation")), 24)
PYTHON
taught=()
if [ -n "$teacher" ]; then
    python "$(dirname "$0")/teach.py" "$teacher" "$folder/teacher" "$folder/wide"
    taught=(--teacher "$folder/teacher")
fi
start=(--network.class-backbone)
if [ "$backbone" != random ]; then start+=(--backbone "$backbone"); fi

# What things look like, from single images: 25,600 small ones, then 13,200 of the size that they are used at.
train() {  # train OUT STEPS OPTIONS...
    $semgs train small --supervision pictures --contexts 1 1 --targets 0 --out "$1" --steps "$(steps "$2")" --validate-every "$(steps "$2")" \
        --clip 2 --average-decay 0.998 --class-weights inverse_fourth_root_frequency --augmentation.crop 0.4 --augmentation.flip \
        --augmentation.colour 0.5 --augmentation.roll 10 --augmentation.camera 1 \
        --validation "$folder/held" --validation-scenes 48 "${@:3}"
}
first="$folder/first_$share""_$seed"
second="$folder/second_$share""_$seed"
train "$first" 1600 --init small "${start[@]}" --seed "$seed" --data "$folder/many=2" "$folder/wide=1" --size 120x160 --batch 16 --learning-rate 2e-3
train "$second" 1100 --init "$first/weights.safetensors" "${taught[@]}" --seed "$((seed + 1))" --data "$folder/wide=2" "$folder/many=1" \
    --size 240x320 --batch 12 --learning-rate 1.5e-3

grep -h '"validation"' "$first/log.jsonl" "$second/log.jsonl"
