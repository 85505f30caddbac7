#!/usr/bin/env bash
# How the included weights were trained, in homes of the first edition (docs/rooms.md) and last of the second, in about thirty-one core-hours and seven minutes of a GPU, without the rooms (docs/lab/experiments.md); SHARE=5 takes 5 % of the steps.
#
#   scripts/recipe_small.sh FOLDER ASSETS BACKBONE [TEACHER [PHOTOS]]
#
# ASSETS is a folder of meshes and images with its lock (docs/rooms.md). BACKBONE is a file of published MobileNetV2 weights, or "random", the clean
# alternative that nothing else has gone into (docs/train.md). TEACHER is a published segmentation network for scripts/teach.py, or "" for none. PHOTOS is a folder of
# labelled images (docs/train.md) for the last run, every eighth of which is kept back. FOLDER
# gets the rooms (eight CPU hours; those of an earlier call are kept), forty-seven runs for each SEED. To resume, repeat the command. START has the weights that colour
# comes from and that depth starts from (small). SEMGS is the command (semgs). At the end it prints, in 24 rooms with held-out meshes, mIoU and accuracy of single views
# and the depth error of input views.
set -euo pipefail
folder=${1:?a folder to work in}
assets=${2:?a folder of assets}
backbone=${3:?published weights of a MobileNetV2, or random}
teacher=${4-}
photos=${5-}
semgs=${SEMGS:-semgs}
share=${SHARE:-100}
seed=${SEED:-72}
start=${START:-small}
here="$(dirname "$0")"
steps() { echo $(($1 * share / 100)); }

rooms() { $semgs rooms --out "$folder/$1" --scenes "$2" --frames "$3" --seed "$4" --size "$5" --assets "$assets" "${@:6}"; }
teach() { if [ -n "$teacher" ]; then python "$here/teach.py" "$teacher" "$folder/teacher" "$@"; fi; }  # SCENES [SCENES ...]
average() { python "$here/average_weights.py" "$@"; }
rooms many 1000 4 2200 120x160
rooms wide 500 3 2300 240x320
rooms more 211 3 2301 240x320
rooms long 120 8 2401 240x320
python - "$folder/held" "$assets" <<'PYTHON'
import sys
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.sets.dataset import RoomSettings, write_dataset
from semgs.training.data.data_settings import VALIDATION_SEED

held, assets = sys.argv[1:]
write_dataset(held, RoomSettings(VALIDATION_SEED, (240, 320), 6, library=Library((assets,), "validation")), 24)
PYTHON
taught=()
teach "$folder/wide"
if [ -n "$teacher" ]; then taught=(--teacher "$folder/teacher"); fi
backbone_given=()
if [ "$backbone" != random ]; then backbone_given+=(--backbone "$backbone"); fi

# What things look like, from single images: 25,600 small ones, then 13,200 of the size that they are used at.
train() {  # train OUT STEPS OPTIONS...
    $semgs train small --supervision pictures --out "$1" --steps "$(steps "$2")" --validate-every "$(steps "$2")" \
        --clip 2 --average-decay 0.998 --class-weights inverse_fourth_root_frequency --augmentation.crop 0.4 --augmentation.flip \
        --augmentation.colour 0.5 --augmentation.roll 10 --augmentation.camera 1 \
        --validation "$folder/held" --validation-scenes 48 "${@:3}"
}
first="$folder/first_$share""_$seed"
second="$folder/second_$share""_$seed"
train "$first" 1600 --init "$start" "${backbone_given[@]}" --seed "$seed" --data "$folder/many=2" "$folder/wide=1" --size 120x160 --batch 16 --learning-rate 2e-3
train "$second" 1100 --init "$first/weights.safetensors" "${taught[@]}" --seed "$((seed + 1))" --data "$folder/wide=2" "$folder/many=1" \
    --size 240x320 --batch 12 --learning-rate 1.5e-3

# How far things are, from pairs of images: 6,400 small ones, then 1,440 and 1,920 of the size that they are used at; then from two to four views. The classes no longer change.
deepen() {  # deepen OUT STEPS OPTIONS...
    $semgs train small --supervision depth --targets 1 --out "$1" --steps "$(steps "$2")" \
        --validate-every "$(steps "$2")" --validation "$folder/held" --validation-scenes 24 --augmentation.flip --augmentation.colour 0.3 "${@:3}"
}
third="$folder/third_$share""_$seed"
fourth="$folder/fourth_$share""_$seed"
fifth="$folder/fifth_$share""_$seed"
sixth="$folder/sixth_$share""_$seed"
pairs=(--contexts 2 2 --batch 4 --learning-rate 5e-4)
deepen "$third" 1600 "${pairs[@]}" --init "$second/weights.safetensors" --seed "$((seed - 1))" \
    --data "$folder/many=2" "$folder/wide=1" --size 120x160 --average-decay 0.995 --augmentation.crop 0.5 --augmentation.camera 0.5
deepen "$fourth" 360 "${pairs[@]}" --init "$third/weights.safetensors" --seed "$seed" --data "$folder/wide" "$folder/long" --size 240x320 \
    --average-decay 0.99 --augmentation.crop 0.6 --augmentation.camera 0.5
deepen "$fifth" 480 "${pairs[@]}" --init "$fourth/weights.safetensors" --seed "$((seed + 4))" --data "$folder/wide=2" "$folder/more=1" "$folder/long=1" --size 240x320 \
    --average-decay 0.99 --augmentation.crop 0.7 --augmentation.camera 0.3
deepen "$sixth" 130 --contexts 2 4 --batch 3 --learning-rate 4e-4 --init "$fifth/weights.safetensors" --seed "$((seed + 5))" --data "$folder/long" \
    --size 240x320 --average-decay 0.97 --augmentation.crop 0.7 --augmentation.camera 0.3

# Colour, opacity and the refinement of depth adapt to that depth: rendered views of consecutive frames.
colour() {  # colour OUT STEPS OPTIONS...
    $semgs train small --out "$1" --steps "$(steps "$2")" --size 240x320 --batch 2 --contexts 2 4 --targets 2 --frames consecutive \
        --learning-rate 5e-4 --average-decay 0.98 --sweep-rate 0 --class-rate 0 --losses.semantic 0 --losses.smoothness 0 --depth-weight 0.3 \
        --augmentation.flip --augmentation.colour 0.2 --validation "$folder/held" --validation-scenes 12 --validate-every "$(steps 160)" "${@:3}"
}
seventh="$folder/seventh_$share""_$seed"
colour "$seventh" 480 --init "$sixth/weights.safetensors" --seed "$((seed + 19))" --data "$folder/long"

# The classes learn on, from rooms that they have not seen: version 9.
rooms new 1300 3 2302 240x320
teach "$folder/new"
eighth="$folder/eighth_$share""_$seed"
train "$eighth" 2600 --init "$seventh/weights.safetensors" "${taught[@]}" --seed "$((seed + 23))" --data "$folder/new" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3

# And from 1,200 rooms of the second edition: version 10.
rooms homes 1200 3 2303 240x320
teach "$folder/homes"
ninth="$folder/ninth_$share""_$seed"
train "$ninth" 2400 --init "$eighth/weights.safetensors" "${taught[@]}" --seed "$((seed + 29))" --data "$folder/homes" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3

# And from 1,600 more. The mean of the last three runs, the last of which counts twice, is version 11.
rooms others 1600 3 2304 240x320
teach "$folder/others"
tenth="$folder/tenth_$share""_$seed"
train "$tenth" 3000 --init "$ninth/weights.safetensors" "${taught[@]}" --seed "$((seed + 33))" --data "$folder/others=2" "$folder/homes=1" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3
mean="$folder/mean_$share""_$seed.safetensors"
average "$mean" \
    "$eighth/weights.safetensors" "$ninth/weights.safetensors" "$tenth/weights.safetensors" "$tenth/weights.safetensors"

# Depth and then colour learn from rooms of the second edition too, and input views agree on classes: version 12.
rooms walks 200 8 2403 240x320
eleventh="$folder/eleventh_$share""_$seed"
deeper=(--contexts 2 4 --learning-rate 4e-4 --size 240x320 --average-decay 0.98 --augmentation.crop 0.6 --augmentation.camera 0.3)
deepen "$eleventh" 900 "${deeper[@]}" --batch 3 --init "$mean" --seed "$((seed + 35))" --data "$folder/walks"
twelfth="$folder/twelfth_$share""_$seed"
colour "$twelfth" 720 --init "$eleventh/weights.safetensors" --seed "$((seed + 37))" --data "$folder/walks"

# Depth learns on twice, each time from new rooms, then colour. The mean with version 12 is version 13.
rooms strolls 250 8 2404 240x320
rooms rambles 240 8 2405 240x320
thirteenth="$folder/thirteenth_$share""_$seed"
deepen "$thirteenth" 700 "${deeper[@]}" --batch 4 --init "$twelfth/weights.safetensors" --seed "$((seed + 41))" --data "$folder/strolls"
fourteenth="$folder/fourteenth_$share""_$seed"
deepen "$fourteenth" 480 "${deeper[@]}" --batch 4 --init "$thirteenth/weights.safetensors" --seed "$((seed + 47))" --data "$folder/rambles=2" "$folder/strolls=1"
fifteenth="$folder/fifteenth_$share""_$seed"
colour "$fifteenth" 600 --init "$fourteenth/weights.safetensors" --seed "$((seed + 51))" --data "$folder/strolls" "$folder/rambles"
version13="$folder/version_13_$share""_$seed.safetensors"
average "$version13" "$twelfth/weights.safetensors" "$fifteenth/weights.safetensors"

# Classes learn on from version 12, then from new rooms with furniture made for them.
rooms inns 1200 3 2305 240x320
PYTHONPATH="$here/.." python -m semgs_rooms.furniture --out "$folder/furniture" --pieces 144 --seed 41
rooms hotels 1600 3 2306 240x320 --assets "$folder/furniture"
teach "$folder/inns" "$folder/hotels"
sixteenth="$folder/sixteenth_$share""_$seed"
train "$sixteenth" 2000 --init "$twelfth/weights.safetensors" "${taught[@]}" --seed "$((seed + 43))" --data "$folder/inns" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3
seventeenth="$folder/seventeenth_$share""_$seed"
train "$seventeenth" 3000 --init "$sixteenth/weights.safetensors" "${taught[@]}" --seed "$((seed + 55))" --data "$folder/hotels=2" "$folder/inns=1" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3

# At the same time, depth learns on from other new rooms, then colour.
rooms hikes 400 8 2406 240x320
eighteenth="$folder/eighteenth_$share""_$seed"
deepen "$eighteenth" 800 "${deeper[@]}" --augmentation.camera 0.5 --batch 4 --init "$fifteenth/weights.safetensors" --seed "$((seed + 53))" \
    --data "$folder/hikes=2" "$folder/rambles=1" "$folder/strolls=1"
nineteenth="$folder/nineteenth_$share""_$seed"
colour "$nineteenth" 500 --init "$eighteenth/weights.safetensors" --seed "$((seed + 57))" --data "$folder/hikes" "$folder/strolls" "$folder/rambles"

# Put together, depth learns on with the new classes. The mean with version 13, which gets the new classes too, is version 14.
averaged="$folder/averaged_$share""_$seed.safetensors"
average "$averaged" "$twelfth/weights.safetensors" "$seventeenth/weights.safetensors"
both="$folder/both_$share""_$seed.safetensors"
average --start "$twelfth/weights.safetensors" "$both" "$averaged" "$nineteenth/weights.safetensors"
twentieth="$folder/twentieth_$share""_$seed"
deepen "$twentieth" 300 "${deeper[@]}" --learning-rate 2e-4 --batch 4 --init "$both" --seed "$((seed + 61))" --data "$folder/hikes" "$folder/rambles" "$folder/strolls"
with_classes="$folder/with_classes_$share""_$seed.safetensors"
average --start "$twelfth/weights.safetensors" "$with_classes" "$averaged" "$version13"
average "$folder/version_14_$share""_$seed.safetensors" "$with_classes" "$twentieth/weights.safetensors"

# Depth learns on from frames that lie beside each other in a walk, as in evaluation: version 15.
rooms treks 400 8 2407 240x320
twentyfirst="$folder/twentyfirst_$share""_$seed"
deepen "$twentyfirst" 800 "${deeper[@]}" --learning-rate 3e-4 --frames consecutive --augmentation.exposure 0.15 --batch 4 \
    --init "$folder/version_14_$share""_$seed.safetensors" --seed "$((seed + 63))" --data "$folder/treks=2" "$folder/hikes=1" "$folder/rambles=1" "$folder/strolls=1"

# Classes learn on in two more sets of new rooms, each with furniture of its own.
PYTHONPATH="$here/.." python -m semgs_rooms.furniture --out "$folder/furniture_2" --pieces 144 --seed 42
PYTHONPATH="$here/.." python -m semgs_rooms.furniture --out "$folder/furniture_3" --pieces 200 --seed 43
rooms hostels 1600 3 2307 240x320 --assets "$folder/furniture_2"
rooms lodges 1600 3 2308 240x320 --assets "$folder/furniture_3"
teach "$folder/hostels" "$folder/lodges"
twentysecond="$folder/twentysecond_$share""_$seed"
train "$twentysecond" 4000 --init "$seventeenth/weights.safetensors" "${taught[@]}" --seed "$((seed + 59))" --data "$folder/hostels=2" "$folder/hotels=1" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3
twentythird="$folder/twentythird_$share""_$seed"
train "$twentythird" 3600 --init "$twentysecond/weights.safetensors" "${taught[@]}" --seed "$((seed + 65))" --data "$folder/lodges=2" "$folder/hostels=1" --size 240x320 --half-size 0.35 --batch 16 --learning-rate 1.2e-3

# At the same time, depth learns on twice from frames beside each other, whose exposure differs more.
rooms tours 500 8 2408 240x320 --assets "$folder/furniture_2"
rooms outings 400 8 2409 240x320 --assets "$folder/furniture_3"
beside=("${deeper[@]}" --half-size 0.3 --learning-rate 3e-4 --frames consecutive --augmentation.exposure 0.3 --batch 4)
twentyfourth="$folder/twentyfourth_$share""_$seed"
deepen "$twentyfourth" 1000 "${beside[@]}" --init "$twentyfirst/weights.safetensors" --seed "$((seed + 69))" --data "$folder/tours=2" "$folder/treks=1" "$folder/hikes=1"
twentyfifth="$folder/twentyfifth_$share""_$seed"
deepen "$twentyfifth" 1300 "${beside[@]}" --init "$twentyfourth/weights.safetensors" --seed "$((seed + 71))" --data "$folder/outings=2" "$folder/tours=1" "$folder/treks=1"

# Both put together, with the classes' mean with version 12: version 16.
newest="$folder/newest_$share""_$seed.safetensors"
average "$newest" "$twelfth/weights.safetensors" "$twentythird/weights.safetensors"
average --start "$averaged" "$folder/version_16_$share""_$seed.safetensors" "$newest" "$twentyfifth/weights.safetensors"

# Labelled photos of real rooms beside new rooms. The mean with version 16: version 17, for which 283 of these steps were taken.
if [ -n "$photos" ]; then
    rooms cabins 344 3 2310 240x320
    python - "$photos" "$folder/photos" <<'PYTHON'
import json
import sys
from pathlib import Path

source, target = map(Path, sys.argv[1:])
doubtful = "030 042 206 208 214 240 252 257 268 361 364 420 430 444 448 452".split()
table = json.loads((source / "classes.json").read_text())
table["terms"] = "photos under CC BY 2.0, CC BY-SA 2.0, CC0 or in the public domain (NOTICE names them), labels CC0"
for entry in table["classes"]:
    if entry["name"] == "nightstand":
        entry["scannet20"] = "cabinet"  # as in rooms
for index, image in enumerate(sorted((source / "images").iterdir())):
    kept_back = index % 8 == 0
    if kept_back or image.stem not in doubtful:
        for file in (image, source / "labels" / f"{image.stem}.png"):
            copy = target / ("kept_back" if kept_back else "learned") / file.parent.name / file.name
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
for part in ("kept_back", "learned"):
    (target / part / "classes.json").write_text(json.dumps(table))
PYTHON
    twentysixth="$folder/twentysixth_$share""_$seed"
    train "$twentysixth" 600 --init "$folder/version_16_$share""_$seed.safetensors" --seed "$((seed + 131))" --data "$folder/cabins=3" "$folder/photos/learned=2" \
        --size 176x224 --batch 12 --learning-rate 6e-4 --backbone-rate 0.25 --average-decay 0.99 --augmentation.colour 0.4 --augmentation.roll 8 \
        --validation "$folder/photos/kept_back" --validation-scenes 50
    version17="$folder/version_17_$share""_$seed.safetensors"
    average "$version17" "$folder/version_16_$share""_$seed.safetensors" "$twentysixth/weights.safetensors"

    # Classes learn on from photos and more rooms; the mean of the three is where version 18 starts.
    rooms cabins 400 3 2310 240x320
    rooms lofts 500 3 2311 240x320
    rooms flats 519 3 2312 240x320
    slower=(--batch 12 --size 176x224 --learning-rate 3e-4 --backbone-rate 0.3 --average-decay 0.995 --augmentation.colour 0.4 --augmentation.roll 8
        --validation "$folder/photos/kept_back" --validation-scenes 50)
    twentyseventh="$folder/twentyseventh_$share""_$seed"
    twentyeighth="$folder/twentyeighth_$share""_$seed"
    train "$twentyseventh" 1400 --init "$version17" --seed "$((seed + 229))" --data "$folder/cabins=2" "$folder/photos/learned=1" "${slower[@]}"
    train "$twentyeighth" 1400 --init "$twentyseventh/weights.safetensors" --seed "$((seed + 230))" \
        --data "$folder/lofts=1" "$folder/flats=1" "$folder/photos/learned=1" "${slower[@]}"
    thirds="$folder/thirds_$share""_$seed.safetensors"
    average "$thirds" "$version17" "$twentyseventh/weights.safetensors" "$twentyeighth/weights.safetensors"

    # Depth is upsampled by weights that the network predicts, and the heads learn on it. The runs for version 18 computed what is frozen once (docs/lab/experiments.md).
    twentyninth="$folder/twentyninth_$share""_$seed"
    thirtieth="$folder/thirtieth_$share""_$seed"
    deepen "$twentyninth" 1500 --contexts 2 2 --batch 2 --init "$thirds" --seed 5 --data "$folder/cabins" --size 240x320 --frames consecutive --learning-rate 2e-3 \
        --average-decay 0.99 --sweep-rate 0 --depth-losses.log 0 --depth-losses.gradients 0 --depth-losses.distribution 0 --depth-losses.sharp 1
    colour "$thirtieth" 300 --init "$twentyninth/weights.safetensors" --seed 3 --data "$folder/lofts" --contexts 2 2 --targets 1 --batch 1 --upsampling-rate 0 --learning-rate 3e-4

    # Classes once more with a teacher that saw the photos, and classes, depth and colour on a GPU. The mean of the classes with that depth and colour: version 18.
    teach "$folder/lofts" "$folder/flats" "$folder/photos/learned"
    thirtyfirst="$folder/thirtyfirst_$share""_$seed"
    train "$thirtyfirst" 1400 --init "$thirtieth/weights.safetensors" "${taught[@]}" --teacher-weight 0.5 --seed "$((seed + 433))" \
        --data "$folder/lofts=1" "$folder/flats=1" "$folder/photos/learned=1.3" "${slower[@]}" --learning-rate 5e-4 --shared-rate 0
    mkdir -p "$folder/rooms_gpu"
    for room in "$folder/flats"/scene_* $(printf "$folder/lofts/scene_%05d " {0..154}); do
        ln -sfn "$room" "$folder/rooms_gpu/$(basename "$(dirname "$room")")_$(basename "$room")"
    done
    START="$thirtieth/weights.safetensors" "$here/gpu_day.sh" "$folder/gpu_$share""_$seed" "$folder/rooms_gpu" "$folder/photos/learned"
    classes="$folder/classes_$share""_$seed.safetensors"
    average "$classes" "$thirtieth/weights.safetensors" "$folder/gpu_$share""_$seed/classes/weights.safetensors" "$thirtyfirst/weights.safetensors"
    average --start "$thirtieth/weights.safetensors" "$folder/version_18_$share""_$seed.safetensors" "$classes" "$folder/gpu_$share""_$seed/colour/weights.safetensors"

    # Depth and colour learn on together, from crops of the first 460 lofts: version 19.
    thirtysecond="$folder/thirtysecond_$share""_$seed"
    printf 'scene_%05d\n' {0..459} > "$folder/first_lofts"
    colour "$thirtysecond" 800 --init "$folder/version_18_$share""_$seed.safetensors" --seed "$((seed + 629))" --data "$folder/lofts" --scenes "$folder/first_lofts" \
        --size 176x224 --contexts 2 2 --targets 1 --batch 4 --learning-rate 4e-4 --average-decay 0.99 --sweep-rate 0.25 --augmentation.crop 0.6

    # Classes once more, now with a backbone that learns (version 20 saw only the first 460 lofts), beside depth and colour in new homes. A third of the first and
    # all of the second, without the class weights: version 20.
    rooms attics 501 3 2313 240x320
    thirtythird="$folder/thirtythird_$share""_$seed"
    thirtyfourth="$folder/thirtyfourth_$share""_$seed"
    version19="$thirtysecond/weights.safetensors"
    train "$thirtythird" 1200 --init "$version19" "${taught[@]}" --teacher-weight 0.5 --seed "$((seed + 637))" \
        --data "$folder/lofts=2" "$folder/photos/learned=1.5" "${slower[@]}" --learning-rate 5e-4 --shared-rate 1
    colour "$thirtyfourth" 600 --init "$version19" --seed "$((seed + 639))" --data "$folder/attics" \
        --size 176x224 --contexts 2 2 --targets 1 --batch 4 --learning-rate 4e-4 --average-decay 0.99 --sweep-rate 0.25 --augmentation.crop 0.6
    mixed="$folder/mixed_$share""_$seed.safetensors"
    average "$mixed" "$version19" "$version19" "$thirtythird/weights.safetensors"
    undone="$folder/undone_$share""_$seed.safetensors"
    python "$here/undo_class_weights.py" "$mixed" "$thirtythird" "$undone"
    version20="$folder/version_20_$share""_$seed.safetensors"
    average --start "$version19" "$version20" "$undone" "$thirtyfourth/weights.safetensors"

    # Classes learn on in more homes, the last two sets with furniture made for them. Five runs, the last from the mean of the others with version 19, which counts as
    # much as they do together (version 21 saw only the first 460 lofts).
    PYTHONPATH="$here/.." python -m semgs_rooms.furniture --out "$folder/furniture_4" --pieces 139 --seed 44
    rooms barns 200 3 2314 240x320
    rooms villas 400 3 2315 240x320 --assets "$folder/furniture_4"
    rooms manors 379 3 2316 240x320 --assets "$folder/furniture_4"
    teach "$folder/barns" "$folder/villas" "$folder/manors"
    faster=("${taught[@]}" --teacher-weight 0.5 "${slower[@]}" --learning-rate 5e-4 --shared-rate 1)
    thirtyfifth="$folder/thirtyfifth_$share""_$seed"
    thirtysixth="$folder/thirtysixth_$share""_$seed"
    thirtyseventh="$folder/thirtyseventh_$share""_$seed"
    thirtyeighth="$folder/thirtyeighth_$share""_$seed"
    thirtyninth="$folder/thirtyninth_$share""_$seed"
    train "$thirtyfifth" 1600 --init "$thirtythird/weights.safetensors" "${faster[@]}" --seed "$((seed + 643))" \
        --data "$folder/lofts=1" "$folder/barns=1.5" "$folder/photos/learned=1.2" --backbone-rate 1
    train "$thirtysixth" 1800 --init "$thirtythird/weights.safetensors" "${faster[@]}" --seed "$((seed + 649))" \
        --data "$folder/lofts=1" "$folder/barns=1.5" "$folder/photos/learned=1.2"
    train "$thirtyseventh" 1800 --init "$thirtysixth/weights.safetensors" "${faster[@]}" --seed "$((seed + 650))" \
        --data "$folder/villas=2" "$folder/lofts=0.5" "$folder/barns=0.5" "$folder/photos/learned=1"
    train "$thirtyeighth" 1800 --init "$thirtyseventh/weights.safetensors" "${faster[@]}" --seed "$((seed + 652))" \
        --data "$folder/manors=2" "$folder/villas=1" "$folder/lofts=0.5" "$folder/barns=0.5" "$folder/photos/learned=1.5"
    middle="$folder/middle_$share""_$seed.safetensors"
    average "$middle" "$version19" "$version19" "$version19" "$version19" \
        "$thirtyfifth/weights.safetensors" "$thirtysixth/weights.safetensors" "$thirtyseventh/weights.safetensors" "$thirtyeighth/weights.safetensors"
    train "$thirtyninth" 1800 --init "$middle" "${faster[@]}" --seed "$((seed + 653))" --learning-rate 3e-4 \
        --data "$folder/manors=1" "$folder/villas=1" "$folder/lofts=1" "$folder/barns=1" "$folder/photos/learned=1.3"

    # Depth and colour learn on twice. Their mean with version 20, and that of version 19 and the last two runs of classes, without the class weights: version 21.
    fortieth="$folder/fortieth_$share""_$seed"
    fortyfirst="$folder/fortyfirst_$share""_$seed"
    crops=(--size 176x224 --contexts 2 2 --targets 1 --batch 4 --learning-rate 4e-4 --average-decay 0.99 --sweep-rate 0.25 --augmentation.crop 0.6)
    colour "$fortieth" 600 --init "$version20" --seed "$((seed + 645))" --data "$folder/barns" "${crops[@]}"
    colour "$fortyfirst" 600 --init "$fortieth/weights.safetensors" --seed "$((seed + 646))" --data "$folder/villas" "${crops[@]}"
    depths="$folder/depths_$share""_$seed.safetensors"
    average "$depths" "$version20" "$fortieth/weights.safetensors" "$fortyfirst/weights.safetensors"
    newest="$folder/newest_classes_$share""_$seed.safetensors"
    average "$newest" "$version19" "$thirtyeighth/weights.safetensors" "$thirtyninth/weights.safetensors"
    newest_undone="$folder/newest_undone_$share""_$seed.safetensors"
    python "$here/undo_class_weights.py" "$newest" "$thirtyninth" "$newest_undone"
    version21="$folder/version_21_$share""_$seed.safetensors"
    average --start "$undone" "$version21" "$newest_undone" "$depths"

    # Classes learn on from their mean, and depth and colour from version 21, in more homes (depth and colour saw only the first 390 palaces). Classes of the runs 38 and 42
    # count twice and three times as much as those of version 19; depth and colour are the mean with version 21: version 22.
    rooms palaces 500 3 2317 240x320 --assets "$folder/furniture_4"
    rooms castles 600 3 2318 240x320 --assets "$folder/furniture_4"
    teach "$folder/palaces" "$folder/castles"
    fortysecond="$folder/fortysecond_$share""_$seed"
    fortythird="$folder/fortythird_$share""_$seed"
    train "$fortysecond" 2400 --init "$newest" "${faster[@]}" --seed "$((seed + 654))" --learning-rate 4e-4 \
        --data "$folder/palaces=1.5" "$folder/castles=1.5" "$folder/manors=1" "$folder/villas=0.5" "$folder/lofts=0.5" "$folder/barns=0.5" "$folder/photos/learned=2"
    colour "$fortythird" 800 --init "$version21" --seed "$((seed + 655))" --data "$folder/manors=1" "$folder/palaces=1" "${crops[@]}"
    last="$folder/last_classes_$share""_$seed.safetensors"
    average "$last" "$version19" "$thirtyeighth/weights.safetensors" "$thirtyeighth/weights.safetensors" \
        "$fortysecond/weights.safetensors" "$fortysecond/weights.safetensors" "$fortysecond/weights.safetensors"
    python "$here/undo_class_weights.py" "$last" "$fortysecond" "$folder/last_undone_$share""_$seed.safetensors"
    average "$folder/last_depths_$share""_$seed.safetensors" "$version21" "$fortythird/weights.safetensors"
    average --start "$newest_undone" "$folder/version_22_$share""_$seed.safetensors" "$folder/last_undone_$share""_$seed.safetensors" "$folder/last_depths_$share""_$seed.safetensors"

    # Depth and colour learn on in longer steps, from frames that share enough of what they see wherever they stand, and nearer to surfaces. With the mean of this and version 22: version 23.
    rooms mansions 300 8 2321 240x320 --assets "$folder/furniture_4"
    rooms nooks 150 8 2322 240x320 --assets "$folder/furniture_4" --style closeup
    fortyfourth="$folder/fortyfourth_$share""_$seed"
    colour "$fortyfourth" 800 --init "$folder/last_depths_$share""_$seed.safetensors" --seed "$((seed + 661))" \
        --data "$folder/mansions=2" "$folder/nooks=1" "$folder/castles=1" "${crops[@]}" --frames covisible
    average "$folder/far_depths_$share""_$seed.safetensors" "$folder/last_depths_$share""_$seed.safetensors" "$fortyfourth/weights.safetensors"
    average --start "$newest_undone" "$folder/version_23_$share""_$seed.safetensors" "$folder/last_undone_$share""_$seed.safetensors" "$folder/far_depths_$share""_$seed.safetensors"
fi

for run in "$first" "$second" "$third" "$fourth" "$fifth" "$sixth" "$seventh" "$eighth" "$ninth" "$tenth" "$eleventh" "$twelfth" "$thirteenth" "$fourteenth" "$fifteenth" "$sixteenth" "$seventeenth" "$eighteenth" "$nineteenth" "$twentieth" "$twentyfirst" "$twentysecond" "$twentythird" "$twentyfourth" "$twentyfifth"; do grep -h '"validation"' "$run/log.jsonl"; done
