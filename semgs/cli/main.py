"""The command `semgs`: runs the named command, and turns errors of input into one line and exit code 2.

Only light modules are imported here, so a Ctrl-C during slower imports is handled like any other.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from semgs._version import __version__
from semgs.cli.terminal import Printable, open_streams
from semgs.files.errors import ERROR_LINE
from semgs.files.text import aligned, did_you_mean, printable
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import BAD_INPUT, UsageError, line_for

INTERRUPTED = 128 + signal.SIGINT
TERMINATED = 128 + signal.SIGTERM
NOBODY_READS = 128 + 13  # SIGPIPE, which does not exist on all systems


RUNS = "semgs.run"
"""The package of commands that the app and batch run, too."""


@dataclass(frozen=True)
class Command:
    """Where a command is implemented; it is imported only when it runs.

    Attributes:
        place: its module in the package, which does not import torch at module level, and the dataclass in it whose fields are
            the options and whose `run` is the command: "scenes.demo:Demo".
        summary: its line in `semgs --help`.
        package: which has the module; one of another distribution may not be installed.
    """

    place: str
    summary: str
    package: str = "semgs.cli.commands"

    def load(self) -> type[Any]:
        """Import the dataclass.

        Raises:
            ImportError: the package is not installed; the message says how to install it.
        """
        module, _, options = self.place.partition(":")
        try:
            return getattr(import_module(f"{self.package}.{module}"), options)
        except ModuleNotFoundError as error:
            if error.name != self.package:
                raise
            distribution = self.package.replace("_", "-")
            raise ImportError(
                f"this command needs the package {distribution}: pip install -e packages/{distribution} in SemGS's folder",
                name=self.package,
            ) from error


COMMANDS = {
    "demo": Command("scenes.demo:Demo", "Reconstruct the included sample room."),
    "reconstruct": Command("reconstruct:Reconstruct", "Turn posed photos of a room into a labelled 3D scene.", RUNS),
    "doctor": Command("doctor:Doctor", "Check a scene's cameras, and name the mistake if they are wrong.", RUNS),
    "poses": Command("poses:Poses", "Estimate the cameras of photos or a clip, and write them as a scene.", RUNS),
    "query": Command("scenes.query:Query", "Find what looks like an embedding in a reconstructed scene."),
    "export": Command("export:Export", "Write a scene for splat viewers, point clouds, ROS or training.", RUNS),
    "render": Command("render:Render", "Render images or a video along a camera path.", RUNS),
    "view": Command("scenes.view:View", "Show a scene in 3D in the browser, or write it as one page."),
    "app": Command("scenes.app:App", "Open a page in the browser that makes labelled rooms from photos."),
    "prepare": Command("prepare:Prepare", "Convert scenes to compact zip files for training.", RUNS),
    "label": Command("label:Label", "Label scenes with a 2D segmenter, to train a network on its answers.", RUNS),
    "label-splat": Command("label_splat:LabelSplat", "Give a splat of another program classes, from its photos.", RUNS),
    "batch": Command("scenes.batch:Batch", "Run a command for many scenes, several at a time."),
    "rooms": Command("rooms_command:Rooms", "Generate synthetic rooms with labels, depth and poses.", "semgs_rooms"),
    "train": Command("networks.train:Train", "Train, or resume training."),
    "evaluate": Command(
        "networks.evaluate:Evaluate", "Score weights, or saved predictions, on a fixed list of frames."
    ),
    "compare": Command("networks.compare:Compare", "Compare reports of evaluate in one table."),
    "weights": Command(
        "networks.weights:Weights", "List the included weights, or describe files: scores, licence, terms."
    ),
    "weights verify": Command("networks.weights:Verify", "Check weights against the published hashes."),
    "weights calibrate": Command("networks.calibrate:Calibrate", "Calibrate confidence on labelled scenes."),
    "export-network": Command(
        "networks.export_network:ExportNetwork", "Write a network as an ONNX file, for programs without PyTorch."
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code.

    Args:
        arguments: without the program's name; None takes those of the process, which then also keeps freed memory for reuse.

    Returns:
        0; 3 if `semgs doctor` finds wrong cameras or `semgs export` wrote only some formats; 2 after unusable input, a missing extra, or an error of the system (full disk, no
        permission, no memory); 130 after an interrupt, 143 after SIGTERM, and 141 if the reader of stdout has gone, as with `| head`. Bugs raise.
    """

    def work() -> int:
        if arguments is not None:
            return _run(list(arguments))
        open_streams()
        from semgs.runtime.free_memory import keep_freed_memory

        keep_freed_memory()
        return _run(sys.argv[1:])

    return run_guarded(work)


def run_guarded(work: Callable[[], int]) -> int:
    """Run some work and return its exit code, or that of `main` for an error that is no bug."""
    ended: list[int] = []
    try:
        with _unwind_on_signals(ended), _shorten_own_warnings():
            code = work()
            sys.stdout.flush()
            return code
    except KeyboardInterrupt:
        return _report_interrupt()
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 0
    except BrokenPipeError:
        if not _has_no_reader(sys.stdout.fileno()):
            raise
        _discard_output()
        return NOBODY_READS
    except Exception as error:
        if ended:  # a library made another exception of ours
            return _report_interrupt() if ended[-1] == INTERRUPTED else ended[-1]
        line = line_for(error)
        if line is None:
            raise
        _discard_output()
        return _report_error(line)


def _report_interrupt() -> int:
    """Say so, and return the exit code."""
    print("semgs: interrupted", file=sys.stderr)
    return INTERRUPTED


def _discard_output() -> None:
    """If stdout cannot be written, discard its buffer, so Python does not fail again when it exits."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _has_no_reader(output: int) -> bool:
    """Whether the pipe has no reader any more. Windows cannot say; there a broken pipe is believed."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(output, select.POLLERR)
    return bool(poll.poll(0))


def _run(arguments: list[str]) -> int:
    """Run the command that the first argument names."""
    if not arguments:
        print(_help(), file=sys.stderr)
        return BAD_INPUT
    words = 2 if " ".join(arguments[:2]) in COMMANDS else 1
    name, rest = " ".join(arguments[:words]), arguments[words:]
    if name in ("-h", "--help", "help"):
        print(_help())
        return 0
    if name in ("-V", "--version"):
        print(f"semgs {__version__}")
        return 0
    if name not in COMMANDS:
        known = f"expected one of {', '.join(COMMANDS)}"
        raise UsageError(f"unknown command {name!r}{did_you_mean(name, COMMANDS)}; {known}; see semgs --help")
    return run_command(COMMANDS[name].load(), f"semgs {name}", rest)


def run_command(options: type[Any], program: str, arguments: Sequence[str]) -> int:
    """Parse the arguments into a dataclass of options, run it, and return the exit code. What a `semgs.run.outcome.Run` says is printed; others print themselves, and
    return their exit code, None for 0.

    Raises:
        UsageError: the options are wrong.
        InputError: a given file cannot be used.
    """
    from semgs.cli.arguments import parse
    from semgs.cli.progress import Terminal

    own, others = options.split(arguments) if hasattr(options, "split") else (arguments, None)
    given = parse(options, program, own)
    with redirect_stdout(Printable(sys.stdout)):
        if isinstance(given, Run):
            return _told(given.run(Terminal()))
        code: int | None = given.run() if others is None else given.run_with(others)
    return code or 0


def _told(outcome: Outcome) -> int:
    """Print what a run says, and return its exit code."""
    if outcome.lines:
        print(*outcome.lines, sep="\n")
    for line in outcome.lacking:
        print(f"{ERROR_LINE}{printable(line)}", file=sys.stderr)
    return outcome.code


def _help() -> str:
    """The text of `semgs --help`."""
    lines = aligned([(f"  {name}", command.summary) for name, command in COMMANDS.items()])
    return "\n".join(
        (
            "Usage: semgs COMMAND [OPTIONS]",
            "",
            "Turns photos of a room into a 3D scene in which everything has a class, in seconds on a CPU.",
            "",
            "commands:",
            *lines,
            "",
            "  semgs COMMAND --help explains a command; semgs --version prints the version.",
        )
    )


def _report_error(line: str) -> int:
    """Print the error on one line."""
    print(f"{ERROR_LINE}{printable(' '.join(line.split()))}", file=sys.stderr)
    return BAD_INPUT


@contextmanager
def _shorten_own_warnings() -> Iterator[None]:
    """Print our own warnings without their place in the code, which does not help a user."""
    usual = warnings.formatwarning

    def format_warning(message: Warning | str, category: type[Warning], *place: Any) -> str:
        own = category.__module__.startswith("semgs.")
        return f"semgs: {printable(str(message))}\n" if own else usual(message, category, *place)

    warnings.formatwarning = format_warning  # type: ignore[assignment]
    try:
        yield
    finally:
        warnings.formatwarning = usual


@contextmanager
def _unwind_on_signals(ended: list[int]) -> Iterator[None]:
    """Let SIGTERM and Ctrl-C unwind the stack, so that incomplete folders are removed. If Ctrl-C is ignored, it stays so.

    Args:
        ended: gets the exit code of each signal that arrives.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(*_: object) -> None:
        ended.append(TERMINATED)
        raise SystemExit(TERMINATED)

    def interrupt(*_: object) -> None:
        ended.append(INTERRUPTED)
        raise KeyboardInterrupt

    before = {signal.SIGTERM: signal.signal(signal.SIGTERM, leave)}
    if signal.getsignal(signal.SIGINT) in (signal.SIG_DFL, signal.default_int_handler):
        before[signal.SIGINT] = signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
