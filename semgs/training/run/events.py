"""Events for TensorBoard, written in the calling thread.

torch's SummaryWriter writes in a thread of its own, which prints a traceback when the disk is full.
"""

from __future__ import annotations

import os
import socket
import time
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np


class Events:
    """An event file. Numbers and images are in it for certain after `flush`.

    Args:
        folder: where to create it; TensorBoard shows all event files of a folder as one run.
        step: the last step of earlier event files that still counts; TensorBoard drops the later ones.

    Raises:
        ImportError: TensorBoard is not installed.
        OSError: the file cannot be written. The methods raise it too.
    """

    def __init__(self, folder: Path, step: int) -> None:
        from tensorboard.compat.proto import event_pb2
        from tensorboard.summary.writer.record_writer import RecordWriter
        from torch.utils.tensorboard import summary

        self._summary: ModuleType = summary
        self._event: Any = event_pb2.Event
        folder.mkdir(parents=True, exist_ok=True)
        name = f"events.out.tfevents.{int(time.time()):010d}.{socket.gethostname()}.{os.getpid()}.{time.monotonic_ns()}"
        self._records = RecordWriter((folder / name).open("wb"))
        self._write(file_version="brain.Event:2")
        started = event_pb2.SessionLog(status=event_pb2.SessionLog.START)
        self._write(step=step + 1, session_log=started)
        try:
            self.flush()
        except OSError:
            with suppress(OSError):  # the same error again; without a close, Python prints it later
                self.close()
            raise

    def number(self, name: str, value: float | int, step: int) -> None:
        """Add a number."""
        self._write(step=step, summary=self._summary.scalar(name, value))

    def image(self, name: str, image: np.ndarray, step: int) -> None:
        """Add an image [h w 3]: uint8, or floats from 0 to 1."""
        self._write(step=step, summary=self._summary.image(name, image, dataformats="HWC"))

    def flush(self) -> None:
        """Hand everything to the system."""
        self._records.flush()

    def close(self) -> None:
        """Close the file."""
        self._records.close()

    def _write(self, **fields: Any) -> None:
        self._records.write(self._event(wall_time=time.time(), **fields).SerializeToString())
