"""Unique names for requests of different peers that have the same id. Pure."""

from collections import OrderedDict

KEPT = 4096


class Names:
    """Names that were not given lately: the id itself, then `ask~2`, `ask~3`. kept: ids that are remembered."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._used: OrderedDict[str, int] = OrderedDict()

    def unique(self, id: str) -> str:
        """A name for `id` that no other has."""
        while (count := self._used.pop(id, 0) + 1) > 1:
            self._used[id] = count
            id = f"{id}~{count}"
        self._used[id] = count
        while len(self._used) > self._kept:
            self._used.popitem(last=False)
        return id
