"""Features of Gaussians: those of the input photos, compressed, made consistent between views, and compared with an embedding."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Shaped
from safetensors.torch import save
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError, input_error
from semgs.files.strict_json import parse_json
from semgs.files.tensor_files import open_tensors
from semgs.geometry.cameras import Cameras
from semgs.geometry.fusion import pool_views
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render_features import render_features
from semgs.scene.encoding import Encoding
from semgs.segmenters.features.compression import Compression, compression_of
from semgs.sources.photo_maps import resampled

FILE_NAME = "features.safetensors"
"""Name of the file with features in an output folder of `semgs reconstruct`."""

FORMAT, VERSION = "semgs.features", 1

SAMPLE = 8192
"""The compression is found from at most this many features of all views."""

SAVED = 1024
"""So many of them are saved uncompressed, to measure deviations."""

AT_A_TIME = 1 << 14
"""Features that are converted to float32 at a time."""

EVEN = 1e-6
"""Features whose mean energy about their mean is less than this are all equal, up to rounding."""

POOR = 0.7
"""If less of the energy is kept, a note says so."""

GOLDEN = 0.6180339887498949
"""Steps of this share of a map's pixels spread a sample evenly over it."""


@runtime_checkable
class FeatureSource(Protocol):
    """Where the features of photos come from."""

    @property
    def title(self) -> str:
        """What it is."""
        ...

    def of(self, frame: Frame) -> Float[np.ndarray, "n rows columns"]:
        """The features of a frame's photo as it is stored, at any resolution.

        Raises:
            InputError: a file is missing or damaged, or does not belong to the frame.
        """
        ...


@final
@dataclass(frozen=True, eq=False)
class SceneFeatures:
    """The features of the Gaussians of a scene.

    Attributes:
        compression: how they are compressed.
        codes: of each Gaussian, as `Compression.codes`.
        kept: share of the energy of the photos' features about their mean that the compression keeps.
        bound: by so much at most does the cosine of any embedding with a feature change by compression, in the photos.
        sample: some of the photos' features, of length 1, uncompressed.
        source: where the features come from.
    """

    compression: Compression
    codes: Shaped[Tensor, "g ..."] = field(repr=False)
    kept: float
    bound: float
    sample: Float[Tensor, "sample n"] = field(repr=False)
    source: str

    @property
    def numbers(self) -> int:
        """Of a feature, uncompressed."""
        return len(self.compression.basis)

    @property
    def description(self) -> str:
        """The features and their compression, in a sentence."""
        count = self.compression.basis.shape[1]
        book = self.compression.book
        how = f"{count} numbers" if book is None else f"one of {len(book)} entries"
        return (
            f"{self.numbers} numbers from {self.source}, compressed to {how} for each Gaussian: {self.kept:.2%} of the energy is kept, "
            f"cosines change by {self.bound:.3f} at most"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """For the user, a sentence each."""
        if self.kept >= POOR:
            return ()
        return (
            f"Compression keeps only {self.kept:.0%} of the energy of the features from {self.source}, so similarities are rough: "
            f"semgs query says by how much.",
        )

    @property
    def coordinates(self) -> Float[Tensor, "g k"]:
        """Of each Gaussian, in the basis."""
        return self.compression.decoded(self.codes)

    def similarity(self, embedding: Float[Tensor, " n"]) -> Float[Tensor, " g"]:
        """The cosine of each Gaussian's feature with an embedding; NaN where there is no feature."""
        if self.compression.book is None:
            return self.compression.cosine(self.codes, embedding)
        return self.compression.cosine(self.compression.book, embedding)[self.codes.long()]

    def similarity_maps(
        self, embedding: Float[Tensor, " n"], gaussians: Gaussians, cameras: Cameras, near: float | None = None
    ) -> Float[Tensor, "v h w"]:
        """The cosine of rendered features with an embedding; NaN where there is no feature, and where alpha < 0.05.

        Args:
            embedding: not zero.
            gaussians: of the scene.
            cameras: the views.
            near: bound, as for `semgs.render`.

        Raises:
            ValueError: these are not the Gaussians, or as for `semgs.render`.
        """
        rendering = render_features(gaussians, self.coordinates, cameras, near=near)
        return self.compression.cosine(rendering.features.movedim(1, -1), embedding)

    def deviation(self, embedding: Float[Tensor, " n"]) -> float:
        """The largest change of the cosine with an embedding by compression, over the sample."""
        compression = self.compression
        exact = self.sample @ (embedding / embedding.norm())
        codes = compression.codes(compression.coordinates(self.sample))
        found = compression.cosine(compression.decoded(codes), embedding)
        return float((found - exact).abs().nan_to_num(1.0).max())


@final
@dataclass(frozen=True)
class Featuring:
    """How Gaussians get their features.

    The features of a point are averaged over the input views that see it, as far as their depths agree (`semgs.geometry.fusion`).

    Attributes:
        source: the features of the input photos.
    """

    source: FeatureSource

    def __call__(self, encoding: Encoding, scene: Scene, positions: Sequence[int], views: Views) -> SceneFeatures:
        """The features of the Gaussians of an encoding.

        Args:
            encoding: of the views.
            scene: contains the frames.
            positions: of the frames in the scene.
            views: the frames as read.

        Raises:
            InputError: as `FeatureSource.of`; frames have features of different lengths; or all features are zero.
        """
        frames = [scene.frames[position] for position in positions]
        sample = self._sample(frames)
        compression = compression_of(sample)
        maps, tally = [], _Tally(compression)
        for frame in frames:
            values = self.source.of(frame)
            coordinates = torch.cat([tally.add(part) for part in unit_features(values)])
            plane = coordinates.mT.unflatten(1, values.shape[1:])
            maps.append(resampled(plane, frame, views.size, undistorted=False))
        coordinates = torch.stack(maps).to(encoding.depths)
        coordinates = pool_views(coordinates, encoding.depths, encoding.depth_spread, views.cameras)
        return SceneFeatures(
            compression,
            compression.codes(encoding.per_gaussian(coordinates).cpu().float()),
            tally.kept,
            tally.bound,
            sample[_spread(len(sample), SAVED)],
            self.source.title,
        )

    def _sample(self, frames: Sequence[Frame]) -> Float[Tensor, "sample n"]:
        """Features of all frames, of length 1."""
        found: list[Tensor] = []
        for frame in frames:
            values = self.source.of(frame)
            if found and len(values) != found[0].shape[1]:
                expected = f"features of {found[0].shape[1]} numbers, as of {frames[0].name}"
                raise InputError(self.source.title, expected, f"{len(values)}", key=frame.name)
            pixels = values.reshape(len(values), -1)
            chosen = _spread(pixels.shape[1], SAMPLE // len(frames))
            found += unit_features(pixels[:, chosen])
        sample = torch.cat(found)
        sample = sample[sample.norm(dim=1) > 0]
        if not len(sample):
            raise InputError(self.source.title, "features", "zeros only")
        return sample


@final
class _Tally:
    """What a compression keeps of the features that pass."""

    def __init__(self, compression: Compression) -> None:
        self._compression = compression
        self._count, self._lost, self.bound = 0, 0.0, 0.0
        self._sum = torch.zeros(len(compression.basis), dtype=torch.float64)

    def add(self, features: Float[Tensor, "some n"]) -> Float[Tensor, "some k"]:
        """Count features of length 1, and none of length 0; returns their coordinates."""
        compression = self._compression
        coordinates = compression.coordinates(features)
        here = features.square().sum(1) > 0
        if here.any():
            true = features[here]
            again = compression.features(compression.decoded(compression.codes(coordinates[here])))
            self._count += len(true)
            self._sum += true.sum(0, dtype=torch.float64)
            self._lost += float((true - again).square().sum(dtype=torch.float64))
            away = (torch.nn.functional.normalize(again, dim=1) - true).norm(dim=1)
            self.bound = max(self.bound, float(away.max()))
        return coordinates

    @property
    def kept(self) -> float:
        """The share of the energy about the mean: sum |f - mean|^2 = count - |sum|^2 / count, as features have length 1."""
        energy = self._count - float(self._sum.square().sum()) / max(1, self._count)
        return 1 - self._lost / max(energy, EVEN * self._count)


def unit_features(values: Float[np.ndarray, "n ..."]) -> Iterator[Float[Tensor, "some n"]]:
    """The features of maps, pixel by pixel and some at a time, of length 1; zeros stay."""
    pixels = values.reshape(len(values), -1)
    for start in range(0, pixels.shape[1], AT_A_TIME):
        part = torch.from_numpy(pixels[:, start : start + AT_A_TIME].T.astype(np.float32))
        largest = part.abs().amax(1, keepdim=True)  # so that squares neither overflow nor vanish
        yield torch.nn.functional.normalize(part / torch.where(largest > 0, largest, 1), dim=1)


def _spread(count: int, most: int) -> Shaped[np.ndarray, " chosen"]:
    """Up to so many of `count` places, spread evenly and without a period."""
    if count <= most:
        return np.arange(count)
    return np.unique((np.arange(most) * GOLDEN % 1 * count).astype(np.int64))


def save_features(path: Path, features: SceneFeatures) -> None:
    """Write the features of a scene.

    Tensors: `basis` [n k], `sample` [s n] (float16), and `codes` [g k], or [g] (uint8) with `book` [entry k]. One metadata
    key, `semgs`, holds JSON: `format`, `version`, `kept`, `bound`, `source`. The shapes are those of the semantic Gaussians in
    scene.safetensors or, if there are none, of the colour Gaussians.

    Raises:
        OSError: the file cannot be written.
    """
    compression = features.compression
    tensors = {
        "basis": compression.basis, "codes": features.codes, "sample": features.sample.half(),
        **({} if compression.book is None else {"book": compression.book}),
    }  # fmt: skip
    header = {
        "format": FORMAT, "version": VERSION, "kept": features.kept, "bound": features.bound, "source": features.source,
    }  # fmt: skip
    tensors = {name: tensor.cpu().clone().contiguous() for name, tensor in tensors.items()}
    write_bytes(path, save(tensors, metadata={"semgs": json.dumps(header, allow_nan=False)}))


def load_features(path: str | Path) -> SceneFeatures:
    """Read features, or those in an output folder of `semgs reconstruct`.

    Raises:
        InputError: there are none, or the file is damaged or of a newer version.
    """
    file = Path(path) / FILE_NAME if Path(path).is_dir() else Path(path)
    if not file.is_file():
        advice = "give the folder that `semgs reconstruct --features DIR --out` wrote"
        raise InputError(file, "features of a scene", "no such file", advice=advice)
    with open_tensors(file, "features of a scene") as opened:
        with input_error(file, "JSON", key="metadata.semgs"):
            header = parse_json((opened.metadata() or {}).get("semgs", "null"))
        tensors = {name: opened.get_tensor(name).clone() for name in opened.keys()}  # noqa: SIM118 - not a dict
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError(file, f"features of a scene (format {FORMAT})", "another safetensors file")
    if header.get("version") != VERSION:
        raise InputError(file, f"version {VERSION}", f"version {header.get('version')}", advice="upgrade semgs")
    try:
        return _features(header, tensors)
    except KeyError as error:
        raise InputError(file, f"features with {error.args[0]}", "none") from error
    except (ValueError, TypeError) as error:
        raise InputError(file, "features of a scene", str(error)) from error


def _features(header: dict, tensors: dict[str, Tensor]) -> SceneFeatures:
    """The features of a header and its tensors.

    Raises:
        KeyError, ValueError, TypeError: they are invalid.
    """
    basis, codes, sample, book = tensors["basis"], tensors["codes"], tensors["sample"], tensors.get("book")
    numbers, count = basis.shape
    shapes = {
        "sample": (sample, (len(sample), numbers)),
        "codes": (codes, (len(codes), count) if book is None else (len(codes),)),
        **({} if book is None else {"book": (book, (len(book), count))}),
    }
    for name, (tensor, expected) in shapes.items():
        if tuple(tensor.shape) != expected:
            raise ValueError(f"{name} of shape {tuple(tensor.shape)}; expected {expected}")
        if not torch.isfinite(tensor).all():
            raise ValueError(f"{name} with a number that is not finite")
    if book is not None and len(codes) and int(codes.max()) >= len(book):
        raise ValueError(f"codes up to {int(codes.max())} for a book of {len(book)} entries")
    return SceneFeatures(
        Compression(basis, book), codes, float(header["kept"]), float(header["bound"]), sample.float(), str(header["source"])
    )  # fmt: skip
