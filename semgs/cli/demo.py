"""`semgs demo`: the embedded room, the shipped weights, a report to look at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from semgs.cli.reconstruct import Reconstruct
from semgs.files.folders import check_folder


@dataclass(frozen=True)
class Demo:
    """Reconstruct the room that comes with the package, with the weights that come with it.

    It is `semgs reconstruct` on a scene of our own, to see what comes out before you bring your own photos. Nothing is
    downloaded.
    """

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("demo")
    """Folder to write: a new one, an empty one, or with --overwrite one that an earlier run wrote."""
    views: int = 2
    """How many photos go in."""
    device: Annotated[str, tyro.conf.arg(metavar="{auto,cpu,cuda}")] = "auto"
    """Where the network computes; auto takes a CUDA GPU where there is one."""
    overwrite: bool = False
    """Replace DIR if an earlier run wrote it, once the new one is complete."""

    def run(self) -> None:
        """Reconstruct the embedded room.

        Raises:
            InputError: the output folder cannot be used.
        """
        check_folder(self.out, self.overwrite)
        from semgs.rooms.demo import demo_scene

        Reconstruct(
            scene=demo_scene(), out=self.out, views=self.views, device=self.device, overwrite=self.overwrite
        ).run()
