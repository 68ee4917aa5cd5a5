"""Counts of messages that are refused again and again: which of them to tell. Pure: time is an argument."""

from collections import Counter

from engage_hri.schemas.units import Seconds

CALM: Seconds = 2.0
"""Time without a refusal of a kind after which the next one counts as the first."""
KINDS = 16
"""Kinds of refusals of one sender that are counted apart; all further ones of it are one kind."""
MOST = 256
"""Kinds of all senders together that are counted apart; all further ones are one kind."""


def is_told(times: int) -> bool:
    """True for the first, the tenth, the hundredth ... time: what comes again and again is told so often."""
    return str(times).rstrip("0") == "1"


class Often:
    """Counts refusals of each sender and kind, and says which to tell: the first, the tenth, the hundredth ...

    A flood of messages that nobody can read is so not answered with a flood of faults.
    """

    def __init__(self, calm: Seconds = CALM) -> None:
        """calm: time without a refusal of a kind after which the next one counts as the first."""
        self._calm = calm
        self._counts: dict[tuple[str, str], tuple[int, Seconds]] = {}
        """Number and time of the last refusal, the one longest ago first."""
        self._kinds: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._counts)

    def tell(self, sender: str, kind: str, now: Seconds) -> int:
        """Count a refusal. Returns how many there have been if that is to be told, else 0."""
        self._forget(now)
        if (sender, kind) not in self._counts and self._kinds[sender] >= KINDS:
            kind = ""
        if (sender, kind) not in self._counts and len(self._counts) >= MOST:
            sender = kind = ""
        known = self._counts.pop((sender, kind), None)
        self._kinds[sender] += known is None
        times = 1 if known is None else known[0] + 1
        self._counts[sender, kind] = times, now
        return times if is_told(times) else 0

    def _forget(self, now: Seconds) -> None:
        while self._counts:
            (sender, kind), (_, last) = next(iter(self._counts.items()))
            if now - last < self._calm:
                break
            del self._counts[sender, kind]
            self._kinds[sender] -= 1
            if not self._kinds[sender]:
                del self._kinds[sender]
