"""Names of common vocabularies and ScanNet's 20 classes."""

from __future__ import annotations

import pytest
import torch

from semgs.data.tables.classes import SCANNET20
from semgs.segmenters.names import IGNORED, SAME, is_ignored, meaning_of, scannet20_of


def words(text: str) -> list[str]:
    """Names; an underscore stands for a space."""
    return [word.replace("_", " ") for word in text.split()]


ADE150 = words(
    "wall building sky floor tree ceiling road bed windowpane grass cabinet sidewalk person earth door table mountain plant curtain chair car water "
    "painting sofa shelf house sea mirror rug field armchair seat fence desk rock wardrobe lamp bathtub railing cushion base box column signboard "
    "chest_of_drawers counter sand sink skyscraper fireplace refrigerator grandstand path stairs runway case pool_table pillow screen_door stairway "
    "river bridge bookcase blind coffee_table toilet flower book hill bench countertop stove palm kitchen_island computer swivel_chair boat bar "
    "arcade_machine hovel bus towel light truck tower chandelier awning streetlight booth television_receiver airplane dirt_track apparel pole land "
    "bannister escalator ottoman bottle buffet poster stage van ship fountain conveyer_belt canopy washer plaything swimming_pool stool barrel basket "
    "waterfall tent bag minibike cradle oven ball food step tank trade_name microwave pot animal bicycle lake dishwasher screen blanket sculpture hood "
    "sconce vase traffic_light tray ashcan fan pier crt_screen plate monitor bulletin_board shower radiator glass clock flag"
)
ADE31 = words(
    "wall building sky floor tree ceiling road bed window grass cabinet sidewalk person earth door table mountain plant curtain chair car water painting "
    "sofa shelf house sea mirror rug field armchair"
)
COCO = words(
    "person bicycle car motorcycle airplane bus train truck boat traffic_light fire_hydrant stop_sign parking_meter bench bird cat dog horse sheep cow "
    "elephant bear zebra giraffe backpack umbrella handbag tie suitcase frisbee skis snowboard sports_ball kite baseball_bat baseball_glove skateboard "
    "surfboard tennis_racket bottle wine_glass cup fork knife spoon bowl banana apple sandwich orange broccoli carrot hot_dog pizza donut cake chair "
    "couch potted_plant bed dining_table toilet tv laptop mouse remote keyboard cell_phone microwave oven toaster sink refrigerator book clock vase "
    "scissors teddy_bear hair_drier toothbrush banner blanket bridge cardboard counter curtain door-stuff floor-wood flower fruit gravel house light "
    "mirror-stuff net pillow platform playingfield railroad river road roof sand sea shelf snow stairs tent towel wall-brick wall-stone wall-tile "
    "wall-wood water-other window-blind window-other tree-merged fence-merged ceiling-merged sky-other-merged cabinet-merged table-merged "
    "floor-other-merged pavement-merged mountain-merged grass-merged dirt-merged paper-merged food-other-merged building-other-merged rock-merged "
    "wall-other-merged rug-merged"
)
NYU40 = words(
    "wall floor cabinet bed chair sofa table door window bookshelf picture counter blinds desk shelves curtain dresser pillow mirror floor_mat clothes "
    "ceiling books refrigerator television paper towel shower_curtain box whiteboard person night_stand toilet sink lamp bathtub bag otherstructure "
    "otherfurniture otherprop"
)


@pytest.mark.parametrize(("names", "count"), [(ADE150, 150), (ADE31, 31), (COCO, 133), (NYU40, 40)])
def test_every_name_of_a_common_vocabulary_is_mapped_or_ignored(names, count):
    assert len(names) == count
    found = scannet20_of(names)
    assert found.unknown == ()
    for row, name in enumerate(names):
        meaning = meaning_of(name)
        assert found.table[row].sum() == (0 if meaning is None else 1)
        assert (meaning is not None) != is_ignored(name), name


def test_names_mean_what_people_mean():
    for name, label in {
        "Windowpane": "window", "couch": "sofa", "door-stuff": "door", "wall-other-merged": "wall", "armchair": "chair", "kitchen_island": "counter",
        "painting;picture": "picture", "chest of drawers": "cabinet", "bookcase": "bookshelf", "stove": "otherfurniture", "rug": "floor",
    }.items():  # fmt: skip
        assert SCANNET20.names[meaning_of(name)] == label
    assert meaning_of("giraffe") is None
    assert [SAME[name].split(",")[0] for name in SCANNET20.names] == list(SCANNET20.names)
    assert not {name.strip() for name in IGNORED.split(",")} & {
        name.strip() for names in SAME.values() for name in names.split(",")
    }


def test_what_is_said_of_other_things_is_spread_evenly():
    """0.6 wall, 0.1 of each of two chairs and 0.2 ceiling: 0.2 / 20 = 0.01 goes to each class."""
    correspondence = scannet20_of(["wall", "chair", "armchair", "ceiling"])
    found = correspondence(torch.tensor([0.6, 0.1, 0.1, 0.2])[:, None, None].expand(4, 2, 3))
    assert found.shape == (20, 2, 3)
    torch.testing.assert_close(found[:, 1, 2].sum(), torch.tensor(1.0))
    assert found[SCANNET20.index("wall"), 0, 0] == pytest.approx(0.61)
    assert found[SCANNET20.index("chair"), 0, 0] == pytest.approx(0.21)
    assert found[SCANNET20.index("bed"), 0, 0] == pytest.approx(0.01)


def test_a_table_of_which_most_names_are_unknown_is_refused_with_them():
    with pytest.raises(ValueError, match=r"2 of 3 class names are unknown \(spleen, left kidney\)"):
        scannet20_of(["spleen", "left kidney", "wall"])
    assert scannet20_of(["spleen", "wall"]).unknown == ("spleen",)
