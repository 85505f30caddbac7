"""scikit-learn and trimesh (extra `objects`), which are optional: things need them, occupancy does not."""

from __future__ import annotations

from types import ModuleType


def clustering_library() -> ModuleType:
    """sklearn.cluster.

    Raises:
        ImportError: scikit-learn is not installed.
    """
    try:
        import sklearn.cluster
    except ImportError as error:
        raise ImportError(_remedy("scikit-learn"), name="sklearn") from error
    return sklearn.cluster


def box_library() -> ModuleType:
    """trimesh.bounds.

    Raises:
        ImportError: trimesh is not installed.
    """
    try:
        import trimesh.bounds
    except ImportError as error:
        raise ImportError(_remedy("trimesh"), name="trimesh") from error
    return trimesh.bounds


def check_object_libraries() -> None:
    """Check that things can be found.

    Raises:
        ImportError: scikit-learn or trimesh is not installed.
    """
    clustering_library()
    box_library()


def _remedy(library: str) -> str:
    """How to install a library."""
    return f"finding things needs {library}: pip install '.[objects]' in SemGS's folder"
