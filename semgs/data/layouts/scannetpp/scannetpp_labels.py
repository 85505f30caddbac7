"""From the names of ScanNet++'s objects to NYU40, and from there to ScanNet's 20 classes.

ScanNet++ has no official mapping to NYU40. A name is looked up in ScanNet's `scannetv2-labels.combined.tsv` (column `raw_category`), if that
file is with the data, then in the table below. Names in neither get no label, and are reported.

The table below contains the 100 classes of ScanNet++'s benchmark and the names of ScanNet's 20. Those in `BY_SCANNET` have the class that
ScanNet's file gives them. Those in `BY_US` are not in that file, and have the class of the most similar name there.
"""

from __future__ import annotations

from collections.abc import Mapping

from semgs.data.layouts.scannet.scannet_labels import NYU40_NAMES, LabelTable, normal, scannet20_labels

BY_SCANNET = {
    "wall": ("wall", "shower wall"),
    "floor": ("floor",),
    "cabinet": ("cabinet", "kitchen cabinet"),
    "bed": ("bed",),
    "chair": ("chair", "office chair"),
    "sofa": ("sofa", "couch"),
    "table": ("table",),
    "door": ("door", "doorframe"),
    "window": ("window",),
    "bookshelf": ("bookshelf",),
    "picture": ("picture", "poster", "painting"),
    "counter": ("counter", "kitchen counter"),
    "blinds": ("blinds",),
    "desk": ("desk",),
    "shelves": ("shelf",),
    "curtain": ("curtain",),
    "pillow": ("pillow", "cushion"),
    "clothes": ("cloth",),
    "ceiling": ("ceiling",),
    "books": ("book",),
    "refrigerator": ("refrigerator",),
    "television": ("tv",),
    "paper": ("paper",),
    "towel": ("towel",),
    "shower curtain": ("shower curtain",),
    "box": ("box",),
    "whiteboard": ("whiteboard",),
    "toilet": ("toilet",),
    "sink": ("sink",),
    "lamp": ("ceiling lamp", "table lamp"),
    "bathtub": ("bathtub",),
    "bag": ("bag", "paper bag"),
    "otherstructure": ("windowsill", "board", "light switch"),
    "otherfurniture": ("heater", "trash can", "crate", "rack"),
    "otherprop": (
        "monitor", "pipe", "plant", "blanket", "computer tower", "jacket", "suitcase", "backpack", "keyboard", "printer", "microwave",
        "shoes", "bottle", "bucket", "basket", "shoe rack", "telephone", "laptop", "cup", "speaker", "clothes hanger", "kettle",
        "smoke detector", "container", "power strip", "slippers", "mouse", "cutting board", "toilet paper", "paper towel", "pot",
        "clock", "tap", "jar", "soap dispenser", "binder", "bowl", "tissue box", "whiteboard eraser", "toilet brush",
        "spray bottle", "headphones", "stapler",
    ),
}  # fmt: skip
"""Names by their NYU40 class in ScanNet's file."""

BY_US = {
    "cabinet": ("storage cabinet",),  # as file, bathroom and kitchen cabinets are
    "window": ("window frame",),  # as the doorframe is door
    "otherstructure": ("blind rail",),  # as the curtain rod is
    "otherprop": (
        "electrical duct",  # pipe
        "socket",  # power outlet
        "file folder",  # folder
        "plant pot",  # flowerpot
        "exhaust fan",  # fan
        "coat hanger",  # clothes hanger
        "air vent",  # vent
        "pan",  # cooking pan
        "marker",  # whiteboard eraser
    ),
}
"""Names that are not in ScanNet's file, by the NYU40 class of the most similar name in it."""

NYU40_OF = {
    name: NYU40_NAMES.index(nyu40) + 1
    for table in (BY_SCANNET, BY_US)
    for nyu40, names in table.items()
    for name in names
}
"""The NYU40 class of each name."""


def labels_of(
    names: Mapping[str, int], table: LabelTable | None
) -> tuple[tuple[tuple[str, int], ...], tuple[tuple[str, int], ...]]:
    """The labels in `scannet20` of a scan's object names.

    Args:
        names: of the objects, with the number of objects for each.
        table: ScanNet's; None if it is not with the data.

    Returns:
        (name, label) of each known name, 255 = a class outside the 20; and (name, number of objects) of each unknown name, most
        frequent first.
    """
    of_nyu40 = scannet20_labels()
    known, missed = [], []
    for name, count in sorted(names.items(), key=lambda item: (-item[1], item[0])):
        nyu40 = (table.by_name.get(normal(name)) if table else None) or NYU40_OF.get(normal(name))
        if nyu40 is None:
            missed.append((name, count))
        else:
            known.append((name, int(of_nyu40[nyu40])))
    return tuple(known), tuple(missed)
