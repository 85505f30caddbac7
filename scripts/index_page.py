"""SemGS's page on a package index: the README, with links and pictures that work there. hatchling calls this for each wheel and sdist.

A workflow of GitHub names its repository and tag (`GITHUB_REPOSITORY`, `GITHUB_REF_NAME`), and links lead there. Anywhere else no address is known:
links to files become plain text, and pictures are left out.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

FILE = r"\((?!https?:|#)([^)]*)\)"
"""Where a link leads if it is a file of the repository."""


def page(readme: str, repository: str | None, reference: str) -> str:
    """A README in Markdown as an index can show it.

    Args:
        readme: its text, with links relative to the root of the repository.
        repository: address of the repository on GitHub; None if it is not known.
        reference: the tag or branch that links lead to.
    """
    picture, link = re.compile(r"(!\[[^]]*\])" + FILE), re.compile(r"(?<!!)\[([^]]*)\]" + FILE)
    if repository is None:
        return link.sub(r"\1", picture.sub("", readme))
    readme = picture.sub(rf"\1({repository}/raw/{reference}/\2)", readme)
    return link.sub(rf"[\1]({repository}/blob/{reference}/\2)", readme)


class IndexPage(MetadataHookInterface):
    """Sets the fields `readme` and `urls`."""

    def update(self, metadata: dict) -> None:
        """Set them for the repository that is built."""
        name, reference = os.environ.get("GITHUB_REPOSITORY"), os.environ.get("GITHUB_REF_NAME", "main")
        repository = f"https://github.com/{name}" if name else None
        text = page((Path(self.root) / "README.md").read_text(encoding="utf-8"), repository, reference)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        metadata["urls"] = {"Repository": repository} if repository else {}
