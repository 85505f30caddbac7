"""Peak memory: of this process, by part of a run, and of a row of the bench, in its own process.

Linux records the peak memory of a process (`VmHWM`) and lets the process reset it, so each part can be measured.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from semgs.runtime.free_memory import keep_freed_memory, process_bytes

MEGABYTE = 1e6

CHILD_SECONDS = 3600
"""A process that takes longer is stopped."""


def peak_mb() -> float:
    """Peak memory of this process since its start, or since `forget_peak` [10^6 bytes]; NaN on Windows."""
    peak = process_bytes("VmHWM")
    if peak is not None:
        return peak / MEGABYTE
    try:
        import resource
    except ImportError:  # Windows
        return math.nan
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / MEGABYTE


def forget_peak() -> bool:
    """Reset the peak to the current memory; False if the system does not support this."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return False
    return True


class PeakWatch:
    """Peak memory of the process in each part of a run; parts may be nested.

    Attributes:
        peaks: by part [10^6 bytes].
    """

    def __init__(self) -> None:
        self.peaks: dict[str, float] = {}
        self._open: list[str] = []

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        """Measure a part."""
        self._look()
        self._open.append(part)
        self.peaks[part] = 0.0
        yield
        self._look()
        self._open.pop()

    def _look(self) -> None:
        """Add the peak since the last call to all open parts."""
        peak = peak_mb()
        for part in self._open:
            self.peaks[part] = max(self.peaks[part], peak)
        forget_peak()


def peaks_of(name: str) -> dict[str, float] | None:
    """Peak memory of a row's run and of its parts, measured in its own process [10^6 bytes].

    Args:
        name: of the row.

    Returns:
        By part; None if the process failed, for example because memory ran out.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "peaks.json"
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(
                [sys.executable, "-m", "paper.bench.peak_memory", name, str(file)],
                capture_output=True,
                timeout=CHILD_SECONDS,
                check=False,
            )
        try:
            return json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None


def _child(name: str, file: Path) -> None:
    """Run a row once and write the peaks."""
    from paper.bench.measure import WHOLE
    from paper.bench.rows import every_row
    from paper.bench.workloads import PROGRAM_WITH_PEAK, command, prepare

    row = next(row for row in every_row() if row.name == name).run
    keep_freed_memory()  # as the command does
    if row.kind == "command":
        with tempfile.TemporaryDirectory() as folder:
            number = Path(folder) / "peak"
            arguments = command(row, Path(folder) / "out")
            subprocess.run([sys.executable, "-c", PROGRAM_WITH_PEAK, str(number), *arguments], check=True)
            peaks = {WHOLE: float(number.read_text(encoding="ascii"))}
    else:
        work = prepare(row)
        before = peak_mb()
        watch = PeakWatch()
        work(watch)
        peaks = watch.peaks | {WHOLE: max(before, watch.peaks[WHOLE])}
    file.write_text(json.dumps(peaks), encoding="utf-8")


if __name__ == "__main__":
    _child(sys.argv[1], Path(sys.argv[2]))
