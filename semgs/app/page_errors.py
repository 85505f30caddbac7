"""Errors of the worker in words for somebody who sees a page: no folders of the server, no options of the command line."""

from __future__ import annotations

import re
from pathlib import Path

from semgs.app.requests import Request
from semgs.app.uploads import UnusableUploadError, Upload, photo_names
from semgs.files.text import printable
from semgs.run.usage_errors import line_for

WORKERS_PHOTO = r"(?<![\w./-])(?:[\w./-]*/)?(?:{})(?![\w-]|\.\w)"
"""A photo by one of the names that the worker gives photos, wherever it is."""


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
