"""Notes of what a document holds that is not understood: some of each kind, and of the others their number."""

from collections import Counter

from engage_hri.schemas.blocks import Unread
from engage_hri.schemas.feedback import WarningKind

MOST = 100
"""Notes of one kind that are told: each takes time to make, and is a warning on the bus."""


class Notes:
    """Notes of one document, as they come."""

    def __init__(self) -> None:
        self._kept: list[Unread] = []
        self._count = Counter[WarningKind]()

    def is_full(self, kind: WarningKind) -> bool:
        """Tell whether the next note of this kind is only counted, and needs no words."""
        return self._count[kind] >= MOST

    def add(self, message: str, behavior: str, kind: WarningKind) -> None:
        if not self.is_full(kind):
            self._kept.append(Unread(message=message, behavior=behavior, kind=kind))
        self._count[kind] += 1

    def told(self) -> list[Unread]:
        """All notes, with one for each kind of which there are more."""
        more = [(kind, number - MOST) for kind, number in self._count.items() if number > MOST]
        return self._kept + [
            Unread(message=f"{number} more {'part is' if number == 1 else 'parts are'} ignored", kind=kind)
            for kind, number in more
        ]
