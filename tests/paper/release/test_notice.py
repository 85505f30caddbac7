"""NOTICE: the works that ask for attribution, from what `semgs rooms` writes beside its scenes."""

from __future__ import annotations

from pathlib import Path

import pytest

from paper.release.notice import HEAD, PHOTOS, TUM, notice, photos
from semgs_rooms.assets.catalogue import FileSource
from semgs_rooms.assets.lock import LockEntry, attribution, read_lock

ROOT = Path(__file__).resolve().parents[3]


def row(file: str, licence: str, author: str = "") -> LockEntry:
    return LockEntry(file, FileSource(f"owner/{file[0]}", "0123456789abcdef", f"in/{file}", licence, author), "")


LOCK = (row("a.glb", "CC-BY-4.0", "Ann"), row("b.glb", "CC0-1.0"), row("c.glb", "CC-BY-4.0", "Ann"), row("d.jpg", "CC-BY-3.0"))  # fmt: skip


def test_works_that_ask_for_it_are_named_once_each_by_licence_and_author():
    texts = [attribution(files, LOCK) for files in (["c.glb", "b.glb"], ["a.glb", "c.glb", "d.jpg"])]
    assert notice(texts) == HEAD + "\n" + "\n".join(
        [
            "CC-BY-3.0", "  - d.jpg: owner/d@0123456789ab, in/d.jpg", "",
            "CC-BY-4.0, by Ann", "  - a.glb: owner/a@0123456789ab, in/a.glb", "  - c.glb: owner/c@0123456789ab, in/c.glb", "",
        ]
    )  # fmt: skip


def test_photos_are_named_by_licence_with_what_leads_to_their_authors():
    listed = [
        {"set": "coco_permissive", "path": "a/9.jpg", "licence_id": 5, "flickr_url": "http://photos.example/9.jpg"},
        {"set": "openimages_doordetect", "path": "images/b2.jpg"},
        {"set": "polyhaven_hdri_crops", "path": "hdri/c.hdr"},
        {"set": "openimages_doordetect", "path": "images/a1.jpg"},
        {"set": "tum_rgbd", "path": "9.png", "sequence": "freiburg2_desk"},
        {"set": "tum_rgbd", "path": "8.png", "sequence": "freiburg2_desk"},
    ]
    assert photos(listed).removeprefix(PHOTOS).splitlines() == [
        "", "CC BY 2.0, Open Images V4, by way of MiguelARD/DoorDetect-Dataset (2 photos)", "  a1 b2",
        "", "CC BY-SA 2.0, COCO", "  - http://photos.example/9.jpg", "", TUM, "  - freiburg2_desk",
    ]  # fmt: skip


@pytest.mark.parametrize("text", ["", "# Attribution\n", "- `a`: o/a@1, `p`\n", "## CC-BY-4.0\n\n- somebody's chair\n"])
def test_something_else_is_refused(text: str):
    with pytest.raises(ValueError, match=r"expected|without a licence"):
        notice([text])


def test_the_notice_that_ships_is_of_the_locked_assets():
    text = (ROOT / "NOTICE").read_text()
    assert text.startswith(HEAD)
    text, _, networks = text.partition("\nThe class branch")
    assert "Apache-2.0" in networks
    named = {line.strip("- ").partition(":")[0] for line in text.splitlines() if line.startswith("  - ")}
    assert named <= {one.file for one in read_lock() if one.origin.licence.startswith("CC-BY")}
    assert named
