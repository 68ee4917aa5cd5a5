"""Names that nothing else has, for what ids call alike. Pure."""

from collections import OrderedDict

KEPT = 4096


class Names:
    """Names for what ids call alike: `ask`, `ask~2`, `ask~3`."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._used: OrderedDict[str, int] = OrderedDict()

    def unique(self, id: str) -> str:
        while (count := self._used.pop(id, 0) + 1) > 1:
            self._used[id] = count
            id = f"{id}~{count}"
        self._used[id] = count
        while len(self._used) > self._kept:
            self._used.popitem(last=False)
        return id
