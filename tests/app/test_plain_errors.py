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
        ("photos/Kuche_1.jpg cannot be read", "Küche 1.JPG cannot be read."),
        ("out/cameras/images/A.jpg is dark", "A.jpg is dark."),
        ("--scale-from: no camera was estimated for 'Kuche_1.jpg'; there are a.jpg to c.jpg, or 0 to 1",
         "It cannot be found where Küche 1.JPG was taken, so it cannot give the scale. Choose another photo under Options."),
        ("there is too little memory; see --size and --views", "There is too little memory; use fewer views or smaller photos."),
        ("/rooms/x/work/scene/s: a bag, found /rooms/temporary/tmpa1_b/a.db3: no", "S: a bag, found a.db3: no."),
        ("/rooms/x/work: it; reconstruct it with --scale-from", "Your files/work: it; reconstruct it with scale from."),
    ],
)  # fmt: skip
def test_errors_of_the_command_line_name_neither_folders_nor_options(sentence: str, expected: str):
    request = Request(
        "photos", [["/rooms/x/files/000.jpg", "A.jpg"], ["/rooms/x/files/001.jpg", "Küche 1.JPG"]], "/rooms/x", {}
    )
    assert plain(sentence, request) == expected


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
    assert plain(sentence, Request("photos", files, "/rooms/x", {})) == expected  # without folders, of Windows neither


def test_a_zip_is_named_as_the_user_has_it():
    request = Request("archive", [["/rooms/x/files/000.zip", "flat.zip"]], "/rooms/x", {})
    assert plain("/rooms/x/files/000.zip: it is empty, like 001.jpg", request) == "flat.zip: it is empty, like 001.jpg."
