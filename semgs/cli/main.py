"""The command `semgs`: finds the command that was named, runs it, turns errors of input into one line and exit code 2.

Only light modules are imported here: a Ctrl-C while the others are is caught like any later one.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from semgs import __version__
from semgs.cli.errors import UsageError, line_for
from semgs.cli.terminal import Plain, open_streams
from semgs.files.text import printable

BAD_INPUT = 2
INTERRUPTED = 128 + signal.SIGINT
TERMINATED = 128 + signal.SIGTERM
NOBODY_READS = 128 + 13  # SIGPIPE, which some systems do not know


@dataclass(frozen=True)
class Command:
    """Where a command lives; it is imported only when it is called.

    Attributes:
        module: holds the command and imports no torch at its head.
        options: the dataclass in it whose fields are the options and whose `run()` is the command.
        summary: its line in `semgs --help`.
    """

    module: str
    options: str
    summary: str


COMMANDS = {
    "demo": Command("semgs.cli.demo", "Demo", "Reconstruct the embedded room, to see what comes out."),
    "reconstruct": Command(
        "semgs.cli.reconstruct", "Reconstruct", "Turn posed photos of a room into a labelled 3D scene."
    ),
    "prepare": Command(
        "semgs.cli.prepare", "Prepare", "Turn scenes of any known layout into small ones, one file each."
    ),
    "rooms": Command("semgs.cli.rooms", "Rooms", "Draw a labelled data set of synthetic rooms from a seed."),
    "rooms bake": Command("semgs.cli.bake", "Bake", "Make furniture for rooms from a seed, with Infinigen."),
    "train": Command(
        "semgs.cli.train", "Train", "Train a network on rooms or scenes of your own; goes on where it was left."
    ),
    "evaluate": Command("semgs.cli.evaluate", "Evaluate", "Score weights, or anybody's predictions, on named frames."),
    "ablate": Command("semgs.cli.ablate", "Ablate", "Train and score the rows of the paper's ablation."),
    "compare": Command("semgs.cli.compare", "Compare", "Print a table of reports that evaluate or bench wrote."),
    "weights": Command("semgs.cli.weights", "Weights", "List weights: what ships, or files; scores, licence, terms."),
    "weights verify": Command("semgs.cli.weights", "Verify", "Compare weights with the hashes of those that ship."),
    "weights calibrate": Command(
        "semgs.cli.calibrate", "Calibrate", "Fit how sure weights may be, on labelled scenes."
    ),
    "figure": Command("semgs.cli.figure", "Figure", "Draw the paper's comparison figures of your weights and scenes."),
    "bench": Command("semgs.cli.bench", "Bench", "Measure time and memory on this machine."),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code.

    Args:
        arguments: without the program's name; None takes those of the process, which is the program then and keeps what memory it frees.

    Returns:
        0; 2 after input that cannot be used, an extra that is not installed, or something that the system refuses (a full disk, no permission,
        no memory); 130 and 143 after an interrupt and a request to end; 141 where nobody reads on, as before `| head`. Faults of ours raise.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with _ended_like_interrupted(), _own_warnings_on_one_line():
            if arguments is None:
                open_streams()
                from semgs.reconstruction.allocator import keep_freed_memory

                keep_freed_memory()
            code = _run(given)
            sys.stdout.flush()
            return code
    except KeyboardInterrupt:
        print("semgs: interrupted", file=sys.stderr)
        return INTERRUPTED
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 0
    except BrokenPipeError:
        if not _closed(sys.stdout.fileno()):
            raise
        _settle_output()
        return NOBODY_READS
    except Exception as error:
        line = line_for(error)
        if line is None:
            raise
        _settle_output()
        return _refuse(line)


def _settle_output() -> None:
    """Where stdout takes no more, let what is left in its buffer go nowhere when Python ends, instead of failing once more."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _closed(output: int) -> bool:
    """Whether the pipe that is written to has no reader left."""
    poll = select.poll()
    poll.register(output, select.POLLERR)
    return bool(poll.poll(0))


def _run(arguments: list[str]) -> int:
    """Run the command that the first argument names.

    Raises:
        UsageError: there is none of that name, or its options are wrong.
        InputError: it was given files that cannot be used.
    """
    if not arguments:
        print(_help(), file=sys.stderr)
        return BAD_INPUT
    words = 2 if " ".join(arguments[:2]) in COMMANDS else 1  # a folder that is called bake is ./bake
    name, rest = " ".join(arguments[:words]), arguments[words:]
    if name in ("-h", "--help", "help"):
        print(_help())
        return 0
    if name in ("-V", "--version"):
        print(f"semgs {__version__}")
        return 0
    if name not in COMMANDS:
        from semgs.cli.arguments import nearest

        known = ", ".join(COMMANDS)
        raise UsageError(
            f"unknown command {name!r}{nearest(name, COMMANDS)}; expected one of {known}; see semgs --help"
        )
    from semgs.cli.arguments import parse

    command = COMMANDS[name]
    options = parse(getattr(import_module(command.module), command.options), name, rest)
    with redirect_stdout(Plain(sys.stdout)):
        options.run()
    return 0


def _help() -> str:
    """What `semgs --help` says."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {command.summary}" for name, command in COMMANDS.items()]
    return "\n".join(
        (
            "usage: semgs COMMAND [OPTIONS]",
            "",
            "From two to four posed photos of a room to a semantic 3D scene of Gaussians, in one forward pass.",
            "",
            "commands:",
            *lines,
            "",
            "  semgs COMMAND --help tells about a command, semgs --version which version this is.",
        )
    )


def _refuse(line: str) -> int:
    """Tell why, on one line."""
    print(f"semgs: error: {printable(' '.join(line.split()))}", file=sys.stderr)
    return BAD_INPUT


@contextmanager
def _own_warnings_on_one_line() -> Iterator[None]:
    """Print warnings of our own categories without their place in the code, which is nothing to a user."""
    usual = warnings.formatwarning

    def shown(message: Warning | str, category: type[Warning], *place: Any) -> str:
        own = category.__module__.startswith("semgs.")
        return f"semgs: {printable(str(message))}\n" if own else usual(message, category, *place)

    warnings.formatwarning = shown  # type: ignore[assignment]
    try:
        yield
    finally:
        warnings.formatwarning = usual


@contextmanager
def _ended_like_interrupted() -> Iterator[None]:
    """Let a request to end (SIGTERM) unwind the stack as an interrupt does, so that half-made folders are removed."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(*_: object) -> None:
        raise SystemExit(TERMINATED)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
