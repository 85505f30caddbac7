"""Errors planted in `semgs/weights`."""

from __future__ import annotations

from planted.mutant import Mutant

WEIGHTS = (
    Mutant(
        "tensors of weights are not compared with their checksum", "semgs/model/weights/weights_file.py",
        "!= found:", "is None:", ("tests/model/weights/test_crafted.py",),
    ),
    Mutant(
        "a loaded network has gradients", "semgs/model/weights/load.py",
        "model.eval().requires_grad_(False)", "model.eval()", ("tests/model/weights/test_load.py",),
    ),
    Mutant(
        "weights that may not be read count as somebody else's", "semgs/model/weights/weights_file.py",
        'Path(path).open("rb").close()', "pass",
        ("tests/cli/test_refused_by_the_system.py::test_what_may_not_be_read_is_named",),
    ),
)  # fmt: skip
