#!/bin/sh
# A table of our own: weights trained on ScanNet (Table 1), as they are, on other data. docs/reproduce.md.
#
#     scripts/table_zero_shot.sh WORK DIR [DIR ...]
#
# after scripts/table1_scannet.sh SCANNET WORK. Each DIR is a scene or a folder of scenes: ScanNet++, Replica, recordings of a robot.
# What has no labels is scored by its pictures alone.
set -eu
[ $# -ge 2 ] || { echo "usage: $0 WORK DIR [DIR ...]" >&2; exit 2; }
work=$1
shift
: "${SEMGS:=semgs}" "${FORMAT:=latex}" "${VIEWS:=2 3 4}" "${PROTOCOL:=peers}" "${EVALUATE:=}"

count=$#
for data in "$@"; do
    out=$work/eval/zero_shot/$(basename "$data")
    # What holds several words is meant to be split into them.
    # shellcheck disable=SC2086
    "$SEMGS" evaluate "$work/runs/scannet/weights.safetensors" --data "$data" --protocol "$PROTOCOL" --views $VIEWS --name "ours" \
        $EVALUATE --out "$out" --overwrite
    set -- "$@" "$out"
done
shift "$count"
"$SEMGS" compare "$@" --layout data --format "$FORMAT" > "$work/table_zero_shot.txt"
cat "$work/table_zero_shot.txt"
