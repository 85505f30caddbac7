"""Decoded views that a process keeps in memory, so that scenes that are read often are decoded once."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable

from semgs.data.views import Views


class ViewCache:
    """The views used last. Nothing may change what it returns.

    Args:
        limit: of the tensors of all views together [bytes]; 0 keeps none.
    """

    def __init__(self, limit: int) -> None:
        self._limit, self._bytes = limit, 0
        self._kept: OrderedDict[Hashable, tuple[Views, int]] = OrderedDict()

    def get(self, key: Hashable, read: Callable[[], Views]) -> Views:
        """A view; it is only read if it is not there.

        Args:
            key: equal keys stand for equal views.
            read: reads it. What it raises passes through, and nothing is kept.
        """
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key][0]
        view = read()
        size = _tensor_bytes(view)
        if size <= self._limit:
            self._kept[key] = view, size
            self._bytes += size
        while self._bytes > self._limit:
            self._bytes -= self._kept.popitem(last=False)[1][1]
        return view


def _tensor_bytes(view: Views) -> int:
    """The memory of a view's pixels [bytes]; the few numbers of its camera do not count."""
    maps = (view.images, view.labels, view.depths, view.hidden)
    return sum(each.nbytes for each in maps if each is not None)
