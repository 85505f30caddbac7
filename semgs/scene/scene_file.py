"""The scene file: a complete reconstruction in one safetensors file; writing and reading.

One metadata key, `semgs`, holds JSON: `format` ("semgs.scene"), `version` (3), `unit`, `image_size`
[height, width], `frames` (names of the context frames in the source), `source`, `model`, `classes` (null, or `name`,
`names`, `colours`, `raw_ids`), `applied_transform` and `applied_scale` (nerfstudio's, null if the source has none), and `stride`, the side of the block of
pixels that a Gaussian stands for. If the class distributions can be calibrated, `temperatures` has two numbers, `rendered` and `gaussians`.
If the source is far from the origin of its coordinates, `origin` contains three numbers: `means` are relative to that
point, in float32; `cameras.world_from_camera` is in the source's coordinates.
Tensors are float32 unless noted; g Gaussians, v context views:

    means [g 3]  opacities [g]
    colour.quaternions [g 4]  colour.scales [g 3]  colour.features [g k 3]      (w, x, y, z; harmonics, 3DGS basis)
    semantic.quaternions [g 4]  semantic.scales [g 3]  semantic.features [g class]      (absent without classes)
    footprints [g]      (absent in labelled splats of other programs)
    places [g] int64      (their blocks, counted by view, row and column; absent if every block has a Gaussian)
    cameras.world_from_camera [v 4 4] float64  cameras.intrinsics [v 3 3] float64  depth_range [v 2] float64
    depths [v h w]  confidences [v h w]  depth_spread [v h w]      (depth_spread: absent if unknown)
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import torch
from jaxtyping import Float, Float64, Int64
from safetensors.torch import save
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.files.atomic import write_bytes
from semgs.files.contents import refuse_checkpoint
from semgs.files.errors import InputError, check_type, input_error
from semgs.files.paths import typed_path
from semgs.files.records import make_record
from semgs.files.strict_json import parse_json
from semgs.files.tensor_files import open_tensors
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.summaries import describe
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering
from semgs.rendering.temperatures import Temperatures
from semgs.scene.encoding import Encoding, per_gaussian

FILE_NAME = "scene.safetensors"
"""Name of the scene file in an output folder of `semgs reconstruct`."""

FORMAT, VERSION = "semgs.scene", 3
AGAIN = "make it again with `semgs reconstruct --out`, or `semgs label-splat --out` for a splat"
"""What to do about a file of an older version."""

_APPEARANCE = ("quaternions", "scales", "features")
_FLOAT64 = ("cameras.world_from_camera", "cameras.intrinsics", "depth_range")


@dataclass(frozen=True)
class SavedScene:
    """A reconstructed scene: its Gaussians, and what is needed to render them, to measure, and to find the source.

    Attributes:
        gaussians: in the order view, row, column, without a batch axis, relative to `origin`.
        cameras: of the context views, at the size of the encoding, also relative to `origin`. To convert cameras of the source, use
            `cameras.relative_to(scene.origin)`.
        depths: z-depth of the Gaussian at every context pixel, the network's or a sensor's, 0 = unknown, as at hidden pixels [unit of the scene].
        confidences: the largest probability among the depth candidates, 0..1; 1 where a sensor measured the depth.
        depth_range: near and far of each context view [unit of the scene].
        unit: "metric" for metres, or "unknown".
        classes: the table of the class distributions; None for a colour-only model.
        frames: names of the context frames in the source.
        source: name of the source.
        model: name of the model.
        applied_transform: nerfstudio's transform of the source's poses [3 4] or [4 4]; None if unknown.
        applied_scale: nerfstudio's scale of the source's poses; None if unknown.
        depth_spread: standard deviation of log depth: 0.1 is about 10 % of the depth; None if unknown.
        temperatures: calibrate the class distributions; None if unknown.
        origin: add it to a position to get the source's coordinates; (0, 0, 0) unless the source is far from its own origin.
        stride: pixels along each side of the block that a Gaussian stands for.
        places: of each Gaussian the number of its block, in the order view, row, column, in merged scenes and those with
            hidden pixels; None if every block has a Gaussian.

    Raises:
        ValueError: sizes or counts disagree, or a number is invalid: not finite, an opacity or confidence outside 0..1, a negative scale
            or depth, a quaternion that does not have unit length, or bounds without 0 < near < far.
    """

    gaussians: Gaussians
    cameras: Cameras
    depths: Float[Tensor, "v h w"]
    confidences: Float[Tensor, "v h w"]
    depth_range: Float64[Tensor, "v 2"]
    unit: Literal["metric", "unknown"]
    classes: ClassTable | None
    frames: tuple[str, ...]
    source: str
    model: str
    applied_transform: tuple[tuple[float, ...], ...] | None = None
    applied_scale: float | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    depth_spread: Float[Tensor, "v h w"] | None = None
    temperatures: Temperatures | None = None
    stride: int = 1
    places: Int64[Tensor, " g"] | None = None

    def __post_init__(self) -> None:
        maps = (len(self.frames), *self.cameras.size)
        if self.gaussians.means.ndim != 2:
            raise ValueError(f"means are {tuple(self.gaussians.means.shape)}; a file holds one scene, expected [g 3]")
        for name, found, expected in (
            ("cameras", self.cameras.batch, maps[:1]),
            ("depths", tuple(self.depths.shape), maps),
            ("confidences", tuple(self.confidences.shape), maps),
            ("depth_range", tuple(self.depth_range.shape), (maps[0], 2)),
            ("depth_spread", maps if self.depth_spread is None else tuple(self.depth_spread.shape), maps),
        ):
            if found != expected:
                raise ValueError(f"{name} are {found}; expected {expected} for {maps[0]} frames of {maps[1:]}")
        if self.unit not in ("metric", "unknown"):
            raise ValueError(f"unit is {self.unit!r}; expected 'metric' or 'unknown'")
        semantic = self.gaussians.semantic
        held = None if semantic is None else semantic.features.shape[-1]
        if held != (None if self.classes is None else len(self.classes)):
            raise ValueError(
                f"the Gaussians have {held} classes and the table is {self.classes}; expected both or none"
            )
        _check_blocks(self.places, self.stride, len(self.gaussians), maps)
        self.gaussians.checked()
        near, far = self.depth_range.unbind(-1)
        spread = torch.zeros(()) if self.depth_spread is None else self.depth_spread
        for name, good, wanted in (
            ("depths", (self.depths >= 0) & self.depths.isfinite(), "finite numbers, 0 or more"),
            ("confidences", (self.confidences >= 0) & (self.confidences <= 1 + 1e-5), "0 to 1"),
            ("depth_spread", (spread >= 0) & spread.isfinite(), "finite numbers, 0 or more"),
            ("depth_range", (near > 0) & (near < far) & far.isfinite(), "0 < near < far"),
            ("origin", torch.tensor(self.origin).isfinite(), "finite numbers"),
        ):
            if not good.all():
                raise ValueError(f"{name} contain an invalid number; expected {wanted}")

    @classmethod
    def of(
        cls,
        encoding: Encoding,
        views: Views,
        *,
        unit: Literal["metric", "unknown"],
        frames: Sequence[str] = (),
        source: str = "",
        model: str = "",
    ) -> SavedScene:
        """The scene that a network made from some views.

        Args:
            encoding: the output of the network, without a batch axis.
            views: the input views.
            unit: "metric" if lengths are in metres, as in a scene's `unit`.
            frames: names of the views; by default their positions.
            source: name of the source.
            model: name of the model.

        Raises:
            ValueError: sizes or counts disagree.
        """
        check_type("the encoding is", encoding, Encoding, 'the output of a network, such as load("small")(views)')
        check_type("views are", views, Views, "semgs.Views, the input views of the encoding")
        return cls(
            gaussians=encoding.gaussians,
            cameras=views.cameras,
            depths=encoding.depths,
            confidences=encoding.confidences,
            depth_spread=encoding.depth_spread,
            temperatures=encoding.temperatures,
            depth_range=views.depth_range,
            unit=unit,
            classes=encoding.classes,
            frames=tuple(frames) or tuple(map(str, range(len(views)))),
            source=source,
            model=model,
            stride=encoding.stride,
            places=encoding.places,
        )

    def __repr__(self) -> str:
        return describe(
            "SavedScene",
            gaussians=self.gaussians,
            cameras=self.cameras,
            depths=self.depths,
            confidences=self.confidences,
            depth_range=self.depth_range,
            unit=self.unit,
            classes=self.classes and f"{self.classes.name}, {len(self.classes)} classes",
            frames=", ".join(self.frames),
            source=self.source,
            model=self.model,
        )

    @property
    def grid(self) -> tuple[int, int, int]:
        """(views, rows, columns) of the blocks of pixels that Gaussians stand for."""
        rows, columns = (-(-side // self.stride) for side in self.cameras.size)
        return len(self.frames), rows, columns

    @property
    def blocks(self) -> Int64[Tensor, " g"]:
        """The block of each Gaussian: `places`, also where every block has a Gaussian."""
        return torch.arange(len(self.gaussians)) if self.places is None else self.places

    @property
    def own_views(self) -> Int64[Tensor, " g"]:
        """The input view of each Gaussian."""
        _, rows, columns = self.grid
        return self.blocks // (rows * columns)

    def per_gaussian(self, maps: Float[Tensor, "v h w"]) -> Float[Tensor, " g"]:
        """For each Gaussian the mean over the pixels that it stands for.

        Args:
            maps: of the context views, at their size.
        """
        return per_gaussian(maps[:, None], self.stride, self.places)[:, 0]

    @property
    def near(self) -> float:
        """The smallest near bound of the views, for `render` [unit of the scene]."""
        return float(self.depth_range[:, 0].min())

    def render(self, cameras: Cameras, **options: Any) -> Rendering:
        """Render the Gaussians from cameras; arguments and errors as for `Encoding.render`.

        Args:
            cameras: the views [v], relative to `origin`.
            options: as for `semgs.render`.
        """
        rendering = render(self.gaussians, cameras, **({"near": self.near} | options))
        temperature = None if self.temperatures is None else self.temperatures.rendered
        return replace(rendering, classes=self.classes, temperature=temperature)


def save_scene(path: str | Path, scene: SavedScene) -> None:
    """Write a scene file atomically; equal scenes give equal bytes.

    Raises:
        OSError: the file cannot be written.
    """
    check_type("the scene is", scene, SavedScene, "semgs.SavedScene, such as SavedScene.of(encoding, views, unit=...)")
    path = typed_path(path)
    gaussians, in_source = scene.gaussians, scene.cameras
    if any(scene.origin):
        in_source = in_source.relative_to([-side for side in scene.origin])
    given = {"means": gaussians.means, "opacities": gaussians.opacities, "footprints": gaussians.footprints}
    given |= {"depths": scene.depths, "confidences": scene.confidences, "depth_spread": scene.depth_spread}
    for branch, appearance in (("colour", gaussians.colour), ("semantic", gaussians.semantic)):
        if appearance is not None:
            given |= {f"{branch}.{name}": getattr(appearance, name) for name in _APPEARANCE}
    # Colour and semantic Gaussians may share their shapes; the file stores each tensor by itself.
    tensors = {
        name: tensor.detach().to("cpu", torch.float32, copy=True).contiguous()
        for name, tensor in given.items()
        if tensor is not None
    }
    tensors |= {
        "cameras.world_from_camera": in_source.world_from_camera.contiguous(),
        "cameras.intrinsics": scene.cameras.intrinsics.contiguous(),
        "depth_range": scene.depth_range.contiguous(),
    }
    if scene.places is not None:
        tensors["places"] = scene.places.contiguous()
    header = {
        "format": FORMAT,
        "version": VERSION,
        "unit": scene.unit,
        "image_size": list(scene.cameras.size),
        "frames": list(scene.frames),
        "source": scene.source,
        "model": scene.model,
        "classes": None if scene.classes is None else asdict(scene.classes),
        "applied_transform": scene.applied_transform,
        "applied_scale": scene.applied_scale,
        **({"temperatures": asdict(scene.temperatures)} if scene.temperatures else {}),
        **({"origin": list(scene.origin)} if any(scene.origin) else {}),
        "stride": scene.stride,
    }
    write_bytes(path, save(tensors, metadata={"semgs": json.dumps(header, allow_nan=False)}))


def load_scene(path: str | Path) -> SavedScene:
    """Read a scene file, or the one in an output folder of `semgs reconstruct`.

    Raises:
        InputError: it is missing, incomplete, no scene file, of another version, or its contents are not a valid `SavedScene`.
    """
    path = typed_path(path)
    file = path / FILE_NAME if path.is_dir() else path
    if not file.is_file():
        raise InputError(
            file, "a scene file", "no such file", advice="give the folder or file that `semgs reconstruct --out` wrote"
        )
    refuse_checkpoint(file, "a scene file or a splat")
    with open_tensors(file, "a complete scene file of semgs reconstruct") as opened:
        header = _header(file, (opened.metadata() or {}).get("semgs"))
        tensors = {name: opened.get_tensor(name).clone() for name in opened.keys()}  # noqa: SIM118 - not a dict
    try:
        return _scene(header, tensors)
    except KeyError as error:
        raise InputError(file, f"a scene file with {error.args[0]}", "none") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(file, "a valid scene", str(error)) from error


def _header(file: Path, text: str | None) -> dict:
    """The JSON header of a scene file of this version."""
    with input_error(file, "JSON", key="metadata.semgs"):
        header = parse_json(text or "null")
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError(file, f"a scene file (format {FORMAT})", "another safetensors file")
    version = header.get("version")
    if version != VERSION:
        newer = isinstance(version, int) and version > VERSION
        advice = "upgrade semgs to read it" if newer else AGAIN
        raise InputError(file, f"version {VERSION}", f"version {version}", advice=advice)
    return header


def _scene(header: dict, tensors: dict[str, Tensor]) -> SavedScene:
    """The scene of a header and its tensors; KeyError, ValueError or TypeError if they are invalid."""

    def appearance(branch: str) -> Appearance:
        return Appearance(*(tensors[f"{branch}.{name}"] for name in _APPEARANCE))

    for name, tensor in tensors.items():
        expected = torch.float64 if name in _FLOAT64 else torch.int64 if name == "places" else torch.float32
        if tensor.dtype != expected:
            raise ValueError(f"{name} are {tensor.dtype}; expected {expected}")
    table = header["classes"]
    transform = header["applied_transform"]
    height, width = header["image_size"]
    if not all(isinstance(one, str) for one in (*header["frames"], header["source"], header["model"])):
        raise ValueError("frames, source and model must be texts")
    x, y, z = header.get("origin", (0.0, 0.0, 0.0))
    temperatures = header.get("temperatures")
    cameras = Cameras(tensors["cameras.world_from_camera"], tensors["cameras.intrinsics"], (height, width))
    return SavedScene(
        gaussians=Gaussians(
            means=tensors["means"],
            opacities=tensors["opacities"],
            colour=appearance("colour"),
            semantic=None if table is None else appearance("semantic"),
            footprints=tensors.get("footprints"),
        ),
        cameras=cameras.relative_to((x, y, z)) if any((x, y, z)) else cameras,
        depths=tensors["depths"],
        confidences=tensors["confidences"],
        depth_range=tensors["depth_range"],
        unit=header["unit"],
        classes=None if table is None else make_record(ClassTable, table),
        frames=tuple(header["frames"]),
        source=header["source"],
        model=header["model"],
        applied_transform=transform and tuple(tuple(row) for row in transform),
        applied_scale=header["applied_scale"],
        origin=(x, y, z),
        depth_spread=tensors.get("depth_spread"),
        temperatures=None if temperatures is None else Temperatures(**temperatures),
        stride=header["stride"],
        places=tensors.get("places"),
    )


def _check_blocks(places: Int64[Tensor, " _"] | None, stride: int, gaussians: int, maps: tuple[int, ...]) -> None:
    """Check that each Gaussian has a block of pixels of (views, height, width), and each block a Gaussian if there are no places.

    Raises:
        ValueError: they are not.
    """
    if not isinstance(stride, int) or not 1 <= stride <= min(maps[1:]):
        raise ValueError(f"stride is {stride!r}; expected 1 to {min(maps[1:])} pixels")
    blocks = maps[0] * -(-maps[1] // stride) * -(-maps[2] // stride)
    if places is None:
        if gaussians != blocks:
            raise ValueError(f"there are {gaussians} Gaussians for {blocks} blocks of pixels; expected one for each")
    elif places.shape != (gaussians,) or (len(places) and not 0 <= int(places.min()) <= int(places.max()) < blocks):
        raise ValueError(f"places are {tuple(places.shape)}; expected ({gaussians},) with numbers of 0 to {blocks - 1}")
