"""Paths that lead nowhere."""

from __future__ import annotations

import subprocess
import sys

import pytest

from semgs.files.errors import InputError
from semgs.files.paths import existing_folder


def test_a_folder_and_a_file_in_it_lead_to_the_folder(tmp_path):
    (tmp_path / "transforms.json").touch()
    assert existing_folder(tmp_path) == tmp_path
    assert existing_folder(tmp_path / "transforms.json") == tmp_path


def test_a_path_that_leads_nowhere_is_told_with_the_part_that_exists(tmp_path):
    with pytest.raises(InputError, match=f"nothing there; the path exists as far as {tmp_path}$"):
        existing_folder(tmp_path / "a" / "b")


def test_a_missing_folder_is_told_without_torch():
    code = (
        "import sys\n"
        "from semgs.files.paths import existing_folder\n"
        "try: existing_folder('nowhere/at/all')\n"
        "except ValueError: print('torch' in sys.modules, 'cv2' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
