#!/usr/bin/env bash
# How the semantic branch of the weights that ship was trained, on two CPU cores in three hours; SHARE=5 takes 5 % of the steps.
#
#   scripts/recipe_small.sh FOLDER ASSETS
#
# ASSETS is a folder of meshes and pictures with its lock (docs/assets.md). FOLDER gets the rooms (five CPU hours; those of an earlier call are
# kept) and two runs for each SEED; the same command goes on. Depth and colour are those of the weights that ship, to the bit. SEMGS is the
# command (semgs). At the end it prints mIoU of the input views' pixels in 24 rooms with meshes that are held out.
set -euo pipefail
folder=${1:?a folder to work in}
assets=${2:?a folder of assets}
semgs=${SEMGS:-semgs}
share=${SHARE:-100}
seed=${SEED:-51}
steps() { echo $(($1 * share / 100)); }

rooms() { $semgs rooms "$folder/$1" --scenes "$2" --frames "$3" --seed "$4" --size "$5" --assets "$assets"; }
rooms many 2210 4 14 120x160
rooms long 700 12 11 120x160
rooms wide 402 6 12 240x320
python - "$folder/held" "$assets" <<'PYTHON'
import sys
from semgs.rooms.assets.library import Library
from semgs.rooms.dataset import Recipe, write_dataset
from semgs.training.settings import VALIDATION_SEED

held, assets = sys.argv[1:]
write_dataset(held, Recipe(VALIDATION_SEED, (240, 320), 6, library=Library((assets,), "validation")), 24)
PYTHON

# What things look like, from single pictures: 76,800 of them, and 57,600 in more sizes and lights with rare classes favoured less.
train() {  # train OUT INIT STEPS OPTIONS...
    $semgs train small --supervision pictures --hold-shared --init "$2" --out "$1" --steps "$(steps "$3")" --validate-every "$(steps "$3")" \
        --size 120x160 --batch 4 --contexts 2 2 --targets 2 --average-decay 0.998 --augmentation.flip \
        --validation "$folder/held" --validation-scenes 48 "${@:4}"
}
first="$folder/first_$share""_$seed"
second="$folder/second_$share""_$seed"
train "$first" small 4800 --semantic-branch drawn --network.semantic-pyramid 128 192 192 --seed "$seed" \
    --data "$folder/many=2" "$folder/long=2" "$folder/wide=1" --learning-rate 2e-3 --augmentation.colour 0.3 --augmentation.crop 0.5 \
    --class-weights inverse_root_frequency
train "$second" "$first/weights.safetensors" 3600 --seed "$((seed + 20))" \
    --data "$folder/many=2" "$folder/long=1" "$folder/wide=1" --learning-rate 1.5e-3 --augmentation.colour 0.4 --augmentation.crop 0.4 \
    --class-weights inverse_fourth_root_frequency

grep -h '"validation"' "$first/log.jsonl" "$second/log.jsonl"
