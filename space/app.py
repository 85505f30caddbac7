"""The app as a Space of the Hugging Face hub: public, on a CPU. What a Space writes is lost when it restarts."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from semgs.app.jobs import Jobs
from semgs.app.limits import MIB, Limits
from semgs.app.serving import application, serve
from semgs.viewer.access import Access

LIMITS = Limits(
    file_bytes=128 * MIB,
    total_bytes=256 * MIB,
    photos=30,
    unpacked_bytes=512 * MIB,
    seconds=600.0,
    disk_bytes=4096 * MIB,
    waiting=10,
    uploads_bytes=2048 * MIB,
    rooms_bytes=8192 * MIB,
)
"""Less than on your own machine, because strangers share this one."""

HUB = ("https://huggingface.co",)
"""Whose pages show the Space in a frame."""


def main() -> None:
    """Serve until the Space stops."""
    with tempfile.TemporaryDirectory(prefix="semgs-") as folder:
        jobs = Jobs(Path(folder) / "rooms", [sys.executable, "-m", "semgs.app.worker"], LIMITS)
        try:
            own = os.environ.get("SPACE_HOST", "").lower()
            app = application(jobs, local=False, access=Access(None, None, (own,) if own else (), HUB))
            port = int(os.environ.get("GRADIO_SERVER_PORT", "7860"))
            serve(app, "0.0.0.0", port, lambda port: print(f"Listening on port {port}", flush=True))
        finally:
            jobs.close()


if __name__ == "__main__":
    main()
