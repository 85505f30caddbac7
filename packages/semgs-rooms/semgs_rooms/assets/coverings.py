"""Cover surfaces with images: replaces procedural materials with images of the same kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from semgs.data.tables.classes import IGNORE
from semgs.files.images.colours import LINEAR
from semgs_rooms.assets.asset_images import Pack, Pyramid, pack
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.assets.catalogue import ImageEntry
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.picture_kernels import PANORAMA, STRETCHED, TILED, UNWRAPPED, VIEW
from semgs_rooms.pieces.solids import SHELL, Solid

TILE = {
    "wood_floor": 1.5, "wood": 1.0, "carpet": 0.8, "tile": 0.8, "stone": 1.2, "concrete": 2.0, "plaster": 1.5, "wallpaper": 0.7,
    "brick": 1.2, "fabric": 0.35, "leather": 0.5, "metal": 0.6,
}  # fmt: skip
"""Default width of an image's tile, if the catalogue has none [m]."""
FINE = 256
"""Smaller images are visibly repetitive on walls and floors [px]."""
COARSE_SHARE = 0.4
"""Tile width of such an image, as a share of the default."""
FLOORS = {
    t.PLANKS: ("wood_floor",), t.TILES: ("tile", "stone"), t.CHECKER: ("tile",), t.MARBLE: ("stone", "concrete"),
    t.PLAIN: ("carpet",),
}  # fmt: skip
WALLS = {t.STRIPES: ("wallpaper",), t.DOTS: ("wallpaper",), t.PLANKS: ("brick", "wood"), t.TILES: ("tile",)}
CLOTH = tuple(LABEL[name] for name in ("bed", "chair", "sofa", "curtain", "shower curtain", "otherfurniture"))
VIEW_LIGHT = (0.5, 2.2)
"""Mean radiance of a view through a window, as a share of the pane's emission. It varies because real windows are often overexposed."""
SEATS = (LABEL["chair"], LABEL["sofa"])
CLOTH_GRAIN = 0.04
"""Plain materials of cloth classes count as cloth if they have at least this much grain."""


@dataclass(frozen=True)
class Shares:
    """How often each kind of surface is covered with an image.

    Attributes:
        floor, wall, plaster, wood, cloth, stone, art, view, rug: shares in 0..1; `plaster` is for plain painted walls.
    """

    floor: float = 0.7
    wall: float = 0.7
    plaster: float = 0.35
    wood: float = 0.65
    cloth: float = 0.55
    stone: float = 0.7
    art: float = 0.95
    view: float = 1.0
    rug: float = 0.7


ALL = Shares()
HUNG = Shares(floor=0.0, wall=0.0, plaster=0.0, wood=0.0, cloth=0.0, stone=0.0, rug=0.0)
"""Only pictures in frames and views through windows, which rooms always have."""


class Coverings:
    """Images for the surfaces of one room. Equal materials get equal images.

    Args:
        rng: source of all random choices.
        library: of the images.
        used: records which assets are used.
        shares: how often surfaces are covered.
    """

    def __init__(self, rng: np.random.Generator, library: Library, used: UsedAssets, shares: Shares = ALL) -> None:
        self.rng, self.library, self.used, self.shares = rng, library, used, shares
        self._chosen: dict[tuple[int, bytes], Material | None] = {}
        self._woods: list[ImageEntry] = []

    def cover(self, parts: Sequence[Solid]) -> list[Solid]:
        """The same parts, some of them covered with images."""
        return [self._covered(part) for part in parts]

    def material(self, part: Solid) -> Material | None:
        """An image material for a part, None to keep its own material."""
        label, material, share = part.label, part.material, self.shares
        kind = int(material[t.KIND])
        if kind == t.OUTDOOR:
            return self.view(material) if self._chance(share.view) else None
        if kind in (t.LANDSCAPE, t.ABSTRACT) and label == LABEL["picture"]:
            if not self._chance(share.art):
                return None
            return self._stretched(str(self.rng.choice(["painting", "painting", "photo", "poster"])))
        if label == LABEL["floor"]:
            return self._tiled(FLOORS.get(kind, ()), share.floor, None, fine=kind != t.PLAIN)
        if label == LABEL["wall"] and kind == t.PLAIN:
            return self._tiled(("plaster",), share.plaster, material, fine=True)
        if label == LABEL["wall"]:
            return self._tiled(WALLS.get(kind, ()), share.wall, None, fine=True)
        if label == IGNORE and part.size[2] < 0.02 and min(part.size[:2]) > 0.7:
            return self._stretched("carpet") if self._chance(share.rug) else None
        if kind == t.WOOD:
            return self.wood(material) if self._chance(share.wood) else None
        if label in CLOTH and self._is_cloth(material):
            return self.cloth(material, leather=label in SEATS) if self._chance(share.cloth) else None
        if kind == t.MARBLE:
            return self._tiled(("stone",), share.stone, None, fine=False)
        return None

    def wood(self, material: Material) -> Material:
        """Wood, sometimes in the colour of a material; at most three kinds per room."""
        if len(self._woods) < 3 and (found := self._pick(("wood",))):
            self._woods.append(found)
        if not self._woods:
            return material
        entry = self._woods[int(self.rng.integers(len(self._woods)))]
        like = material if self._chance(0.5) else None
        return self._picture(entry, like, gloss=self.rng.uniform(0, 0.25), axis=int(material[t.AXIS]), lying=True)

    def cloth(self, material: Material, leather: bool = False) -> Material:
        """Cloth or leather, sometimes in the colour of a material."""
        found = self._pick(("leather",) if leather and self._chance(0.2) else ("fabric",))
        return self._picture(found, material if self._chance(0.6) else None) if found else material

    def view(self, material: Material) -> Material:
        """The view through a window, as bright as the material says."""
        entry = self._pick(("outdoor",))
        if entry is None:
            return material
        pyramid = self._open(entry)
        whole = entry.name.startswith("pano") or pyramid.size[0] == 2 * pyramid.size[1]
        result = np.zeros(t.WIDTH)
        result[t.KIND], result[t.PICTURE_NUMBER] = t.PICTURE, self.used.number(pyramid)
        result[t.MAPPING] = PANORAMA if whole else VIEW
        result[t.SCALE] = 2 * np.pi if whole else self.rng.uniform(0.9, 1.4)
        result[t.ASPECT] = pyramid.size[1] / pyramid.size[0]
        result[t.AZIMUTH] = self.rng.random()
        bright = max(0.15, float(_mean(pyramid).mean()))
        result[t.COLOUR_A : t.COLOUR_A + 3] = 1.0
        result[t.EMISSION] = material[t.EMISSION] * self.rng.uniform(*VIEW_LIGHT) / bright
        return result

    def unwrapped(self, pyramid: Pyramid, colour: tuple[float, float, float], gloss: float) -> Material:
        """An image mapped by a shell's texture coordinates."""
        result = np.zeros(t.WIDTH)
        result[t.KIND], result[t.PICTURE_NUMBER] = t.PICTURE, self.used.number(pyramid)
        result[t.MAPPING], result[t.AXIS], result[t.SCALE], result[t.ASPECT] = UNWRAPPED, -1, 1.0, 1.0
        result[t.COLOUR_A : t.COLOUR_A + 3] = colour
        result[t.GLOSS] = gloss
        return result

    def _covered(self, part: Solid) -> Solid:
        if part.shape == SHELL:
            return part
        key = part.label, part.material.tobytes()
        if key not in self._chosen:
            self._chosen[key] = self.material(part)
        chosen = self._chosen[key]
        return part if chosen is None else replace(part, material=_in_place_of(part.material, chosen))

    def _is_cloth(self, material: Material) -> bool:
        kind = int(material[t.KIND])
        woven = kind in (t.WEAVE, t.STRIPES, t.DOTS)
        return woven or bool(kind == t.PLAIN and material[t.FINE] >= CLOTH_GRAIN and material[t.GLOSS] == 0)

    def _tiled(self, kinds: Sequence[str], share: float, like: Material | None, fine: bool) -> Material | None:
        if not self._chance(share):
            return None
        found = self._pick(kinds, fine)
        return self._picture(found, like, gloss=self.rng.uniform(0, 0.3) if like is None else 0.0) if found else None

    def _stretched(self, kind: str) -> Material | None:
        """An image of a kind, stretched over the face of a part."""
        found = self._pick((kind,), tileable=False)
        if found is None:
            return None
        result = self.unwrapped(self._open(found), (1.0, 1.0, 1.0), 0.0)
        result[t.MAPPING] = STRETCHED
        return result

    def _picture(
        self, entry: ImageEntry, like: Material | None, gloss: float = 0.0, axis: int = -1, lying: bool = False
    ) -> Material:
        """A tiled image. If a material is given, the image is multiplied to have its mean colour."""
        pyramid = self._open(entry, not lying)
        colour = self.rng.uniform(0.9, 1.05) * self.rng.uniform(0.97, 1.03, 3)
        if like is not None:
            colour = like[t.COLOUR_A : t.COLOUR_A + 3] / np.maximum(_mean(pyramid), 0.02)
        red, green, blue = (float(c) for c in np.minimum(colour, 8.0))
        result = self.unwrapped(pyramid, (red, green, blue), gloss)
        usual = TILE[entry.kind] * (COARSE_SHARE if max(entry.size) < FINE else 1.0)
        result[t.MAPPING], result[t.AXIS] = TILED, axis
        result[t.SCALE] = (entry.tile or usual) * self.rng.uniform(0.85, 1.15)
        result[t.ASPECT] = pyramid.size[1] / pyramid.size[0]
        return result

    def _pick(self, kinds: Sequence[str], fine: bool = False, tileable: bool | None = None) -> ImageEntry | None:
        """A random image of some kinds, None if there is none."""
        wanted = "outdoor" not in kinds if tileable is None else tileable
        rows = [entry for entry in self.library.of_kind(*kinds) if entry.tileable == wanted]
        large = [entry for entry in rows if min(entry.size) >= FINE]
        if large and (fine or self._chance(0.5)):
            rows = large
        return rows[int(self.rng.integers(len(rows)))] if rows else None

    def _open(self, entry: ImageEntry, upright: bool = True) -> Pyramid:
        self.used.add_file(entry.file)
        return self.library.pyramid(entry, upright)

    def _chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)


def _in_place_of(material: Material, chosen: Material) -> Material:
    """The chosen image with the grain axis and the mirror flag of the material it replaces."""
    chosen = chosen.copy()
    chosen[t.MIRROR] = material[t.MIRROR]
    if material[t.KIND] != t.WOOD or chosen[t.KIND] != t.PICTURE:
        return chosen
    return m.along(chosen, int(material[t.AXIS]))


def _mean(pyramid: Pyramid) -> np.ndarray:
    """Mean of an image, linear RGB: its last level."""
    return LINEAR[pyramid.pixels[-1]]


class UsedAssets:
    """The images of a room, for its kernels, and the files of its images and meshes, for attribution."""

    def __init__(self) -> None:
        self._pyramids: list[Pyramid] = []
        self._numbers: dict[int, int] = {}
        self._files: set[str] = set()

    def number(self, pyramid: Pyramid) -> int:
        """Index of the image in the pack, which is the same for the same image."""
        if id(pyramid) not in self._numbers:
            self._numbers[id(pyramid)] = len(self._pyramids)
            self._pyramids.append(pyramid)
        return self._numbers[id(pyramid)]

    def add_file(self, file: str) -> None:
        """Record that a file is used."""
        self._files.add(file)

    @property
    def files(self) -> tuple[str, ...]:
        """All files that are used, sorted by name."""
        return tuple(sorted(self._files))

    def pack(self) -> Pack:
        """All images, for the kernels."""
        return pack(self._pyramids)
