"""Errors of the worker in words for somebody who sees a page: no folders of the server, no options of the command line."""

from __future__ import annotations

import re
from pathlib import Path

from semgs.app.requests import Request
from semgs.app.uploads import Upload, photo_names
from semgs.files.text import printable

WORKERS_PHOTO = r"(?<![\w./-])(?:[\w./-]*/)?(?:{})(?![\w-]|\.\w)"
"""A photo by one of the names that the worker gives photos, wherever it is."""

PLAIN = (
    (
        r"expected photos whose cameras can be estimated, found (.+?)(?: \(\d+ photos\))?; ",
        r"it cannot be found where they were taken: \1. ",
    ),
    (
        r"scale from: no camera was estimated for '(.+?)';.*",
        r"it cannot be found where \1 was taken, so it cannot give the scale. Choose another photo under Options",
    ),
    (r"expected two or more photos, found (?:1|none)(?:; )?", "fewer than two can be used. "),
    (r"expected a video that OpenCV can decode, found no frames; ", "it cannot be decoded. "),
    (r"expected a scene, found no known layout", "it has neither photos nor a scene in a layout that is known here"),
)
"""Errors of the command line that users of the page meet most, in words for them."""


def plain(sentence: str, request: Request) -> str:
    """An error of the command line as the page shows it, with the names that the user gave the files."""
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
    sentence = sentence.replace("; see --size and --views", "; use fewer views or smaller photos")
    sentence = re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda found: found[1].replace("-", " "), sentence)
    for pattern, words in PLAIN:
        sentence = re.sub(pattern, words, sentence)
    sentence = printable(sentence).strip()
    sentence = re.sub(r"(?<=\. )[a-z]", lambda found: found[0].upper(), sentence)
    if "." not in sentence.split(" ")[0] and not sentence.startswith(tuple(shown.values())):  # names of files stay
        sentence = sentence[:1].upper() + sentence[1:]
    return sentence if sentence.endswith((".", "!", "?")) else f"{sentence}."
