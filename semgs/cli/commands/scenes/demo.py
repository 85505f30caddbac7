"""`semgs demo`: reconstructs the included room with the included weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semgs.files.strict_json import parse_json
from semgs.run.options.types import Device, Passes, Views
from semgs.run.options.words import Words, optional
from semgs.run.outcome import Outcome, Run
from semgs.run.reconstruct import Reconstruct
from semgs.runtime.notes import Progress


@dataclass(frozen=True)
class Demo(Run):
    """Reconstruct the included sample room with the included weights.

    This is `semgs reconstruct` on a scene of ours, so you can see the output before you use your own photos. Nothing is downloaded.
    """

    out: Annotated[Path, Words(metavar="DIR")] = Path("demo")
    """Output folder: new, empty, or from an earlier demo, which is replaced."""
    views: Views = 2
    """Number of input views."""
    refine: Annotated[Passes, optional()] = -1
    """Refine the Gaussians on the input photos: PASSES steps for each, by default 15. 0 is the paper's single forward pass."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one."""
    html: bool = False
    """Also write scene.html, which shows the scene in 3D. Needs the extra viewer."""
    overwrite: bool = False
    """Replace DIR even if it contains another scene from semgs."""

    def run(self, progress: Progress) -> Outcome:
        """Reconstruct the included room.

        Raises:
            InputError: the output folder cannot be used.
        """
        from semgs.data.demo_scene import demo_scene

        scene = demo_scene()
        overwrite = self.overwrite or _scene_in(self.out) == scene.name
        return Reconstruct(
            scene=scene,
            out=self.out,
            views=self.views,
            refine=self.refine,
            device=self.device,
            html=self.html,
            overwrite=overwrite,
        ).run(progress)


def _scene_in(folder: Path) -> str | None:
    """The name of the scene in an output folder of `semgs reconstruct`; None if the folder is none."""
    try:
        return parse_json((folder / "report.json").read_bytes())["scene"]["name"]
    except (OSError, ValueError, TypeError, KeyError):
        return None
