"""Opens segmenters: folders of class maps, exported networks, and models of the Hugging Face hub."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, final

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.classes import ClassTable
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.files.errors import InputError, input_error
from semgs.files.paths import typed_path
from semgs.segmenters.files import RECORD, TABLE, MapFiles, save_table
from semgs.segmenters.images import Photos, Segmenter
from semgs.segmenters.maps import resized_map
from semgs.segmenters.names import Correspondence, scannet20_of
from semgs.segmenters.source import Source, Translated

Table = Literal["scannet20", "own"]
"""Whether to translate class names to ScanNet's 20 classes, or to keep the segmenter's own table."""


@final
@dataclass(frozen=True)
class Opened:
    """A segmentation network, and the class table of its answers.

    Attributes:
        segmenter: the network.
        correspondence: from its own table to that of the answers; None to keep its own.
    """

    segmenter: Segmenter
    correspondence: Correspondence | None = None

    @property
    def classes(self) -> ClassTable:
        """The table of the answers."""
        return self.segmenter.classes if self.correspondence is None else self.correspondence.classes

    def __call__(self, views: Views) -> Float[Tensor, "v class h w"]:
        """The class distribution of every pixel of views [v], from their images alone."""
        images = (views.images * 255).round().byte().permute(0, 2, 3, 1).cpu().numpy()
        maps = [resized_map(torch.from_numpy(self.segmenter(image)), views.size, views.size) for image in images]
        found = torch.stack(maps)
        return found if self.correspondence is None else self.correspondence(found)

    def source(self, scene: Scene, save: Path | None = None, earlier: Path | None = None) -> Source:
        """The network as a source for a scene's frames.

        Args:
            scene: contains the frames.
            save: new folder for the network's maps; None for none.
            earlier: folder in which an earlier run may have saved maps; those of the same network are used again.

        Raises:
            InputError: an earlier record is damaged.
            OSError: the folder cannot be written.
        """
        made_by = self.segmenter.made_by
        if save is not None:
            save_table(save, self.segmenter.classes, made_by)
        stored = MapFiles.opened(earlier, scene) if earlier is not None and (earlier / RECORD).is_file() else None
        photos = Photos(self.segmenter, save, stored if stored is not None and stored.made_by == made_by else None)
        return photos if self.correspondence is None else Translated(photos, self.correspondence)


def open_segmenter(name: str | Path, classes: Table = "scannet20") -> Opened:
    """Open a segmentation network.

    Args:
        name: an exported network (.onnx or .tflite with a JSON beside it), a model folder of transformers, or hf:OWNER/NAME.
        classes: the table of its answers.

    Raises:
        InputError: it cannot be read, is no segmenter, or less than half of its class names are known.
        ImportError: the library that runs it is not installed.
    """
    found = network(name)
    return Opened(found, None if classes == "own" else _correspondence(name, found.classes))


def network(name: str | Path) -> Segmenter:
    """The network of a name, with its own classes; as for `open_segmenter`."""
    path = typed_path(str(name))
    expected = f"a segmenter: a folder with {TABLE}, an exported network (.onnx, .tflite), or a model folder"
    raise InputError(path, expected, "something else" if path.exists() else "nothing")


def sources(
    name: str, classes: Table | None = None, save: Path | None = None, earlier: Path | None = None
) -> Callable[[Scene], Source]:
    """Open a segmenter once, for the frames of any scene.

    Class maps of several scenes are in a folder for each, by the scene's name, inside the one that is named; the class table is beside
    the maps or in that one.

    Args:
        name: a folder of class maps (`semgs.segmenters.files`), or as for `open_segmenter`.
        classes: the table of the answers; None keeps that of class maps, and is "scannet20" for networks and their maps.
        save: new folder for the maps of a network; None for none.
        earlier: folder in which an earlier run may have saved maps; those of the same network are used again.

    Raises:
        InputError: it cannot be read, is no segmenter, or less than half of its class names are known. So does the returned function.
        ImportError: the library that runs it is not installed.
    """
    path = typed_path(name)
    if is_map_folder(path):
        return lambda scene: _of_files(folder_of(path, scene), scene, classes)
    found = open_segmenter(name, classes or "scannet20")
    return lambda scene: found.source(scene, save, earlier)


def is_map_folder(path: Path) -> bool:
    """Whether a path is a folder of class maps, or of such folders for several scenes."""
    return path.is_dir() and not (path / "config.json").is_file()


def folder_of(folder: Path, scene: Scene) -> Path:
    """The folder with the maps of a scene."""
    return folder / scene.name if (folder / scene.name).is_dir() else folder


def _of_files(folder: Path, scene: Scene, classes: Table | None) -> Source:
    """Class maps as a source."""
    table = folder if (folder / TABLE).is_file() or not (folder.parent / TABLE).is_file() else folder.parent
    found = MapFiles.opened(folder, scene, table)
    if classes == "own" or (classes is None and found.made_by is None):
        return found
    return Translated(found, _correspondence(folder, found.classes))


def _correspondence(name: str | Path, classes: ClassTable) -> Correspondence:
    """The correspondence of a table with ScanNet's 20 classes.

    Raises:
        InputError: less than half of the names are known.
    """
    with input_error(str(name), "class names that mean ScanNet's 20 classes", advice="use --classes own"):
        return scannet20_of(classes.names)
