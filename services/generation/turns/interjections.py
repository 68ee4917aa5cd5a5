"""Speech of people into the robot's turns, and what came of it: recognition says what it is. Pure."""

from collections.abc import Collection, Mapping

from msgspec import Struct

from engage_hri.schemas.fragments import Interjected
from engage_hri.schemas.recognition import Interjection
from engage_hri.schemas.units import Seconds, Stamp

UNDECIDED: Seconds = 3.0
"""Time after which the robot goes on although nobody has said what a speech is: recognition may have died. Ours."""


class _Kept(Struct):
    """turn: the turn that it was said into. told: its last news. waits: the robot waits for its reading.

    is_voiced: the voice goes on.
    """

    turn: str
    told: Interjection
    opened: Seconds
    waits: bool = True
    is_voiced: bool = True
    held: Seconds = 0.0
    went_on: bool = False


class Interjections:
    """All that people have said into turns that are not closed."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, Stamp], _Kept] = {}
        """By person and beginning."""

    def feed(self, told: Interjection, turn: str, now: Seconds) -> bool:
        """Take news of a speech. True: it takes the floor.

        turn: id of the robot's turn that this person may interrupt now; "": there is none.
        """
        kept = self._kept.get((told.actor, told.since))
        if kept is None:
            if turn and told.reading == "open":
                self._kept[told.actor, told.since] = _Kept(turn, told, now)
            return False
        kept.told = told
        if told.reading == "interruption" and kept.turn == turn:
            self._release(kept, now, went_on=False)
            return True
        self._release(kept, now, went_on=True)
        return False

    def _release(self, kept: _Kept, now: Seconds, *, went_on: bool) -> None:
        if kept.waits:
            kept.waits, kept.held = False, now - kept.opened
        kept.went_on = went_on

    def falls_silent(self, actor: str) -> None:
        """Note that a person speaks no more."""
        for each in self._kept.values():
            if each.told.actor == actor:
                each.is_voiced = False

    def voiced_in(self, turn: str) -> Mapping[str, Seconds]:
        """People who go on with an undecided speech in this turn, and since when."""
        return {
            each.told.actor: each.opened
            for each in self._kept.values()
            if each.waits and each.is_voiced and each.turn == turn
        }

    def waits_in(self, turn: str) -> Mapping[str, Seconds]:
        """People whose speech in this turn is undecided, and since when."""
        waiting = [each for each in self._kept.values() if each.waits and each.turn == turn]
        return {each.told.actor: each.opened for each in reversed(waiting)}

    def give_up(self, actor: str, now: Seconds) -> None:
        """Wait for the readings of this person's speeches no longer: nobody has told them in time."""
        for each in self._kept.values():
            if each.waits and each.told.actor == actor:
                self._release(each, now, went_on=True)

    def turn_over(self, turn: str, now: Seconds, *, went_on: bool) -> None:
        """Wait for nothing of a turn that is over. went_on: it was performed to its end."""
        for each in self._kept.values():
            if each.waits and each.turn == turn:
                self._release(each, now, went_on=went_on)

    def of_turn(self, turn: str) -> tuple[Interjected, ...]:
        """Speech into a turn, in order."""
        return tuple(
            Interjected(
                actor=each.told.actor, since=each.told.since, reading=each.told.reading, words=each.told.words,
                held=each.held, went_on=each.went_on,
            )
            for each in self._kept.values()
            if each.turn == turn
        )  # fmt: skip

    def forget(self, turns: Collection[str]) -> None:
        """Keep only these turns."""
        self._kept = {name: each for name, each in self._kept.items() if each.turn in turns}
