"""`semgs query`: finds what looks like an embedding in a scene whose Gaussians have features."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semgs._version import __version__
from semgs.cli.progress import show_stage
from semgs.files.errors import InputError
from semgs.files.folders import check_folder, own_folder
from semgs.files.text import aligned
from semgs.run.options.words import Words, optional, positional
from semgs.run.usage_errors import UsageError
from semgs.splats.endings import is_splat

if TYPE_CHECKING:
    from torch import Tensor

    from semgs.scene.scene_file import SavedScene
    from semgs.segmenters.features.scene_features import SceneFeatures

LIKEST = 0.9
"""Without a threshold, Gaussians above this quantile of the similarities are written."""

EQUAL = 1e-4
"""Without a threshold, those are written in any case that are most similar up to this: a feature of a whole wall can be that of more than a tenth."""

QUANTILES = (0.0, 0.5, 0.9, 0.99, 1.0)
"""Quantiles of the similarities that are reported."""


@dataclass(frozen=True)
class Query:
    """Find what looks like an embedding in a reconstructed scene.

    SCENE is an output folder of semgs reconstruct --features. The embedding is from the same network as the features: CLIP's
    text encoder for CLIP's features, or the feature of an example. The similarity is the cosine of the two. OUT will contain
    - NNN_similarity.png: a heat map for each input view, hatched where nothing was reconstructed
    - NNN_similarity.tiff: its numbers, as 32-bit floats; NaN where nothing was reconstructed
    - found.ply: the Gaussians above the threshold, for every Gaussian splat viewer, in the frame of the reconstruction's gaussians.ply;
    export.json: the matrix from there to the scene's coordinates
    - query.json: all numbers

    Examples
    - semgs query out/office --embedding mug.npy --out out/mug
    - semgs query out/office --embedding mug.npy --threshold 0.25 --out out/mug --overwrite
    """

    scene: Annotated[Path, positional("SCENE")]
    """Folder from semgs reconstruct --features."""
    embedding: Annotated[Path, Words(metavar="FILE")]
    """The embedding: a .npy file with as many numbers as a feature has."""
    out: Annotated[Path, Words(metavar="OUT")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    threshold: Annotated[float | None, optional("FLOAT")] = None
    """Write the Gaussians whose similarity is above this, from -1 to 1. By default, the tenth of them that is most similar, or more if the most
    similar ones are all equal."""
    overwrite: bool = False
    """Replace an output folder from an earlier run, once the new result is complete."""

    def run(self) -> None:
        """Compare, write the folder, and print a summary.

        Raises:
            InputError: the scene has no features, the embedding does not fit them, or the output folder cannot be used.
            UsageError: the threshold is not from -1 to 1.
        """
        if self.threshold is not None and not -1 <= self.threshold <= 1:
            raise UsageError(f"--threshold is {self.threshold:g}; expected a cosine, from -1 to 1")
        if is_splat(self.scene):
            raise InputError(
                self.scene, "a scene with features", "a splat of another program, which has none", advice="reconstruct its photos with --features"
            )  # fmt: skip
        check_folder(self.out, "query", self.overwrite, (self.scene, self.embedding))
        with show_stage("Reading the scene"):
            from semgs.scene.scene_file import load_scene
            from semgs.segmenters.features.scene_features import FILE_NAME, load_features

            features = load_features(self.scene)
            scene = load_scene(self.scene)
            if len(features.codes) != len(scene.gaussians):
                wanted = f"the features of {len(scene.gaussians)} Gaussians, as in the scene"
                raise InputError(self.scene / FILE_NAME, wanted, f"{len(features.codes)}")
            embedding = read_embedding(self.embedding, features.numbers)
        with own_folder(self.out, "query", self.overwrite) as folder, show_stage("Comparing"):
            numbers = self._write(folder, scene, features, embedding)
        print(_summary(numbers, self.out))

    def _write(self, folder: Path, scene: SavedScene, features: SceneFeatures, embedding: Tensor) -> dict:
        """Write all files; returns the content of query.json."""
        import numpy as np
        import torch

        from semgs.export.export_record import ExportedFile, write_record
        from semgs.export.ply import save_ply
        from semgs.files.atomic import write_json
        from semgs.files.images.colours import heat_picture
        from semgs.files.images.pictures import write_png, write_tiff
        from semgs.scene.confidence import part_of
        from semgs.scene.upright import up_of, upright

        of_gaussians = features.similarity(embedding)
        known = of_gaussians[~of_gaussians.isnan()]
        if not len(known):
            raise InputError(self.scene, "Gaussians with features", "none")
        threshold = self.threshold
        if threshold is None:
            threshold = min(float(known.quantile(LIKEST)), float(known.max()) - EQUAL)
        above = of_gaussians > threshold
        if above.any():
            up = up_of(scene)
            framed = upright(scene, "-y", up)
            save_ply(folder / "found.ply", part_of(framed.scene, above).gaussians)
            write_record(folder, [ExportedFile("found.ply", framed, int(above.sum()))], up)
        maps = features.similarity_maps(embedding, scene.gaussians, scene.cameras, scene.near)
        seen = maps[~maps.isnan()]
        limits = (float(seen.min()), float(seen.max())) if len(seen) else (-1.0, 1.0)
        views = []
        for index, (name, values) in enumerate(zip(scene.frames, maps.numpy(), strict=True)):
            write_png(folder / f"{index:03d}_similarity.png", heat_picture(values, limits))
            write_tiff(folder / f"{index:03d}_similarity.tiff", values)
            here = torch.from_numpy(values[~np.isnan(values)])
            views.append(
                {
                    "frame": name,
                    "similarity": f"{index:03d}_similarity.tiff",
                    "largest": float(here.max()) if len(here) else None,
                    "seen": len(here) / values.size,
                    "above": int((here > threshold).sum()) / values.size,
                }
            )
        numbers = {
            "format": "semgs.query",
            "version": 1,
            "software": f"semgs {__version__}",
            "scene": scene.source,
            "features": features.description,
            "embedding": self.embedding.name,
            "threshold": threshold,
            "gaussians": len(of_gaussians),
            "above": int(above.sum()),
            "quantiles": {f"{share:g}": float(known.quantile(share)) for share in QUANTILES},
            "colours": {"lowest": limits[0], "highest": limits[1]},
            "deviation": {"sample": features.deviation(embedding), "at_most": features.bound},
            "views": views,
        }
        write_json(folder / "query.json", numbers)
        return numbers


def read_embedding(path: Path, count: int) -> Tensor:
    """The embedding in a file, as float32 [n].

    Args:
        path: a `.npy` file with one vector; axes of length 1 are ignored.
        count: the numbers of a feature.

    Raises:
        InputError: it is missing or damaged, or has another length, or a number that is not finite, or is zero.
    """
    import numpy as np
    import torch

    from semgs.files.arrays import read_array

    values = np.asarray(read_array(path), np.float64)
    if values.size != count or max(values.shape, default=0) != count:
        raise InputError(path, f"{count} numbers, as a feature of the scene has", f"shape {values.shape}")
    values = values.reshape(-1)
    if not np.isfinite(values).all():
        raise InputError(path, "finite numbers", "NaN or infinity", key=f"[{int(np.argmin(np.isfinite(values)))}]")
    largest = float(np.abs(values).max())
    if largest == 0:
        raise InputError(path, "an embedding with a direction", "zeros only")
    values = values / largest
    return torch.from_numpy(values / math.sqrt(float(values @ values))).float()


def _summary(numbers: dict, out: Path) -> str:
    """The printed summary."""
    low, middle, high, higher, top = numbers["quantiles"].values()
    found = f"{numbers['above']:,} of {numbers['gaussians']:,} Gaussians are above {numbers['threshold']:.3f}"
    deviation = numbers["deviation"]
    rows = [
        ("features", numbers["features"]),
        ("similarity", f"{low:.3f} to {top:.3f}; median {middle:.3f}, 90 % below {high:.3f}, 99 % below {higher:.3f}"),
        ("found", found if numbers["above"] else f"{found}: try a threshold below {top:.3f}; there is no found.ply"),
        (
            "deviation",
            f"compression changes this similarity by up to {deviation['sample']:.3f} in a sample of the photos' features; "
            f"any similarity by {deviation['at_most']:.3f} at most",
        ),
        *((one["frame"], f"largest {one['largest']:.3f}, {one['above']:.1%} above") for one in numbers["views"] if one["largest"] is not None),
    ]  # fmt: skip
    return "\n".join([*aligned(rows), "", f"{out / 'query.json'}  all numbers"])
