"""Replace pieces of furniture with meshes of their kind, scaled to the same footprint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from semgs.data.tables.classes import IGNORE
from semgs_rooms.assets.asset_library import Library, Panel
from semgs_rooms.assets.catalogue import MeshEntry
from semgs_rooms.assets.coverings import Coverings
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.solids import SHELL, Piece, Shell, Solid, Triple


@dataclass(frozen=True)
class Rule:
    """Which meshes may replace a piece, and how much they may be scaled.

    Attributes:
        label: class of the meshes.
        subtypes: their subtypes; empty for any.
        low, high: bounds of the overall scale.
        stretch: maximum ratio between the scales of two axes.
        fill: minimum share of the piece's width that the mesh must fill.
        centred: the mesh is centred in depth; others have their back to the wall.
        hung: the mesh fills the piece's width and height; `stretch` is then the ratio of these two scales.
        share: how many of these pieces are replaced, relative to other pieces.
        whole: the entire mesh has its class, regardless of the classes of its parts.
    """

    label: str
    subtypes: tuple[str, ...] = ()
    low: float = 0.85
    high: float = 1.15
    stretch: float = 1.1
    fill: float = 0.72
    centred: bool = False
    hung: bool = False
    share: float = 1.0
    whole: bool = False


CABINETS = ("cabinet", "dresser", "sideboard", "wardrobe", "vitrine", "tv_stand")
OTHER = ("bench", "tv_stand", "trash_can", "washing_machine", "ottoman", "dryer", "storage_trunk")
RULES = {
    "bed": Rule("bed", ("bed",), low=0.8),
    "sofa": Rule("sofa", low=0.8),
    "armchair": Rule("chair", ("armchair", "rocking_chair"), low=0.75),
    "chair": Rule("chair", ("chair", "office_chair"), low=0.8, centred=True),
    "table": Rule("table", ("dining_table",), low=0.7, stretch=1.2, centred=True),
    "coffee table": Rule("table", ("coffee_table",), low=0.7, stretch=1.2, centred=True),
    "side table": Rule("table", ("side_table",), low=0.75, centred=True),
    "desk": Rule("desk", low=0.75, stretch=1.2),
    "cabinet": Rule("cabinet", CABINETS, low=0.75, stretch=1.2),
    "nightstand": Rule("cabinet", ("nightstand",), low=0.75),
    "bookshelf": Rule("bookshelf", low=0.75, stretch=1.2),
    "island": Rule("counter", ("counter", "kitchen_base_cabinet"), low=0.7, stretch=1.2, centred=True, whole=True),
    "counter": Rule("counter", ("kitchen_base_cabinet",), low=0.85, stretch=1.25),
    "washbasin": Rule("sink", low=0.75, high=1.1),
    "refrigerator": Rule("refrigerator", low=0.8, stretch=1.15),
    "toilet": Rule("toilet", low=0.85),
    "bathtub": Rule("bathtub", low=0.85, stretch=1.15),
    "other": Rule("otherfurniture", OTHER, low=0.75, fill=0.5),
    "stove": Rule("otherfurniture", ("stove",), low=0.75),
    "door": Rule("door", low=0.8, high=1.25, stretch=1.3, hung=True),
    "window": Rule("window", low=0.5, high=2.0, stretch=1.8, hung=True),
    "curtain": Rule("curtain", ("curtain",)),
    "shower curtain": Rule("shower curtain", low=0.4, high=1.6, stretch=3.0, hung=True),
    "picture": Rule("picture", low=0.5, high=2.0, stretch=1.3, hung=True, share=0.4),
    "clutter": Rule("clutter", low=0.8, high=1.3, stretch=1.0, fill=0.45, centred=True),
}
"""By name of the piece. Curtains always fit, as cloth may be gathered."""

SUNK = 0.03
"""Depth of door frames inside the wall [m]."""
SURFACED = ("table", "coffee table", "side table", "desk", "cabinet", "nightstand", "island", "counter", "bookshelf")
"""Pieces with a flat top for small things."""
TOP_BAND = 0.03
"""Triangles that face up belong to the top if they are within this of the highest point [m]."""
TOP_SHARE = 0.6
"""Minimum share of the footprint that a top covers."""
DEPTHS = {"window": 0.065, "curtain": 0.11, "shower curtain": 0.1, "picture": 0.03}
"""Depth of meshes on walls [m]; curtains hang in front of window frames."""
HIGHEST = 1.12
"""Maximum height of a mesh, relative to the piece."""
FLOOR_CLUTTER = ("planter", "plant", "box", "storage_box", "crate", "lamp", "speaker")
GREENS = ("leaf", "leaves", "green", "plant", "grass", "cactus")
WOODS = ("wood", "walnut", "oak", "birch", "carcass", "plank", "trunk", "top", "front", "frame", "leg")
METALS = (
    "metal", "steel", "chrome", "tap", "faucet", "handle", "knob", "drain", "rod", "ring", "finial", "pull", "lever", "gold",
)  # fmt: skip
CLOTHS = (
    "carpet", "fabric", "cushion", "pillow", "couch", "mattress", "sheet", "blanket", "bed", "curtain", "cloth", "seat", "sofa",
)  # fmt: skip
WARES = ("basin", "ceramic", "porcelain", "sink", "bowl", "vessel", "tub")


class Swaps:
    """Meshes for the pieces of one room. Equal pieces get the same mesh.

    Args:
        rng: source of all random choices.
        library: of the meshes.
        coverings: images for surfaces without texture.
        share: how many pieces are replaced, of those for which there is a mesh.
    """

    def __init__(self, rng: np.random.Generator, library: Library, coverings: Coverings, share: float = 0.75) -> None:
        self.rng, self.library, self.coverings, self.share = rng, library, coverings, share
        self._made: dict[tuple[str, Triple, bytes], Piece] = {}

    def __call__(self, piece: Piece) -> Piece:
        """The mesh that replaces a piece, with the same name and footprint, or the piece itself, for example if it is a mesh already.

        A picture keeps its own art in the new frame.
        """
        if piece.parts[0].shape == SHELL:
            return piece
        key = piece.name, piece.size, piece.parts[0].material.tobytes()
        if key not in self._made:
            self._made[key] = self._exchange(piece)
        made = self._made[key]
        if piece.name != "picture":
            return made
        return replace(made, parts=(*made.parts[:-1], replace(made.parts[-1], material=piece.parts[-1].material)))

    def _exchange(self, piece: Piece) -> Piece:
        rule = RULES.get(piece.name)
        if rule is None or self.rng.random() >= self.share * rule.share:
            return piece
        low, high = _bounds(piece)
        box = np.array([piece.size[0], piece.size[1], high - low])
        scales = [(entry, fit_scale(entry, box, rule)) for entry in self._candidates(rule)]
        fitting = [(entry, scale) for entry, scale in scales if scale is not None]
        if not fitting:
            return piece
        entry, scale = fitting[int(self.rng.integers(len(fitting)))]
        depth = entry.extents[1] * scale[1]
        y = box[1] / 2 if rule.centred else depth / 2
        y = {"door": depth / 2 - SUNK, "window": 0.0}.get(piece.name, y)
        foot = np.array([box[0] / 2, y, low])
        panels = self.library.panels(entry)
        if rule.label == "curtain":
            scale, foot = _drape(panels, box, foot)
        self.coverings.used.add_file(entry.file)
        if rule.whole:
            panels = tuple(replace(panel, label=None) for panel in panels)
        parts = self._parts(panels, entry, scale, foot)
        parts = _frame_art(parts, piece) if rule.label == "picture" else parts + _kept_parts(piece)
        surface = _surface(panels, entry, scale) if piece.name in SURFACED else None
        return Piece(piece.name, piece.size, tuple(parts), surface)

    def _candidates(self, rule: Rule) -> list[MeshEntry]:
        rows = [entry for entry in self.library.meshes if entry.label == rule.label]
        if rule.label == "clutter":
            return [entry for entry in rows if entry.mount == "surface" or entry.subtype in FLOOR_CLUTTER]
        if rule.label == "picture":
            return [entry for entry in rows if entry.mount == "wall"]
        return [entry for entry in rows if not rule.subtypes or entry.subtype in rule.subtypes]

    def _parts(
        self, panels: tuple[Panel, ...], entry: MeshEntry, scale: Float64[np.ndarray, " 3"], foot: np.ndarray
    ) -> list[Solid]:
        own = LABEL.get(entry.label, IGNORE)
        tint = np.clip(self.rng.normal(1.0, 0.06, 3) * self.rng.uniform(0.8, 1.15), 0.5, 1.3)
        chosen: dict[str, Material] = {}
        parts = []
        for panel in panels:
            label = own if panel.label is None else LABEL.get(panel.label, IGNORE)
            hangs = entry.label in ("curtain", "shower curtain") and not _is(panel.material, METALS)
            make = entry.label if hangs else panel.material
            if make not in chosen:
                chosen[make] = self._material(panel, entry, label, tint)
            corners = panel.shell.corners * scale
            normals = panel.shell.normals / scale
            normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
            flat = corners.reshape(-1, 3)
            lowest, highest = flat.min(axis=0), flat.max(axis=0)
            middle = (lowest + highest) / 2
            x, y, z = (float(c) for c in middle + foot)
            width, depth, height = (max(float(side), 1e-3) for side in highest - lowest)
            shell = Shell((corners - middle).astype(np.float32), normals.astype(np.float32), panel.shell.uv)
            parts.append(Solid(label, chosen[make], (x, y, z), (width, depth, height), SHELL, shell=shell))
        return parts

    def _material(self, panel: Panel, entry: MeshEntry, label: int, tint: np.ndarray) -> Material:
        rng = self.rng
        if panel.picture is not None:
            red, green, blue = (float(c * f) for c, f in zip(panel.colour, tint, strict=True))
            return self.coverings.unwrapped(panel.picture, (red, green, blue), rng.uniform(0, 0.2))
        if panel.clear:
            glass = m.colour(rng, (0.4, 0.6), (0, 0.1), (0.35, 0.7))
            return m.plain(rng, glass, m.Noise(fine=0.0, blotch=0.05), gloss=0.7)
        return self.flat(panel.material.lower(), panel.colour, label)

    def flat(self, name: str, colour: tuple[float, float, float], label: int) -> Material:
        """A material for an untextured surface of a mesh: by the material's name, else by class and colour."""
        rng = self.rng
        ware = label in (LABEL["toilet"], LABEL["bathtub"], LABEL["sink"])
        if _is(name, METALS):
            return m.metal(rng)
        if ware or _is(name, WARES):
            return m.ceramic(rng)
        if label == IGNORE:
            return self._thing(name, colour)
        if _is(name, CLOTHS) or label in (LABEL["sofa"], LABEL["curtain"], LABEL["shower curtain"]):
            return self.coverings.cloth(m.fabric(rng), leather=label == LABEL["sofa"])
        if _is(name, WOODS) or _brown(colour) or label in (LABEL["door"], LABEL["table"], LABEL["bookshelf"]):
            return self.coverings.wood(m.wood(rng)) if rng.random() < 0.6 else self._paint()
        return self._paint()

    def _paint(self) -> Material:
        """Paint, usually white or grey, rarely a strong colour."""
        rng, look = self.rng, self.rng.random()
        if look < 0.6:
            base = m.colour(rng, saturation=(0, 0.08), value=(0.75, 0.97))
        elif look < 0.82:
            base = m.colour(rng, saturation=(0, 0.2), value=(0.08, 0.6))
        else:
            base = m.colour(rng, saturation=(0.1, 0.6), value=(0.25, 0.85))
        return m.plain(rng, base, m.Noise(fine=0.02, blotch_scale=0.3), gloss=rng.uniform(0, 0.3))

    def _thing(self, name: str, colour: tuple[float, float, float]) -> Material:
        """A material for clutter, close to its own colour; the greens of plants, too dark in the files, are replaced."""
        rng = self.rng
        if _is(name, GREENS) or (colour[1] > 1.2 * colour[0] and colour[1] > 1.2 * colour[2]):
            leaf = m.colour(rng, m.GREEN_HUES, (0.4, 0.8), (0.2, 0.6))
            return m.plain(rng, leaf, m.Noise(fine=0.1, blotch=0.2, blotch_scale=0.08))
        if _is(name, CLOTHS):
            return self.coverings.cloth(m.fabric(rng))
        red, green, blue = (float(min(0.9, max(0.02, c * rng.uniform(0.8, 1.25)))) for c in colour)
        return m.plain(rng, (red, green, blue), m.Noise(fine=0.02, blotch=0.04), gloss=rng.uniform(0, 0.3))


def fit_scale(entry: MeshEntry, box: Float64[np.ndarray, " 3"], rule: Rule) -> Float64[np.ndarray, " 3"] | None:
    """Scales along x, y and z that fit a mesh into a box, None if it would look wrong.

    Width and depth stay within the box; the height may exceed it by an eighth.
    """
    ratio = box / np.array(entry.extents)
    if rule.label == "curtain":
        return ratio
    if rule.hung:
        whole, stretch = float(np.sqrt(ratio[0] * ratio[2])), float(max(ratio[0] / ratio[2], ratio[2] / ratio[0]))
        depth = DEPTHS.get(rule.label, entry.extents[1]) / entry.extents[1]
        fits = rule.low <= whole <= rule.high and stretch <= rule.stretch
        return np.array([ratio[0], min(1.0, depth), ratio[2]]) if fits else None
    whole = float(min(ratio[0], ratio[1], rule.high))
    if whole < rule.low:
        return None
    scale = np.clip(ratio, whole / rule.stretch, whole * rule.stretch)
    scale[:2] = np.minimum(scale[:2], ratio[:2])
    filled = scale * entry.extents / box
    return scale if filled[0] >= rule.fill and filled[2] <= HIGHEST else None


def _drape(
    panels: tuple[Panel, ...], box: Float64[np.ndarray, " 3"], foot: Float64[np.ndarray, " 3"]
) -> tuple[Float64[np.ndarray, " 3"], Float64[np.ndarray, " 3"]]:
    """Scale and origin of one drape that fills the width and height of a box."""
    flat = np.concatenate([panel.shell.corners.reshape(-1, 3) for panel in panels])
    lowest, highest = flat.min(axis=0).astype(np.float64), flat.max(axis=0).astype(np.float64)
    scale = box / np.maximum(highest - lowest, 1e-3)
    scale[1] = min(1.0, DEPTHS["curtain"] / (highest[1] - lowest[1]))
    middle = scale * (lowest + highest) / 2
    off = DEPTHS["window"] + DEPTHS["curtain"] / 2
    return scale, np.array([foot[0] - middle[0], off - middle[1], foot[2] - scale[2] * lowest[2]])


def _kept_parts(piece: Piece) -> list[Solid]:
    """Parts of the piece that stay, because they close a hole in the wall: the leaf of a door; the pane of a window, enlarged to the
    hole, and its blind."""
    if piece.name == "door":
        return [piece.parts[0]]
    if piece.name != "window":
        return []
    width, _, height = piece.size
    pane = [part for part in piece.parts if part.material[t.KIND] == t.OUTDOOR]
    blind = [part for part in piece.parts if part.material[t.KIND] == t.TILES]
    wide = [replace(p, centre=(width / 2, p.centre[1], height / 2), size=(width, p.size[1], height)) for p in pane]
    return wide + blind


def _frame_art(parts: list[Solid], piece: Piece) -> list[Solid]:
    """A frame with the piece's art on its canvas, the part with the fewest triangles."""
    canvas = min(parts, key=lambda part: 0 if part.shell is None else len(part.shell.corners))
    art = replace(piece.parts[-1], centre=canvas.centre, size=canvas.size)
    return [*(part for part in parts if part is not canvas), art]


def _is(name: str, words: tuple[str, ...]) -> bool:
    return any(word in name.lower() for word in words)


def _bounds(piece: Piece) -> tuple[float, float]:
    """Lowest and highest point of a piece, without ignored parts unless all are ignored."""
    own = [part for part in piece.parts if part.label != IGNORE] or list(piece.parts)
    lowest, highest = min(p.centre[2] - p.size[2] / 2 for p in own), max(p.centre[2] + p.size[2] / 2 for p in own)
    return max(0.0, lowest), highest


def _surface(panels: tuple[Panel, ...], entry: MeshEntry, scale: np.ndarray) -> float | None:
    """Height of a flat top, None if there is none."""
    corners = np.concatenate([panel.shell.corners for panel in panels])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = np.abs(normals[:, 2]) > 0.9 * np.linalg.norm(normals, axis=-1)
    top = level & (corners[..., 2].min(axis=1) > entry.extents[2] - TOP_BAND)
    covered = np.abs(normals[top, 2]).sum() / 2
    footprint = entry.extents[0] * entry.extents[1]
    return float(entry.extents[2] * scale[2]) if covered >= TOP_SHARE * footprint else None


def _brown(colour: tuple[float, float, float]) -> bool:
    red, green, blue = colour
    return red > green > blue and red > 1.3 * blue
