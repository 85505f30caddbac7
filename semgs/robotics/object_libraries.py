"""scikit-learn and trimesh (extra `objects`), which are optional: things need them, occupancy does not."""

from __future__ import annotations

from types import ModuleType

from semgs.files.errors import needs_extra


def clustering_library() -> ModuleType:
    """sklearn.cluster.

    Raises:
        ImportError: scikit-learn is not installed.
    """
    with needs_extra("objects", "finding things needs scikit-learn", "sklearn"):
        import sklearn.cluster
    return sklearn.cluster


def box_library() -> ModuleType:
    """trimesh.bounds.

    Raises:
        ImportError: trimesh is not installed.
    """
    with needs_extra("objects", "finding things needs trimesh", "trimesh"):
        import trimesh.bounds
    return trimesh.bounds


def check_object_libraries() -> None:
    """Check that things can be found.

    Raises:
        ImportError: scikit-learn or trimesh is not installed.
    """
    clustering_library()
    box_library()
