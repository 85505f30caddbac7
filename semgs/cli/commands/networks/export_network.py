"""`semgs export-network`: writes a network as an ONNX file, for programs without PyTorch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semgs.cli.progress import show_stage
from semgs.files.folders import check_new_file
from semgs.files.paths import files_among
from semgs.run.options.types import Size, Views, Weights
from semgs.run.options.words import Words, positional
from semgs.run.usage_errors import UsageError, what_the_user_gave

MOST_VIEWS = 16
"""More views would make a graph that takes hours to export; the weights learned from 2 to 4."""


@dataclass(frozen=True)
class ExportNetwork:
    """Write a network as one ONNX file, which runs in ONNX Runtime (Python, C++, C#, Java) without PyTorch and SemGS.

    The file takes images, poses, intrinsics and depth bounds, and gives the arrays of the Gaussians and the depth of each pixel. It is for
    a fixed number of views of a fixed size. It uses only operators of ONNX's standard (opset 20) and computes in float32; see docs/onnx.md,
    and examples/onnx for programs that use it.

    This takes a minute or more, and much memory for base.

    Examples
    - semgs export-network small --views 2 --size 240x320 --out small.onnx
    - semgs export-network runs/mine/weights.safetensors --views 4 --size 480x640 --out mine.onnx
    """

    weights: Annotated[Weights, positional("WEIGHTS")]
    """"small" for the included weights, a weights file, or hf://OWNER/NAME on the hub."""
    out: Annotated[Path, Words(metavar="FILE")]
    """Output file."""
    views: Views = 2
    """Number of input views, at most 16."""
    size: Size = (240, 320)
    """Height x width of the images, multiples of 16."""
    overwrite: bool = False
    """Replace FILE."""

    def run(self) -> None:
        """Write the file, and print what it contains.

        Raises:
            InputError: weights or files cannot be used.
            UsageError: an option is invalid.
            ImportError: the extra `onnx` is not installed.
        """
        if self.views > MOST_VIEWS:
            raise UsageError(f"--views is {self.views}; expected 2 to {MOST_VIEWS}")
        check_new_file(self.out, self.overwrite, files_among(self.weights))
        with show_stage("Starting"):
            from semgs.files.atomic import write_bytes
            from semgs.model.onnx.onnx_file import check_fixed_size, check_onnx_libraries, onnx_bytes
            from semgs.model.weights.load import data_terms, find, load, table_of

            with what_the_user_gave():
                check_fixed_size(self.size)
                name, path = find(self.weights)
            check_onnx_libraries()
            network = load(name, path, classes=table_of(path))
            terms = {"data_terms": "\n".join(one.text for one in data_terms(path))}
        content = onnx_bytes(network, self.views, self.size, terms, stage=show_stage)
        write_bytes(self.out, content)
        height, width = self.size
        print(
            f"{self.out}: {name} for {self.views} views of {height}x{width}, {len(content) / 1e6:.1f} MB; opset 20, float32"
        )
