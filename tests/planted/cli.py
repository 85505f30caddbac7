"""Errors planted in `semgs/cli`."""

from __future__ import annotations

from planted.mutant import Mutant

CLI = (
    Mutant(
        "a request to end counts as wrong arguments", "semgs/cli/arguments.py",
        "if leaving.code != REFUSED:", "if leaving.code in (None, 0):",
        ("tests/cli/test_refused_by_the_system.py::test_a_request_to_end_while_arguments_are_parsed_is_none_of_the_arguments",),
    ),
    Mutant(
        "names reach the terminal as they are", "semgs/cli/main.py",
        "redirect_stdout(Printable(sys.stdout))", "redirect_stdout(sys.stdout)",
        ("tests/cli/test_refused_by_the_system.py::test_a_hostile_name_of_a_folder_is_prepared_into_and_shown_but_not_trained_into",),
    ),
    Mutant(
        "a new version is the same task", "semgs/batch/tasks.py",
        "json.dumps([__version__, list(options), contents])", "json.dumps([list(options), contents])", ("tests/batch/test_tasks.py::test_another_version_of_semgs_is_another_task",),
    ),
)  # fmt: skip
