"""Words of people in the outcomes of what is performed: each reader is told them once."""

from collections.abc import Iterable

from engage_hri.schemas.fragments import HeardText

MOST = 256
"""Number of utterances that are remembered."""


class NewWords:
    """Words that one reader of outcomes has not been told yet: each outcome repeats those since the turn before."""

    def __init__(self) -> None:
        self._told: dict[tuple[str, str], str] = {}
        """Text of each utterance, by person and id."""

    def of(self, heard: Iterable[HeardText]) -> tuple[HeardText, ...]:
        """Return those that are new, or say something else than before; from now on they are known."""
        new = tuple(each for each in heard if self._told.get((each.actor, each.id)) != each.text)
        for each in new:
            self._told.pop((each.actor, each.id), None)
            self._told[each.actor, each.id] = each.text
        while len(self._told) > MOST:
            del self._told[next(iter(self._told))]
        return new
