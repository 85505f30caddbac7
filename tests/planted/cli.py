"""Errors planted in `semgs/cli`."""

from __future__ import annotations

from planted.mutant import Mutant

CLI = (
    Mutant(
        "a word that names no preset is one", "semgs/cli/arguments.py",
        "if preset and preset not in presets:", "if not preset:",
        ("tests/cli/test_arguments.py::test_what_was_mistyped_is_named_with_the_nearest_that_there_is",),
    ),
    Mutant(
        "only the first option that is missing is named", "semgs/cli/arguments.py",
        "missing = [one.named for one in found if one.default is MISSING and one.path not in values]",
        "missing = [one.named for one in found if one.default is MISSING and one.path not in values][:1]",
        ("tests/cli/test_arguments.py::test_missing_arguments_are_named_without_their_help",),
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
