#!/usr/bin/env bash
# How the semantic branch of the weights that ship was trained, on two CPU cores in two hours; SHARE=5 takes 5 % of the steps.
#
#   scripts/recipe_small.sh FOLDER ASSETS
#
# ASSETS is a folder of meshes and pictures with its lock (docs/assets.md). FOLDER gets the rooms (five CPU hours; those of an earlier call are
# kept) and a run for each SEED; the same command goes on. Depth and colour are those of the weights that ship, to the bit. SEMGS is the
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

# What things look like: single pictures, 76,800 of them.
pictures="$folder/pictures_$share""_$seed"
$semgs train small --supervision pictures --init small --semantic-branch drawn --network.semantic-pyramid 128 192 192 --out "$pictures" \
    --data "$folder/many=2" "$folder/long=2" "$folder/wide=1" --size 120x160 --batch 4 --contexts 2 2 --targets 2 --learning-rate 2e-3 \
    --average-decay 0.998 --augmentation.colour 0.3 --augmentation.crop 0.5 --augmentation.flip --class-weights inverse_root_frequency \
    --hold-shared --validation "$folder/held" --validation-scenes 48 --steps "$(steps 4800)" --validate-every "$(steps 2400)" --seed "$seed"

grep -h '"validation"' "$pictures/log.jsonl"
