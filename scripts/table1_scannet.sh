#!/bin/sh
# The paper's Table 1, from the download of ScanNet: prepare, train, evaluate from 2, 3 and 4 views, print. docs/reproduce.md.
#
#     scripts/table1_scannet.sh SCANNET WORK
#
# SCANNET holds scans/ and scannetv2-labels.combined.tsv; WORK is filled. To resume, repeat the command.
# PEER=gsnerf tests on GSNeRF's ten scenes instead of S-Ray's, and trains without their rooms.
set -eu
[ $# -eq 2 ] || { echo "usage: $0 SCANNET WORK" >&2; exit 2; }
scannet=$1 work=$2
: "${SEMGS:=semgs}" "${PEER:=sray}" "${EVERY:=4}" "${FORMAT:=latex}"
: "${TRAIN_LIST:=scannet-1000-without-$PEER}" "${TEST_LIST:=scannet-$PEER-test}" "${VIEWS:=2 3 4}"
: "${TRAIN:=paper --init re10k.ckpt --devices 4 --workers 4 --validation-scenes 0}"
: "${EVALUATE:=}"

"$SEMGS" prepare "$scannet/scans" --out "$work/data/scannet" --scenes "$TRAIN_LIST" --every "$EVERY"
# Here and below, what holds several words is meant to be split into them.
# shellcheck disable=SC2086
"$SEMGS" train $TRAIN --data "$work/data/scannet" --out "$work/runs/scannet"
# shellcheck disable=SC2086
"$SEMGS" evaluate "$work/runs/scannet/weights.safetensors" --data "$scannet/scans" --scenes "$TEST_LIST" --protocol peers \
    --views $VIEWS --name "ours" $EVALUATE --out "$work/eval/scannet" --overwrite
"$SEMGS" compare "$work/eval/scannet" --layout paper --published scannet --format "$FORMAT" > "$work/table1.txt"
cat "$work/table1.txt"
