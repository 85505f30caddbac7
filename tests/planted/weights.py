"""Errors planted in `semgs/weights`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_PRETRAINED = ("tests/model/weights/test_pretrained.py",)

WEIGHTS = (
    Mutant(
        "weights for the hub are always rounded to bfloat16", "semgs/model/weights/pretrained.py",
        "return torch.bfloat16 if exact else torch.float32", "return torch.bfloat16", OF_PRETRAINED,
    ),
    Mutant(
        "changed weights keep their scores", "semgs/model/weights/pretrained.py",
        "kept.pop(SCORES, None)", "pass", OF_PRETRAINED,
    ),
    Mutant(
        "a network from the hub forgets its provenance", "semgs/model/weights/pretrained.py",
        "dict(header.metadata), header.checksum", "{}, header.checksum", OF_PRETRAINED,
    ),
    Mutant(
        "a network from the hub has gradients", "semgs/model/weights/pretrained.py",
        "model.eval().requires_grad_(False)", "model.eval()", OF_PRETRAINED,
    ),
    Mutant(
        "a page on the hub states a licence that nobody gave", "semgs/model/weights/model_page.py",
        "    if licence is not None:\n", "    licence = licence or 'Apache-2.0'\n    if licence is not None:\n", OF_PRETRAINED,
    ),
    Mutant(
        "the cache alone is asked for its newest revision", "semgs/model/weights/hub.py",
        "requested.repository, revision=revision, local_files_only=True", "requested.repository, revision=None, local_files_only=True", OF_PRETRAINED,
    ),
    Mutant(
        "an upload goes to the main branch", "semgs/model/weights/hub.py",
        "revision=branch", "revision=None", OF_PRETRAINED,
    ),
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
        'with readable(path), Path(path).open("rb") as opened:',
        'with Path(path if __import__("os").access(path, 4) else "/dev/null").open("rb") as opened:',
        ("tests/cli/test_refused_by_the_system.py::test_what_may_not_be_read_is_named",),
    ),
    Mutant(
        "the metadata of a file is in any order", "semgs/files/tensor_files.py",
        "dict(sorted(metadata.items()))", "dict(metadata)", ("tests/model/weights/test_weights_file.py::test_equal_networks_are_equal_files",),
    ),
)  # fmt: skip
