"""What a user asks the app for, and errors of the worker in words for somebody who sees a page: no folders of the server, no options of the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from semgs.app.uploads import UnusableUploadError, Upload, photo_names
from semgs.files.text import printable
from semgs.run.usage_errors import line_for

OWN = "included network"
DEPTHS = ("network", "sensor", "both")

WORKERS_PHOTO = r"(?<![\w./-])(?:[\w./-]*/)?(?:{})(?![\w-]|\.\w)"
"""A photo by one of the names that the worker gives photos, wherever it is."""


@dataclass(frozen=True)
class RoomOptions:
    """Options of a room.

    Attributes:
        views: input views, 2 to 4; 0 for all photos that add something, at most 12.
        refine: sharpen the Gaussians on the photos.
        segmenter: where the classes come from: `OWN`, or one that the server offers.
        words: classes to look for, separated by commas; for a segmenter that takes words.
        depth: where depth comes from: one of `DEPTHS`, or a source that the server offers.
        first, second: two photos by their number from 1; 0 is unknown.
        metres: distance between the cameras of these [m]; 0 is unknown.
    """

    views: int = 0
    refine: bool = True
    segmenter: str = OWN
    words: str = ""
    depth: str = "network"
    first: int = 0
    second: int = 0
    metres: float = 0.0

    def check(self, segmenters: tuple[str, ...], depths: tuple[str, ...]) -> None:
        """Check values that come from a browser.

        Args:
            segmenters, depths: what the server offers beside the included ones.

        Raises:
            UnusableUploadError: a value is impossible.
        """
        if self.views not in (0, 2, 3, 4):
            raise UnusableUploadError("Choose all photos, or 2 to 4 of them.")
        if self.segmenter not in (OWN, *segmenters) or self.depth not in (*DEPTHS, *depths):
            raise UnusableUploadError("This segmenter or source of depth is not offered here.")
        if len(self.words) > 400:
            raise UnusableUploadError("The words are too long; use at most 400 letters.")
        if any(word.strip().startswith("-") for word in self.words.split(",")):
            raise UnusableUploadError("Words cannot begin with a hyphen.")
        if self.words.strip() and self.segmenter == OWN:
            raise UnusableUploadError(
                "Words need a segmenter that understands them. Choose one under Options, or leave the words out."
            )
        given = (self.first > 0, self.second > 0, self.metres > 0)
        if any(given) and not all(given):
            raise UnusableUploadError(
                "For the scale, give two photos by number and the distance between them in metres."
            )
        if any(given) and (self.first == self.second or not math.isfinite(self.metres) or self.metres > 100):
            raise UnusableUploadError("For the scale, give two different photos and a distance of up to 100 metres.")

    def scale_from(self, photos: Mapping[int, str]) -> tuple[str, ...]:
        """Two photos and the metres between their cameras; empty if the scale is unknown.

        Args:
            photos: of photos without cameras, whose scale can be given, the name of each by its number; else empty.

        Raises:
            UnusableUploadError: a photo that gives the scale is not among these.
        """
        if self.metres <= 0 or not photos:
            return ()
        for number in (self.first, self.second):
            if number not in photos:
                raise UnusableUploadError(
                    f"Photo {number} cannot give the scale, because there is none with this number or it is damaged. Choose another under Options."
                )
        return photos[self.first], photos[self.second], f"{self.metres:g}"


@dataclass(frozen=True)
class Request:
    """A job for the worker, as plain data.

    Attributes:
        kind: "photos", "clip", "archive", or "example" for the included room.
        files: path and name of each uploaded file.
        folder: of the job: the worker puts its results into `room` there.
        options: of the room.
        limits: see `semgs.app.limits`.
    """

    kind: Literal["photos", "clip", "archive", "example"]
    files: list[list[str]]
    folder: str
    options: dict[str, Any]
    limits: dict[str, Any] = field(default_factory=dict)

    def data(self) -> dict[str, Any]:
        """The request for JSON."""
        return asdict(self)


def page_error(error: Exception, request: Request) -> str | None:
    """An error of a run as the page shows it, with the names that the user gave the files; None for a bug."""
    line = str(error) if isinstance(error, UnusableUploadError) else line_for(error)
    return None if line is None else in_names_of_user(getattr(error, "on_page", line), request)


def in_names_of_user(sentence: str, request: Request) -> str:
    """A sentence with the names that the user gave the files, without folders of the server and with options of the command line as words."""
    shown = {path: Upload(Path(path), name).shown for path, name in request.files}
    patterns = [re.escape(path) for path in shown]
    if request.kind == "photos":
        copies = photo_names([name for _, name in request.files])
        shown |= dict(zip(copies, list(shown.values()), strict=True))
        patterns.append(WORKERS_PHOTO.format("|".join(map(re.escape, copies))))
    if patterns:  # all at once: the name of one may be what the worker calls another
        names = re.compile("|".join(patterns))
        sentence = names.sub(
            lambda found: shown.get(found[0], shown.get(found[0].rsplit("/", 1)[-1], found[0])), sentence
        )
    sentence = sentence.replace(f"{request.folder}/work/", "").replace(request.folder, "your files")
    # Such as that of temporary files.
    sentence = re.sub(rf"{re.escape(str(Path(request.folder).parent))}/(?:[\w.-]+/)*", "", sentence)
    sentence = re.sub(
        r"^(?:photos|scene|clip\.\w+)(?=:)",
        {"archive": "Your zip", "clip": "Your clip"}.get(request.kind, "Your photos"),
        sentence,
    )
    sentence = re.sub(r"(?<![\w/])scene/(?=\S)", "", sentence)
    sentence = re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda found: found[1].replace("-", " "), sentence)
    sentence = printable(sentence).strip()
    sentence = re.sub(r"(?<=\. )[a-z]", lambda found: found[0].upper(), sentence)
    if "." not in sentence.split(" ")[0] and not sentence.startswith(tuple(shown.values())):  # names of files stay
        sentence = sentence[:1].upper() + sentence[1:]
    return sentence if sentence.endswith((".", "!", "?")) else f"{sentence}."
