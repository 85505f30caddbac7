"""Errors of the worker, as the page shows them."""

from __future__ import annotations

import pytest

from semgs.app.plain_errors import plain
from semgs.app.requests import Request


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("photos: expected two or more photos, found 1", "Your photos: fewer than two can be used."),
        (
            "photos: expected photos whose cameras can be estimated, found too little overlap (3 photos); take more",
            "Your photos: it cannot be found where they were taken: too little overlap. Take more.",
        ),
        ("a.zip is not a zip that can be read.", "a.zip is not a zip that can be read."),
        ("photos/002.jpg cannot be read", "B.jpg cannot be read."),
        ("out/cameras/images/001.jpg is dark", "A.jpg is dark."),
        ("there is too little memory; see --size and --views", "There is too little memory; use fewer views or smaller photos."),
        ("/rooms/x/work/scene/s: a bag, found /rooms/temporary/tmpa1_b/a.db3: no", "S: a bag, found a.db3: no."),
        ("/rooms/x/work: it; reconstruct it with --scale-from", "Your files/work: it; reconstruct it with scale from."),
    ],
)  # fmt: skip
def test_errors_of_the_command_line_name_neither_folders_nor_options(sentence: str, expected: str):
    request = Request(
        "photos", [["/rooms/x/files/000.jpg", "A.jpg"], ["/rooms/x/files/001.jpg", "B.jpg"]], "/rooms/x", {}
    )
    assert plain(sentence, request) == expected


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("photos/001.jpg is dark", "002.jpg is dark."),
        ("photos/002.jpg is dark", "003.jpg is dark."),
        ("/rooms/x/files/002.jpg is dark", "A\\1.jpg is dark."),
        ("004.jpg is dark", "004.jpg is dark."),
    ],
)
def test_a_photo_keeps_its_name_if_the_worker_calls_another_one_so(sentence: str, expected: str):
    files = [[f"/rooms/x/files/00{at}.jpg", name] for at, name in enumerate(("002.jpg", "003.jpg", "A\\1.jpg"))]
    shown = plain(sentence, Request("photos", files, "/rooms/x", {}))
    assert shown == expected.replace("A\\", "")  # shown names have no folders, of Windows neither


def test_a_zip_is_named_as_the_user_has_it():
    request = Request("archive", [["/rooms/x/files/000.zip", "flat.zip"]], "/rooms/x", {})
    assert plain("/rooms/x/files/000.zip: it is empty, like 001.jpg", request) == "flat.zip: it is empty, like 001.jpg."
