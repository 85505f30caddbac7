#!/bin/sh
# The paper's Table 2, from the download of ScanNet++: prepare, train, evaluate from 2, 3 and 4 views, print. docs/reproduce.md.
#
#     scripts/table2_scannetpp.sh SCANNETPP WORK
#
# SCANNETPP holds data/ and splits/; WORK is filled. To resume, repeat the command. All scenes whose labels are public
# are trained on, but for the ten that are held out by a rule.
set -eu
[ $# -eq 2 ] || { echo "usage: $0 SCANNETPP WORK" >&2; exit 2; }
scannetpp=$1 work=$2
: "${SEMGS:=semgs}" "${EVERY:=1}" "${FORMAT:=latex}" "${VIEWS:=2 3 4}"
: "${TRAIN:=paper --init re10k.ckpt --devices 4 --workers 4 --validation-scenes 0}"
: "${EVALUATE:=}"

mkdir -p "$work"
public=$work/scannetpp-public.txt
awk 1 "$scannetpp/splits/nvs_sem_train.txt" "$scannetpp/splits/nvs_sem_val.txt" > "$public" # ends every line, as cat would not
"$SEMGS" prepare "$scannetpp/data" "$work/data/scannetpp" --scenes "all-but-ten:$public" --every "$EVERY"
# Here and below, what holds several words is meant to be split into them.
# shellcheck disable=SC2086
"$SEMGS" train $TRAIN --data "$work/data/scannetpp" --out "$work/runs/scannetpp"
# shellcheck disable=SC2086
"$SEMGS" evaluate "$work/runs/scannetpp/weights.safetensors" --data "$scannetpp/data" --scenes "ten:$public" --protocol peers \
    --views $VIEWS --name "ours" $EVALUATE --out "$work/eval/scannetpp" --overwrite
"$SEMGS" compare "$work/eval/scannetpp" --layout paper --published scannetpp --format "$FORMAT" > "$work/table2.txt"
cat "$work/table2.txt"
