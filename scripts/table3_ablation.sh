#!/bin/sh
# The paper's Table 3, the ablation on ScanNet from 4 views: four trainings beside Table 1's, five evaluations, print. docs/reproduce.md.
#
#     scripts/table3_ablation.sh SCANNET WORK
#
# after scripts/table1_scannet.sh SCANNET WORK, whose prepared scenes it trains on, and whose run is the full method's row. To resume, repeat the command.
set -eu
[ $# -eq 2 ] || { echo "usage: $0 SCANNET WORK" >&2; exit 2; }
scannet=$1 work=$2
: "${SEMGS:=semgs}" "${PEER:=sray}" "${TEST_LIST:=scannet-$PEER-test}" "${FORMAT:=latex}" "${SEED:=0}" "${VIEWS:=4}"
: "${TRAIN:=paper --init re10k.ckpt --devices 4 --workers 4 --validation-scenes 0}"

# What holds several words is meant to be split into them.
# shellcheck disable=SC2086
"$SEMGS" ablate $TRAIN --full "$work/runs/scannet" --data "$work/data/scannet" --test "$scannet/scans" --test-scenes "$TEST_LIST" --protocol peers \
    --views "$VIEWS" --seeds "$SEED" --out "$work/ablation"
set --
for row in none shared windows camera full; do set -- "$@" "$work/ablation/seed_$SEED/$row/evaluation"; done
"$SEMGS" compare "$@" --layout paper --published ablation --format "$FORMAT" > "$work/table3.txt"
cat "$work/table3.txt"
