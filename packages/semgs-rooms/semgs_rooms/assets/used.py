"""Record the assets that one room uses."""

from __future__ import annotations

from semgs_rooms.assets.asset_images import Pack, Pyramid, pack


class UsedAssets:
    """The images of a room, for its kernels, and the files of its images and meshes, for attribution."""

    def __init__(self) -> None:
        self._pyramids: list[Pyramid] = []
        self._numbers: dict[int, int] = {}
        self._files: set[str] = set()

    def number(self, pyramid: Pyramid) -> int:
        """Index of the image in the pack, which is the same for the same image."""
        if id(pyramid) not in self._numbers:
            self._numbers[id(pyramid)] = len(self._pyramids)
            self._pyramids.append(pyramid)
        return self._numbers[id(pyramid)]

    def add_file(self, file: str) -> None:
        """Record that a file is used."""
        self._files.add(file)

    @property
    def files(self) -> tuple[str, ...]:
        """All files that are used, sorted by name."""
        return tuple(sorted(self._files))

    def pack(self) -> Pack:
        """All images, for the kernels."""
        return pack(self._pyramids)
