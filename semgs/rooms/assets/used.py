"""The pictures and files that one room uses, numbered as they come."""

from __future__ import annotations

from semgs.rooms.assets.images import Pack, Pyramid, pack


class UsedAssets:
    """Collects the pictures of a room for its kernels, and the files they and its meshes are from for its attribution."""

    def __init__(self) -> None:
        self._pyramids: list[Pyramid] = []
        self._numbers: dict[int, int] = {}
        self._files: set[str] = set()

    def number(self, pyramid: Pyramid) -> int:
        """The picture's number in the pack; the same picture has the same one."""
        if id(pyramid) not in self._numbers:
            self._numbers[id(pyramid)] = len(self._pyramids)
            self._pyramids.append(pyramid)
        return self._numbers[id(pyramid)]

    def add_file(self, file: str) -> None:
        """Note that a file of the assets is in the room."""
        self._files.add(file)

    @property
    def files(self) -> tuple[str, ...]:
        """All files that were noted, in order of their names."""
        return tuple(sorted(self._files))

    def pack(self) -> Pack:
        """All pictures, for the kernels."""
        return pack(self._pyramids)
