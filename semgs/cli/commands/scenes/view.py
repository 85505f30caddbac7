"""`semgs view`: shows a scene in 3D in the browser, or writes it as one page."""

from __future__ import annotations

import io
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from semgs.cli.progress import Terminal, show_stage
from semgs.files.atomic import write_text
from semgs.files.contents import refuse_checkpoint
from semgs.files.folders import check_new_file
from semgs.files.paths import existing_folder
from semgs.robotics.object_libraries import check_object_libraries
from semgs.run.opened_scene import check_for_robots, open_given
from semgs.run.options.types import Activated, AllowedHosts, Count, Probability, Views, WeightsOrRandom, at_least
from semgs.run.options.words import Words, one_word, optional, positional
from semgs.run.reconstruct import Reconstruct
from semgs.run.usage_errors import UsageError
from semgs.splats.endings import is_splat, lacks_classes
from semgs.viewer.access import access_to
from semgs.viewer.server import LOOPBACK, check_viewer_library, is_this_machine

if TYPE_CHECKING:
    from semgs.robotics.objects import Objects
    from semgs.scene.opened import OpenedScene
    from semgs.scene.scene_file import SavedScene

SCENE_FILE = "scene.safetensors"
PAGE = ".html"

LAST_PORT = 65535


@dataclass(frozen=True)
class View:
    """Show a scene in 3D in your browser: colour, classes, confidence or depth, with every class on a checkbox.

    SCENE is an output folder of semgs reconstruct, its scene.safetensors, or a splat of another program (PLY, SPZ, glTF). Posed photos, as for semgs reconstruct, are reconstructed first and not saved.
    The viewer runs until Ctrl-C. With --html, it is one page instead, which needs no network and no Python.

    Examples
    - semgs view out/office
    - semgs view scans/office --views 3
    - semgs view out/office --objects
    - semgs view out/office --html office.html
    - semgs view office.ply --cameras scans/office
    """

    excludes: ClassVar = {"--html": ("--port", "--host", "--allow-host")}

    scene: Annotated[Path, positional("SCENE")]
    """Folder from semgs reconstruct, a scene file, a splat, or posed photos."""
    html: Annotated[Path | None, optional("FILE.html")] = None
    """Write the scene as one page and exit."""
    max_gaussians: Annotated[Count | None, Words(metavar="INT", shown="all; 153,600 for --html")] = None
    """Show at most this many Gaussians, those that cover most pixels of the input views. A page of 100,000 has up to 9 MB."""
    min_confidence: Probability = 0.0
    """Gaussians whose likeliest class is less likely than this are unknown."""
    objects: bool = False
    """Show things: the boxes of pieces of furniture, and a colour for each. The scene must be in metres; needs pip install -e '.[objects]'."""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """The direction that is up in the scene's coordinates."""
    cameras: Annotated[Path | None, optional("SCENE")] = None
    """A splat: the scene with its cameras, in its coordinates. Without it, cameras are put around the splat, or inside if it is a room."""
    activated: Activated = "auto"
    """A splat as PLY or glTF: whether scales are lengths and opacities 0 to 1, not logarithms and logits; auto is what they look like."""
    port: Annotated[int, one_word("INT", at_least(1))] = 8080
    """Port of the viewer; if it is taken, the next free one."""
    host: str = LOOPBACK
    """Address of the viewer. Only this machine can reach the default. With another, the viewer needs the token in the printed address, but the connection
    is not encrypted."""
    allow_host: AllowedHosts = ()
    """Another name under which browsers open the viewer, such as that of a notebook's or a company's proxy. Repeatable."""
    views: Annotated[Views | None, optional()] = None
    """Posed photos: number of input views; by default all that add something, at most 12."""
    weights: Annotated[WeightsOrRandom, Words(shown="small")] = None
    """Posed photos: the weights, as for semgs reconstruct."""
    overwrite: bool = False
    """Replace FILE of --html."""

    def run(self) -> None:
        """Show the scene until an interrupt, or write the page.

        Raises:
            InputError: the scene or the address cannot be used, or the page cannot be written.
            UsageError: an option is invalid.
            ImportError: viser, or for --objects scikit-learn or trimesh, is not installed.
        """
        existing_folder(self.scene)
        refuse_checkpoint(self.scene, "a scene or a splat")
        if self.cameras is not None and not is_splat(self.scene):
            raise UsageError(f"--cameras is for splats of other programs; {self.scene} is not one")
        if self.objects and is_splat(self.scene):
            raise lacks_classes(self.scene, "--objects")
        if self.port > LAST_PORT:
            raise UsageError(f"--port is {self.port}; expected 1 to {LAST_PORT}")
        if self._saved and (self.views is not None or self.weights is not None):
            stray = "--views" if self.views is not None else "--weights"
            raise UsageError(f"{stray} is for posed photos; {self.scene} is reconstructed already")
        if self.html is not None:
            self._check_page(self.html)
        check_viewer_library()
        if self.objects:
            check_object_libraries()
        with self._reconstructed() as folder:
            if self.html is None:
                self._show(folder)
            else:
                self._write(folder, self.html)

    @property
    def _saved(self) -> bool:
        """Whether the scene is a reconstruction of ours or a splat."""
        ours = self.scene.suffix == Path(SCENE_FILE).suffix or (self.scene / SCENE_FILE).exists()
        return ours or is_splat(self.scene)

    def _check_page(self, page: Path) -> None:
        """Check that the page can be written."""
        if page.suffix.lower() != PAGE:
            raise UsageError(f"--html is {page}; expected a file name that ends with {PAGE}")
        check_new_file(page, self.overwrite)

    @contextmanager
    def _reconstructed(self) -> Iterator[Path]:
        """The folder or file of the scene; posed photos are reconstructed into a folder that disappears at the end."""
        if self._saved:
            yield self.scene
            return
        with TemporaryDirectory(prefix="semgs-") as folder:
            out = Path(folder) / "scene"
            with redirect_stdout(io.StringIO()):
                Reconstruct(scene=self.scene, out=out, views=self.views, weights=self.weights).run(Terminal())
            print("Reconstructed, and not saved: use semgs reconstruct to save it, or for more options")
            yield out

    def _write(self, path: Path, file: Path) -> None:
        """Write the page."""
        with show_stage("Writing the page"):
            from semgs.viewer.viewer_page import MOST_GAUSSIANS, scene_page

            scene, content = self._open(path)
            page = scene_page(scene, at_most=self.max_gaussians or MOST_GAUSSIANS, **content)
            write_text(file, page.html)
        print(f"{file}: {page.shown:,} of {len(scene.gaussians):,} Gaussians, {file.stat().st_size / 1e6:.1f} MB")

    def _open(self, path: Path) -> tuple[SavedScene, dict[str, Any]]:
        """The scene, and what a page and a viewer of it have in common: keyword arguments of `scene_page` and `open_window`."""
        from semgs.viewer.viewer_cameras import photos_in

        opened = open_given(path, self.cameras, self.up, self.activated)
        if opened.note:
            print(f"note: {opened.note}")
        photos = opened.photos if opened.splat else photos_in(path if path.is_dir() else path.parent, opened.scene)
        return opened.scene, {
            "photos": photos or (),
            "up": opened.up,
            "min_confidence": self.min_confidence,
            "things": self._things(opened),
            "near_photos": not opened.splat or bool(opened.photos),
        }

    def _things(self, opened: OpenedScene) -> Objects | None:
        """The things of the scene, if they are to be shown."""
        if not self.objects:
            return None
        from semgs.export.scene_objects import things_of
        from semgs.scene.upright import up_of

        check_for_robots(self.scene, opened, "--objects", classes=True)
        return things_of(opened.scene, up_of(opened.scene, opened.up))

    def _show(self, path: Path) -> None:
        """Show the viewer until an interrupt."""
        with show_stage("Reading the scene"):
            from semgs.viewer.window import open_window

            scene, content = self._open(path)
        access = access_to(is_this_machine(self.host), self.allow_host)
        if access.token is not None:
            print(
                f"semgs: everyone who can reach {self.host} and has the token can see this scene; the connection is not encrypted",
                file=sys.stderr,
            )
        viewer = open_window(
            scene, at_most=self.max_gaussians, host=self.host, port=self.port, access=access, **content
        )
        with viewer as window, suppress(KeyboardInterrupt):
            if not window.up.certain:
                print(f"note: which way is up is uncertain ({window.up.reason}); set it with --up")
            print(f"Open {window.url} in a browser. Ctrl-C stops the viewer.", flush=True)
            threading.Event().wait()
