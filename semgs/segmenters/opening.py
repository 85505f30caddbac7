"""Opens segmenters: folders of class maps, exported networks, and models of the Hugging Face hub. A file may say what their classes mean in ours, and how much a segmenter and the network should each vote."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, final

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.files.errors import InputError, input_error
from semgs.files.paths import typed_path
from semgs.files.records import make_record
from semgs.files.strict_json import read_json
from semgs.geometry.cameras import writable
from semgs.runtime.kept import kept
from semgs.segmenters.class_map_files import RECORD, TABLE, MapFiles, Photos, save_table
from semgs.segmenters.class_source import ClassSource, Segmenter, Translated
from semgs.segmenters.exported import open_exported
from semgs.segmenters.huggingface import open_transformers_model
from semgs.segmenters.labelling import ClassVotes
from semgs.segmenters.names import Correspondence, scannet20_of
from semgs.sources.network_files import ENDINGS
from semgs.sources.photo_maps import resized_map, scene_folder, stems_of
from semgs.sources.transformers_models import is_model

Table = Literal["scannet20", "own"]
"""Whether to translate class names to ScanNet's 20 classes, or to keep the segmenter's own table."""

FORMAT = "semgs.correspondence"
VERSION = 1


@final
@dataclass(frozen=True)
class ViewSegmenter:
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
        maps = [
            resized_map(torch.from_numpy(writable(self.segmenter(image))), views.size, views.size) for image in images
        ]
        distributions = torch.stack(maps)
        return distributions if self.correspondence is None else self.correspondence(distributions)

    def source(self, scene: Scene, save: Path | None = None, earlier: Path | None = None) -> ClassSource:
        """The network as a source for a scene's frames.

        Args:
            scene: contains the frames.
            save: new folder for the network's maps; None for none.
            earlier: folder in which an earlier run may have saved maps; those of the same network are used again.

        Raises:
            InputError: an earlier record is damaged, or two frames would share a map.
            OSError: the folder cannot be written.
        """
        made_by = self.segmenter.made_by
        if save is not None:
            stems_of(scene)  # refuses frames that would share a map
            save_table(save, self.segmenter.classes, made_by)
        stored = MapFiles.opened(earlier, scene) if earlier is not None and (earlier / RECORD).is_file() else None
        if stored is not None and (stored.made_by, stored.classes.names) != (made_by, self.segmenter.classes.names):
            stored = None
        photos = Photos(self.segmenter, save, stored)
        return photos if self.correspondence is None else Translated(photos, self.correspondence)


def open_segmenter(name: str | Path, classes: Table = "scannet20", words: Sequence[str] = ()) -> ViewSegmenter:
    """Open a segmentation network.

    Args:
        name: an exported network (.onnx or .tflite with a JSON beside it), a model folder of transformers, or hf:OWNER/NAME.
        classes: the table of its answers.
        words: what a text-prompted model looks for, which makes its own table, whatever `classes` says; () for other models.

    Raises:
        InputError: it cannot be read, is no segmenter, needs words or cannot take any, or less than half of its class names are known.
        ImportError: the library that runs it is not installed.
        ValueError: a word is empty, or two are equal.
    """
    network = open_network(name, words)
    return ViewSegmenter(network, None if words or classes == "own" else _match_names(name, network.classes))


def open_network(name: str | Path, words: Sequence[str] = ()) -> Segmenter:
    """The network of a name, with its own classes; as for `open_segmenter`."""
    if is_model(str(name)):
        return open_transformers_model(str(name), tuple(words))
    path = typed_path(str(name))
    if words:
        raise InputError(path, "a text-prompted model for --words, such as CLIPSeg", "something else")
    if path.suffix.lower() in ENDINGS:
        return open_exported(path)
    expected = f"a segmenter: a folder with {TABLE}, an exported network (.onnx, .tflite), or a model folder"
    raise InputError(path, expected, "something else" if path.exists() else "nothing")


def open_class_sources(
    name: str,
    classes: Table | None = None,
    correspondence: Path | None = None,
    save: Path | None = None,
    earlier: Path | None = None,
    words: Sequence[str] = (),
) -> Callable[[Scene], ClassSource]:
    """Open a segmenter once, for the frames of any scene.

    Class maps of several scenes are in a folder for each, by the scene's name, inside the one that is named; the class table is beside the maps or
    in that one.

    Args:
        name: a folder of class maps (`semgs.segmenters.class_map_files`), or as for `open_segmenter`.
        classes: the table of the answers; None keeps that of class maps, and is "scannet20" for networks and their maps.
        correspondence: a file as for `read_correspondence`, used instead of class names; None for names.
        save: new folder for the maps of a network; None for none.
        earlier: folder in which an earlier run may have saved maps; those of the same network are used again.
        words: as for `open_segmenter`.

    Raises:
        InputError: it cannot be read, is no segmenter, needs words or cannot take any, or less than half of its class names are known. So does
            the returned function.
        ImportError: the library that runs it is not installed.
        ValueError: a word is empty, or two are equal.
    """
    stated = None if correspondence is None else read_correspondence(correspondence)
    path = typed_path(name)
    if is_map_folder(path) and not words:
        return lambda scene: _open_files(scene_folder(path, scene), scene, classes, stated)
    network = kept(open_network, name, tuple(words))
    table: Table = "own" if words else classes or "scannet20"
    return lambda scene: _translate(ViewSegmenter(network).source(scene, save, earlier), name, table, stated)


def is_map_folder(path: Path) -> bool:
    """Whether a path is a folder of class maps, or of such folders for several scenes."""
    return path.is_dir() and not (path / "config.json").is_file()


def _open_files(folder: Path, scene: Scene, classes: Table | None, stated: StatedMeaning | None) -> ClassSource:
    """Class maps as a source."""
    table = folder if (folder / TABLE).is_file() or not (folder.parent / TABLE).is_file() else folder.parent
    files = MapFiles.opened(folder, scene, table)
    own = files.made_by is None and stated is None
    return _translate(files, folder, classes or ("own" if own else "scannet20"), stated)


def _translate(source: ClassSource, name: str | Path, classes: Table, stated: StatedMeaning | None) -> ClassSource:
    """A source in the table that is wanted."""
    if stated is not None:
        if stated.theirs != source.classes.names:
            raise InputError(str(name), f"the classes that {stated.segmenter} has in the correspondence", "others")
        return Translated(source, stated.correspondence)
    return source if classes == "own" else Translated(source, _match_names(name, source.classes))


def _match_names(name: str | Path, classes: ClassTable) -> Correspondence:
    """The correspondence of a table with ScanNet's 20 classes.

    Raises:
        InputError: less than half of the names are known.
    """
    with input_error(str(name), "class names of ADE20K, COCO or NYU40", advice="use --classes own"):
        return scannet20_of(classes.names)


@dataclass(frozen=True)
class StatedMeaning:
    """What a file says about a segmenter.

    Attributes:
        segmenter: name of it.
        theirs: its class names, in order.
        correspondence: from its classes to ours.
        votes: of it and a network; None if the file does not say.
    """

    segmenter: str
    theirs: tuple[str, ...]
    correspondence: Correspondence
    votes: ClassVotes | None = None


def read_correspondence(path: Path) -> StatedMeaning:
    """Read a file; docs/segmenters.md shows how one is made.

    Raises:
        InputError: it is missing or damaged.
    """
    expected = "a correspondence of classes, as in docs/segmenters.md"
    content = read_json(path, expected)
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("version") != VERSION:
        raise InputError(path, expected, "another file")
    try:
        classes = make_record(ClassTable, content["classes"])
        table = np.array(content["table"], dtype=np.float32)
        theirs = tuple(str(name) for name in content["theirs"])
        if table.shape != (len(theirs), len(classes)) or not np.isfinite(table).all() or table.min() < 0:
            raise ValueError(f"table is {table.shape}")
        votes = content["votes"] and ClassVotes(
            **{key: tuple(map(float, row)) for key, row in content["votes"].items()}
        )
        if votes and any(len(row) != len(classes) for row in (votes.theirs, votes.own, votes.bias)):
            raise ValueError(f"votes are not of {len(classes)} classes")
        return StatedMeaning(str(content["segmenter"]), theirs, Correspondence(table, classes), votes)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, expected, f"{type(error).__name__}: {error}") from error
