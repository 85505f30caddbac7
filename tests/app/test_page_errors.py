"""Errors of the worker, as the page shows them."""

from __future__ import annotations

import numpy as np
import pytest

from semgs.app.requests import Request, in_names_of_user, page_error
from semgs.app.uploads import UnusableUploadError
from semgs.data.cameras.lens import Lens
from semgs.files.errors import InputError
from semgs.run.usage_errors import UsageError
from semgs.sfm.scale import NotPlacedError
from semgs.sfm.solving import PosedPhoto


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("a.zip is not a zip that can be read.", "a.zip is not a zip that can be read."),
        ("photos/Kuche_1.jpg cannot be read", "Küche 1.JPG cannot be read."),
        ("out/cameras/images/A.jpg is dark", "A.jpg is dark."),
        ("/rooms/x/work/scene/s: a bag, found /rooms/temporary/tmpa1_b/a.db3: no", "S: a bag, found a.db3: no."),
        ("/rooms/x/work: it; reconstruct it with --scale-from", "Your files/work: it; reconstruct it with scale from."),
    ],
)  # fmt: skip
def test_errors_of_the_command_line_name_neither_folders_nor_options(sentence: str, expected: str):
    request = Request(
        "photos", [["/rooms/x/files/000.jpg", "A.jpg"], ["/rooms/x/files/001.jpg", "Küche 1.JPG"]], "/rooms/x", {}
    )
    assert in_names_of_user(sentence, request) == expected


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("photos/a_1.jpg is dark", "a 1.jpg is dark."),
        ("photos/a_1_2.jpg is dark", "a_1.jpg is dark."),
        ("/rooms/x/files/002.jpg is dark", "a_1_2.jpg is dark."),
        ("photos/a_1_2_2.jpg is like a_1.jpg.", "a_1_2.jpg is like a 1.jpg."),
        ("a_1_4.jpg and Ba_1.jpg are dark", "a_1_4.jpg and Ba_1.jpg are dark."),
    ],
)
def test_a_photo_keeps_its_name_if_the_worker_calls_another_one_so(sentence: str, expected: str):
    files = [[f"/rooms/x/files/00{at}.jpg", name] for at, name in enumerate(("a 1.jpg", "a_1.jpg", "A\\a_1_2.jpg"))]
    assert (
        in_names_of_user(sentence, Request("photos", files, "/rooms/x", {})) == expected
    )  # without folders, of Windows neither


def test_a_zip_is_named_as_the_user_has_it():
    request = Request("archive", [["/rooms/x/files/000.zip", "flat.zip"]], "/rooms/x", {})
    assert (
        in_names_of_user("/rooms/x/files/000.zip: it is empty, like 001.jpg", request)
        == "flat.zip: it is empty, like 001.jpg."
    )


PHOTO = PosedPhoto("a.jpg", Lens((48, 64), (100.0, 100.0), (32.0, 24.0)), np.eye(4))


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (InputError("photos", "two or more photos", "1", page="fewer than two can be used."), "Your photos: fewer than two can be used."),
        (UsageError("too little memory; see --size and --views", "too little memory; use fewer views"), "Too little memory; use fewer views."),
        (
            UsageError("x", NotPlacedError("Kuche_1.jpg", [PHOTO, PHOTO]).on_page),
            "SemGS could not work out where Küche 1.JPG was taken, so it cannot give the scale. Choose another photo under Options.",
        ),
        (UnusableUploadError("a.zip is not a zip that can be read."), "a.zip is not a zip that can be read."),
        (RuntimeError("secret"), None),
    ],
)  # fmt: skip
def test_the_page_shows_what_an_error_says_to_people_without_a_command_line_and_nothing_of_a_bug(
    error: Exception, expected: str | None
):
    request = Request("photos", [["/rooms/x/files/001.jpg", "Küche 1.JPG"]], "/rooms/x", {})
    assert page_error(error, request) == expected
