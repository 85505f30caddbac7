"""SemGS: turns posed photos of a room into a semantic 3D scene of Gaussians, in one forward pass."""

from __future__ import annotations

from importlib import import_module

from semgs._version import __version__ as __version__

TYPE_CHECKING = False
"""True for type checkers only. `typing` has the same, but importing it takes 2 ms, in which Ctrl-C still prints a traceback."""

if TYPE_CHECKING:
    from semgs.data.scenes import open_scene
    from semgs.data.views import Views
    from semgs.export.ply import save_ply, save_semantic_ply
    from semgs.geometry.cameras import Cameras
    from semgs.geometry.gaussians import Gaussians
    from semgs.mapping.stream import stream
    from semgs.model.weights.load import load
    from semgs.model.weights.pretrained import SemGS
    from semgs.rendering.render import render
    from semgs.rendering.temperatures import tempered
    from semgs.robotics.objects import Objects, objects
    from semgs.robotics.occupancy import Occupancy, occupancy
    from semgs.robotics.tracking import Ids
    from semgs.scene.photo_refinement import refine
    from semgs.scene.scene_file import SavedScene, load_scene, save_scene
    from semgs.splats.load import load_splat

__all__ = [
    "Cameras", "Gaussians", "Ids", "Objects", "Occupancy", "SavedScene", "SemGS", "Views", "load", "load_scene", "load_splat", "objects", "occupancy", "open_scene", "refine", "render",
    "save_ply", "save_scene", "save_semantic_ply", "stream", "tempered",
]  # fmt: skip

_HOMES = {
    "Cameras": "semgs.geometry.cameras",
    "Gaussians": "semgs.geometry.gaussians",
    "Ids": "semgs.robotics.tracking",
    "Objects": "semgs.robotics.objects",
    "Occupancy": "semgs.robotics.occupancy",
    "SavedScene": "semgs.scene.scene_file",
    "SemGS": "semgs.model.weights.pretrained",
    "Views": "semgs.data.views",
    "load": "semgs.model.weights.load",
    "load_scene": "semgs.scene.scene_file",
    "load_splat": "semgs.splats.load",
    "objects": "semgs.robotics.objects",
    "occupancy": "semgs.robotics.occupancy",
    "open_scene": "semgs.data.scenes",
    "refine": "semgs.scene.photo_refinement",
    "render": "semgs.rendering.render",
    "save_ply": "semgs.export.ply",
    "save_scene": "semgs.scene.scene_file",
    "save_semantic_ply": "semgs.export.ply",
    "stream": "semgs.mapping.stream",
    "tempered": "semgs.rendering.temperatures",
}


def __getattr__(name: str) -> object:
    """Import public names on first use, so that `import semgs` and `semgs --help` do not import torch."""
    if name not in _HOMES:
        raise AttributeError(f"module 'semgs' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
