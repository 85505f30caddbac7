"""Shapes and types are checked by beartype while testing. Without CHECK_TYPES, which `make long` sets, only in functions whose annotations have shapes:
other types are mypy's to check, and checking them at each call takes a sixth of the time of all tests, in rooms half."""

from __future__ import annotations

import dataclasses
import gc
import os
import re
import signal
import sys
import warnings
import zlib
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jaxtyping
import pytest
import torch
from jaxtyping import AbstractArray, AbstractDtype, install_import_hook
from kernels import compile_all

# Collecting tests makes millions of objects that stay, and none that could go.
gc.disable()

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"


def _is_checked(module: Path) -> bool:
    """Whether beartype checks the calls of the functions in a file. The hook takes a package's name for all modules in it, so only modules are named."""
    if module.name == "__init__.py" or module.stem.endswith("_kernels"):
        return False
    if os.environ.get("CHECK_TYPES"):
        return True
    return ROOT / "semgs/rooms" not in module.parents and "jaxtyping" in module.read_text()


def _checked_modules() -> list[str]:
    """The modules whose calls beartype checks. None is imported to find them: the hook comes too late for what is."""
    files = [file for file in sorted((ROOT / "semgs").rglob("*.py")) if _is_checked(file)]
    return [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files]


def _has_shapes(checked: Any) -> bool:
    """Whether annotations of a function, or of a dataclass's fields, name a type with a shape: jaxtyping's, or a module's name for one of them."""
    if isinstance(checked, property):
        return any(map(_has_shapes, filter(None, (checked.fget, checked.fset))))
    if dataclasses.is_dataclass(checked):
        annotations = [field.type for field in dataclasses.fields(checked)]
        names = vars(sys.modules[checked.__module__])
    else:
        function = getattr(checked, "__func__", checked)
        annotations, names = (
            list(getattr(function, "__annotations__", {}).values()),
            getattr(function, "__globals__", {}),
        )
    values = (names.get(word) for annotation in annotations for word in re.findall(r"\w+", str(annotation)))
    return any(isinstance(value, type) and issubclass(value, (AbstractDtype, AbstractArray)) for value in values)


def _with_shapes_checked(*, typechecker: Any) -> Callable[[Any], Any]:
    """What the hook below decorates with: jaxtyping's decorator, where there are shapes to check. It compiles two checks for each function."""
    decorated = _jaxtyped(typechecker=typechecker)
    return lambda checked: decorated(checked) if _has_shapes(checked) else checked


_jaxtyped = jaxtyping.jaxtyped
if not os.environ.get("CHECK_TYPES"):
    jaxtyping.jaxtyped = _with_shapes_checked
install_import_hook(_checked_modules(), "beartype.beartype")
assert not [name for name in sys.modules if name.startswith("semgs.")]

# Commands that tests start would compute with as many threads as cores are free, and rounding depends on their number.
os.environ.setdefault("OMP_NUM_THREADS", str(torch.get_num_threads()))


def pytest_sessionstart(session: pytest.Session) -> None:
    """Ctrl-C works in tests and what they start, also in the background of a shell, which makes it ignored. Where tests go to
    several workers, what they all need is compiled first."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if getattr(session.config.option, "numprocesses", None) and not hasattr(session.config, "workerinput"):
        compile_all()


def pytest_collection_finish() -> None:
    """From here on, garbage is collected, but never searched for among what was imported: that would take a second each time."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """What a test or its fixtures draw without a seed depends on the test's name, and not on what ran before it in the same process."""
    torch.default_generator.manual_seed(zlib.crc32(item.nodeid.encode()))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference material beside the project; the test is skipped where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("the reference material beside the project is not here")
    return SHARED


@pytest.fixture(scope="session")
def cuda() -> Iterator[torch.device]:
    """A CUDA device on which float32 is float32 (no TF32); the test is skipped where there is none."""
    if not torch.cuda.is_available():
        pytest.skip("torch finds no CUDA device here")
    layers = (torch.backends.cudnn.conv, torch.backends.cuda.matmul)  # type: ignore[attr-defined]
    before = [layer.fp32_precision for layer in layers]
    for layer in layers:
        layer.fp32_precision = "ieee"
    yield torch.device("cuda")
    for layer, precision in zip(layers, before, strict=True):
        layer.fp32_precision = precision


@pytest.fixture(params=["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def device(request: pytest.FixtureRequest) -> torch.device:
    """The CPU and, in tests that then are marked `gpu`, a CUDA device."""
    return torch.device("cpu") if request.param == "cpu" else request.getfixturevalue("cuda")


@pytest.fixture(scope="session")
def gsplat(cuda: torch.device) -> torch.device:
    """A CUDA device that gsplat draws on, compiled; the test is skipped where gsplat is not installed."""
    if find_spec("gsplat") is None:
        pytest.skip("gsplat is not installed; pip install '.[cuda]' in SemGS's folder")
    from semgs.rendering.gsplat_backend import rasterizer

    with warnings.catch_warnings():  # torch's compiler of extensions has advice to give
        warnings.simplefilter("ignore")
        rasterizer()
    return cuda
