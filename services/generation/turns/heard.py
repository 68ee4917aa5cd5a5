"""Words of people around the robot's turns: what was said in and after each, and whether more will come. Pure."""

from collections.abc import Collection

from msgspec import Struct

from engage_hri.schemas.fragments import HeardText
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.units import Seconds

LOOKS_BACK: Seconds = 60.0
"""Time before a turn of which the words still count, if there was no turn meanwhile."""
MOST = 64
"""Number of utterances that are remembered."""
PEOPLE = 256
"""Number of people of whom it is known that somebody tells their words."""


class _Said(Struct):
    """An utterance by its newest result. known: local time when it came."""

    utterance: Utterance
    known: Seconds


class HeardWords:
    """The words of all people, as far as they are known."""

    def __init__(self) -> None:
        self._said: dict[tuple[str, str, int], _Said] = {}
        """By person, id and number of those of one id that do not overlap, the last to become so at the end."""
        self._told_of: dict[str, None] = {}
        self._since: dict[str, Seconds] = {}
        """Of each turn: from when on words count for it."""
        self._last_end: Seconds = float("-inf")

    def feed(self, utterance: Utterance, now: Seconds) -> None:
        """Take a result. A final one counts before one that is not, and else the newer one."""
        self._told_of.pop(utterance.actor, None)
        self._told_of[utterance.actor] = None
        if len(self._told_of) > PEOPLE:
            del self._told_of[next(iter(self._told_of))]
        key = (utterance.actor, utterance.id, self._number(utterance))
        known = self._said.get(key)
        if known is not None and _place(utterance) <= _place(known.utterance):
            return
        self._said.pop(key, None)
        self._said[key] = _Said(utterance, now)
        if len(self._said) > MOST:
            del self._said[next(iter(self._said))]

    def _number(self, utterance: Utterance) -> int:
        """Number of an utterance among those of one id: some recognizers use one id for all that they understand.

        Results of one utterance overlap; what began after the last of this id had ended is another one.
        """
        numbers = [n for actor, id, n in self._said if (actor, id) == (utterance.actor, utterance.id)]
        if not numbers:
            return 0
        known = self._said[utterance.actor, utterance.id, max(numbers)].utterance
        ended = known.ended or known.at
        is_later = known.final and utterance.began.clock == ended.clock and utterance.began.seconds >= ended.seconds
        return max(numbers) + (1 if is_later and utterance.began != known.began else 0)

    def expects(self, person: str) -> bool:
        """Tell whether somebody tells the words of this person: then those of an answer will come."""
        return person in self._told_of

    def is_saying(self, person: str, since: Seconds) -> bool:
        """Tell whether an utterance of the person has begun, or grown, since then and is not known for good."""
        return any(
            each.utterance.actor == person and not each.utterance.final and each.known >= since
            for each in self._said.values()
        )

    def missed(self, person: str) -> None:
        """Note that the words of an answer have not come: nobody waits for those of this person until more come."""
        self._told_of.pop(person, None)

    # -- turns --------------------------------------------------------------------------------------------------

    def turn_begins(self, turn: str, now: Seconds) -> None:
        """Note a turn: what has become known since the one before it counts for it."""
        self._since.setdefault(turn, max(self._last_end, now - LOOKS_BACK))

    def turn_ends(self, now: Seconds) -> None:
        """Note that a fragment has ended; the last of a turn is its end."""
        self._last_end = now

    def forget(self, turns: Collection[str]) -> None:
        """Keep only these turns."""
        self._since = {turn: since for turn, since in self._since.items() if turn in turns}

    def of_turn(self, turn: str) -> tuple[HeardText, ...]:
        """Words of all people since the turn before, known for good, in the order in which they began to say them."""
        since = self._since.get(turn, float("inf"))
        heard = [each.utterance for each in self._said.values() if each.utterance.final and each.known >= since]
        heard.sort(key=lambda each: (each.began.seconds, each.actor, each.id))
        return tuple(
            HeardText(actor=each.actor, id=each.id, text=text, began=each.began, to=each.to)
            for each in heard
            if (text := " ".join(each.text.split()))
        )


def _place(utterance: Utterance) -> tuple[bool, Seconds]:
    return utterance.final, utterance.at.seconds
