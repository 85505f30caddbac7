"""The 101 classes of Replica, and which of ScanNet's 20 each is.

Each name was looked up in ScanNet's own list of raw categories (`scannetv2-labels.combined.tsv`), which gives its NYU40 class; 0 means that
ScanNet has no such category. As in ScanNet, all but the 20 classes are ignored, so rugs, blinds, cushions, shelves, stools and night stands
have no class here. Names that ScanNet spells differently are looked up in its spelling: `base-cabinet` as kitchen cabinet, `wall-cabinet` as
cabinet, `countertop` as kitchen counter, `beanbag` as beanbag chair, `plant-stand` as flower stand, `bike` as bicycle, `indoor-plant` as
plant, `wall-plug` as power outlet, and so on.
"""

from __future__ import annotations

NYU40 = {
    "backpack": 40, "base-cabinet": 3, "basket": 40, "bathtub": 36, "beam": 38, "beanbag": 39, "bed": 4, "bench": 39,
    "bike": 40, "bin": 40, "blanket": 40, "blinds": 13, "book": 23, "bottle": 40, "box": 29, "bowl": 40, "camera": 40,
    "cabinet": 3, "candle": 40, "chair": 5, "chopping-board": 40, "clock": 40, "cloth": 21, "clothing": 21, "coaster": 0,
    "comforter": 0, "computer-keyboard": 40, "cup": 40, "cushion": 18, "curtain": 16, "ceiling": 22, "cooktop": 38,
    "countertop": 12, "desk": 14, "desk-organizer": 40, "desktop-computer": 40, "door": 8, "exercise-ball": 40,
    "faucet": 40, "floor": 2, "handbag": 40, "hair-dryer": 40, "handrail": 38, "indoor-plant": 40, "knife-block": 40,
    "kitchen-utensil": 0, "lamp": 35, "laptop": 40, "major-appliance": 0, "mat": 20, "microwave": 40, "monitor": 40,
    "mouse": 40, "nightstand": 32, "pan": 40, "panel": 0, "paper-towel": 40, "phone": 40, "picture": 11, "pillar": 38,
    "pillow": 18, "pipe": 40, "plant-stand": 39, "plate": 40, "pot": 40, "rack": 39, "refrigerator": 24,
    "remote-control": 40, "scarf": 0, "sculpture": 40, "shelf": 15, "shoe": 40, "shower-stall": 38, "sink": 34,
    "small-appliance": 0, "sofa": 6, "stair": 38, "stool": 40, "switch": 40, "table": 7, "table-runner": 0, "tablet": 40,
    "tissue-paper": 40, "toilet": 33, "toothbrush": 40, "towel": 27, "tv-screen": 25, "tv-stand": 39, "umbrella": 40,
    "utensil-holder": 0, "vase": 40, "vent": 40, "wall": 1, "wall-cabinet": 3, "wall-plug": 40, "wardrobe": 39, "window": 9,
    "rug": 40, "logo": 40, "bag": 37, "set-of-clothing": 21,
}  # fmt: skip
"""The NYU40 class of each name, in the order of Replica's ids from 1; 0 for none."""

IDS = {number: name for number, name in enumerate(NYU40, start=1)}
"""The name of each id."""
