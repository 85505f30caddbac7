"""`semgs app`: a page in the browser that makes rooms from photos."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semgs.app.jobs import Jobs
from semgs.app.limits import Limits
from semgs.app.page import check_page_library
from semgs.cli.progress import show_stage
from semgs.files.errors import InputError
from semgs.files.folders import lock_folder
from semgs.files.paths import cache_folder, found_at, typed_path
from semgs.run.options.types import AllowedHosts, at_least
from semgs.run.options.words import Words, one_word, optional
from semgs.run.usage_errors import UsageError
from semgs.viewer.access import Access, access_to
from semgs.viewer.server import LOOPBACK, check_viewer_library, is_this_machine, url_of_address

LAST_PORT = 65535


@dataclass(frozen=True)
class App:
    """Open a page in the browser: drop photos, and get a labelled room in 3D.

    The page takes photos (JPEG, PNG, HEIC) without cameras, a clip, or a zip of a scene, and shows each stage. The room can be looked at, measured and
    downloaded. Rooms are made by semgs reconstruct in a process of its own, one at a time; others wait. Photos are kept as long as their room, or for an
    hour if other machines can open the page, so that options can be changed; then small copies of those that the room shows are left. The app runs until Ctrl-C.

    Examples
    - semgs app
    - semgs app --port 8000 --folder rooms
    - semgs app --segmenter segformer.onnx
    - semgs app --host 0.0.0.0
    """

    host: str = LOOPBACK
    """Address to listen on. Only this machine can reach the default. With another, the page needs the token in the printed address, but the connection
    is not encrypted."""
    allow_host: AllowedHosts = ()
    """Another name under which browsers open this page, such as that of a notebook's or a company's proxy. Repeatable."""
    port: Annotated[int, one_word("INT", at_least(0))] = 7860
    """Port to listen on; 0 is any free one."""
    folder: Annotated[Path | None, Words(metavar="DIR", shown="in the user's cache")] = None
    """Where rooms are kept."""
    keep_hours: Annotated[float, one_word("HOURS", at_least(0.0, more=True))] = 24.0
    """Rooms and their photos are deleted after this time."""
    minutes: Annotated[float, one_word("MINUTES", at_least(0.0, more=True))] = 15.0
    """A room may take this long."""
    segmenter: Annotated[tuple[str, ...], optional("SEGMENTER [...]")] = ()
    """Segmenters that the page offers beside the included classes, as for semgs reconstruct."""
    depth: Annotated[tuple[str, ...], optional("SOURCE [...]")] = ()
    """Sources of depth that the page offers, as for semgs reconstruct."""

    def run(self) -> None:
        """Serve until an interrupt.

        Raises:
            InputError: it is not possible to listen on this address, or the folder cannot be used.
            UsageError: an option is invalid.
            ImportError: gradio or viser is not installed.
        """
        if self.port > LAST_PORT:
            raise UsageError(f"--port is {self.port}; expected at most {LAST_PORT}")
        segmenters, depths = (tuple(map(_findable, given)) for given in (self.segmenter, self.depth))
        check_viewer_library()
        with show_stage("Starting"):
            check_page_library()
        access = access_to(is_this_machine(self.host), self.allow_host)
        local = is_this_machine(self.host) and not self.allow_host
        folder = (self.folder or cache_folder() / "app").absolute()
        folder.mkdir(parents=True, exist_ok=True)
        with lock_folder(folder, "a folder that no other semgs app uses", "one in use"):
            self._serve(folder, local, access, segmenters, depths)

    def _serve(
        self, folder: Path, local: bool, access: Access, segmenters: tuple[str, ...], depths: tuple[str, ...]
    ) -> None:
        """Serve rooms in a folder until an interrupt."""
        from semgs.app.serving import application, serve

        kept = 3600 * self.keep_hours
        photos_kept = kept if local else Limits.uploads_kept_seconds  # on a server, photos go before their room
        limits = Limits(seconds=60 * self.minutes, kept_seconds=kept, uploads_kept_seconds=photos_kept)
        worker = [sys.executable, "-m", "semgs.app.worker"]
        jobs = Jobs(folder / "rooms", worker, limits, segmenters, depths, uploads=folder / "uploads")
        try:
            app = application(jobs, local=local, access=access)
            with suppress(KeyboardInterrupt):
                serve(app, self.host, self.port, lambda port: self._say(port, access.token))
        except OSError as error:
            raise InputError(
                self.host, f"an address of this machine, with port {self.port} free", str(error.strerror or error)
            ) from error
        finally:
            jobs.close()

    def _say(self, port: int, token: str | None) -> None:
        """Print the address."""
        url = url_of_address(self.host, port)
        if token is not None:
            print(
                f"semgs: everyone who can reach {self.host} and has the token can use this app; the connection is not encrypted",
                file=sys.stderr,
            )
            url += f"/?token={token}"
        print(f"Open {url} in a browser. Ctrl-C stops the app.", flush=True)


def _findable(source: str) -> str:
    """A segmenter or a source of depth as workers find it, which run in other folders.

    Raises:
        InputError: there is no such file or folder.
    """
    if source.startswith("hf:"):
        return source
    path = typed_path(source)
    if not path.exists():
        raise InputError(
            path,
            "an exported network (.onnx, .tflite), a model folder of transformers, or hf:OWNER/NAME",
            found_at(path),
        )
    return str(path.absolute())
