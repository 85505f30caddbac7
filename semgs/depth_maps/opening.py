"""Opens sources of depth maps: folders of maps, exported networks, and models of the Hugging Face hub."""

from __future__ import annotations

from collections.abc import Callable

from semgs.data.scene import Scene
from semgs.depth_maps.depth_source import DepthMaps, Meaning
from semgs.depth_maps.exported_network import open_exported_network
from semgs.depth_maps.frame_maps import FrameMaps
from semgs.depth_maps.map_folder import open_map_folder
from semgs.depth_maps.predicted_maps import DepthNetwork, PredictedMaps
from semgs.depth_maps.transformers_network import open_transformers_network
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.runtime.kept import kept
from semgs.segmenters.networks.network_files import ENDINGS
from semgs.segmenters.networks.transformers_models import is_model

OWN = "maps"
"""Names the scene's own depth maps."""


def open_depth_maps(name: str, meaning: Meaning | None = None) -> Callable[[Scene], DepthMaps]:
    """Open a source of depth maps once, for the frames of any scene.

    Args:
        name: "maps" for the scene's own, a folder of maps (`semgs.depth_maps.map_folder`), an exported network (.onnx or .tflite with a JSON beside
            it), a model folder of transformers, or hf:OWNER/NAME.
        meaning: what the numbers are; None for what the source says, or "scaled" for the scene's own.

    Raises:
        InputError: it cannot be read, or is no such source. So does the returned function.
        ImportError: the library that runs it is not installed.
    """
    if name == OWN:
        return lambda scene: FrameMaps(meaning or "scaled")
    path = typed_path(name)
    network: DepthNetwork | None = None
    if is_model(name):
        network = kept(open_transformers_network, name, meaning)
    elif path.suffix.lower() in ENDINGS:
        network = kept(open_exported_network, path, meaning)
    if network is not None:
        predicted = PredictedMaps(network)
        return lambda scene: predicted
    if path.is_dir():
        return lambda scene: open_map_folder(path, scene, meaning)
    expected = f"{OWN}, a folder of depth maps, an exported network (.onnx, .tflite), a model folder, or hf:OWNER/NAME"
    raise InputError(path, expected, "something else" if path.exists() else "nothing")
