"""Shapes and types are checked by beartype while testing, everywhere but in modules that hold only Numba kernels."""

from __future__ import annotations

import pkgutil
from pathlib import Path

import pytest
from jaxtyping import install_import_hook

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"

_modules = pkgutil.walk_packages([str(ROOT / "semgs")], "semgs.", onerror=lambda name: None)
# The hook takes a package's name for all modules in it, so only modules are named.
_names = [module.name for module in _modules if not module.ispkg and not module.name.endswith("_kernels")]
install_import_hook(_names, "beartype.beartype")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference material beside the project; the test is skipped where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("the reference material beside the project is not here")
    return SHARED
