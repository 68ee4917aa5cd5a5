"""Speech of people into the robot's turns: what holds it and what interrupts it, as recognition says. Pure."""

from collections.abc import Callable, Collection, Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.fragments import Interjected
from engage_hri.schemas.recognition import Interjection
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.reports.same_people import renamed

UNDECIDED: Seconds = 3.0
"""Time for which the robot is silent after somebody has spoken into its turn, and then goes on, if nobody has said
whether that interrupts it: recognition may have died. Ours."""


WORDLESS: Seconds = 1.5
"""Time for which a voice without words has to last to take the floor: a laugh is shorter. In meetings nine of ten
speeches that end within another's turn are, and three of ten that do not (decision 0171)."""


class _Kept(Struct):
    """turn: the turn that it was said into. told: its last news. began: when it was told first.

    counts_from: when the robot heeds it if the voice goes on until then; None: it may not interrupt, or has fallen
    silent before. is_heeded: the robot does. waits: it waits for the reading. is_voiced: the voice goes on. words:
    heard of it that are more than a listener's. is_orphan: recognition has gone since, so that these decide.
    """

    turn: str
    told: Interjection
    began: Seconds
    counts_from: Seconds | None
    is_heeded: bool = False
    waits: bool = False
    is_voiced: bool = True
    words: str = ""
    is_orphan: bool = False
    held: Seconds = 0.0
    went_on: bool = False

    @property
    def is_pending(self) -> bool:
        """True if it is not heeded yet, and will be if it lasts."""
        return self.counts_from is not None and self.is_voiced and not self.is_heeded

    def lasts(self, now: Seconds) -> bool:
        """True if it has words, or has lasted for as long as a voice without any has to."""
        return bool(self.told.words) or now >= self.began + WORDLESS

    @property
    def is_wordless(self) -> bool:
        """True while it would interrupt if its voice lasted, or had words."""
        return self.waits and self.told.reading == "interruption"


class Interjections:
    """All that people have said into turns that are not closed."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, Stamp], _Kept] = {}
        """By person and beginning."""

    def feed(self, told: Interjection, turn: str, now: Seconds, *, after: Seconds | None) -> bool:
        """Take news of a speech. True: it takes the floor.

        turn: id of the robot's turn now; "": there is none. after: how long this person has to speak to interrupt it;
        None: the robot goes on, whatever is said.
        """
        kept = self._kept.get((told.actor, told.since))
        if kept is None:
            if turn and told.reading == "open":
                self._kept[told.actor, told.since] = kept = _Kept(
                    turn, told, now, None if after is None else now + after
                )
                if after == 0.0:
                    self._heed(kept, now)
            return False
        before, kept.told = kept.told.reading, told
        if told.reading == before == "interruption" and not (kept.went_on or kept.waits):
            return False  # it has the floor, and only its words are new
        takes_floor = told.reading == "interruption" and kept.turn == turn and kept.is_heeded
        if takes_floor and not kept.lasts(now):
            kept.waits = True  # it may be a laugh, or its words may come
            return False
        self._release(kept, now, went_on=not takes_floor)
        if told.reading != "interruption":
            kept.counts_from = None
        return takes_floor

    def _heed(self, kept: _Kept, now: Seconds) -> None:
        is_short = kept.told.reading == "interruption" and not kept.lasts(now)
        kept.is_heeded, kept.waits = True, kept.told.reading == "open" or is_short

    def heed(self, actor: str, now: Seconds) -> bool:
        """Heed what this person says, for it has lasted long enough. True: it takes the floor."""
        takes_floor = False
        for each in self._kept.values():
            if each.told.actor == actor and each.is_pending and each.counts_from is not None:
                each.counts_from = now
                self._heed(each, now)
                takes_floor = each.told.reading == "interruption" and not each.waits
                each.went_on = not takes_floor and not each.waits
        return takes_floor

    def unheeded_in(self, turn: str) -> Mapping[str, Seconds]:
        """People whose speech in this turn is heeded if it lasts, and from when on."""
        pending = [each for each in self._kept.values() if each.turn == turn and each.is_pending]
        return {each.told.actor: each.counts_from for each in pending if each.counts_from is not None}

    def _release(self, kept: _Kept, now: Seconds, *, went_on: bool) -> None:
        if kept.waits:
            assert kept.counts_from is not None
            kept.waits, kept.held = False, now - kept.counts_from
        kept.went_on = went_on

    def falls_silent(self, actor: str) -> None:
        """Note that a person speaks no more."""
        for each in self._kept.values():
            if each.told.actor == actor:
                each.is_voiced = False

    def wordless_in(self, turn: str) -> Mapping[str, Seconds]:
        """People whose voice without words interrupts this turn if it lasts, or has words, until when."""
        return {
            each.told.actor: each.began + WORDLESS
            for each in self._kept.values()
            if each.turn == turn and each.is_wordless
        }

    def voiced_in(self, turn: str) -> Mapping[str, Seconds]:
        """People who go on with an undecided speech in this turn, and since when."""
        return {
            each.told.actor: each.counts_from
            for each in self._kept.values()
            if each.waits and each.is_voiced and each.turn == turn and each.counts_from is not None
        }

    def waits_in(self, turn: str) -> Mapping[str, Seconds]:
        """People whose speech in this turn is undecided, and since when."""
        waiting = [each for each in self._kept.values() if each.waits and each.turn == turn]
        return {each.told.actor: each.counts_from for each in reversed(waiting) if each.counts_from is not None}

    def rename(self, name: Callable[[str], str]) -> None:
        """Tell of people by other ids from now on. name: the new one of each."""
        for each in self._kept.values():
            each.told = renamed(each.told, name)
        self._kept = {(name(actor), since): each for (actor, since), each in self._kept.items()}

    def hear(self, actor: str, words: str) -> None:
        """Note words, more than a listener's, of a speech that waits for its reading."""
        for each in self._kept.values():
            if each.waits and each.told.actor == actor:
                each.words = words

    def give_up(self, actor: str, now: Seconds) -> bool:
        """Wait for the readings of this person's speeches no longer: nobody has told them in time.

        True: recognition has gone, and words have been heard by which one takes the floor.
        """
        takes_floor = False
        for each in self._kept.values():
            if each.waits and each.told.actor == actor:
                is_floor = each.is_orphan and bool(each.words)
                if is_floor:
                    each.told = replace(each.told, reading="interruption", words=each.words)
                self._release(each, now, went_on=not is_floor)
                takes_floor |= is_floor
        return takes_floor

    def recognition_gone(self) -> None:
        """Note that nobody may say what the speeches are that wait."""
        for each in self._kept.values():
            each.is_orphan |= each.waits

    def decide_wordless(self, actor: str, now: Seconds, *, has_words: bool) -> bool:
        """Decide what this person says without words. has_words: by now it has. True: it takes the floor."""
        takes_floor = False
        for each in self._kept.values():
            if each.is_wordless and each.told.actor == actor:
                is_floor = has_words or each.is_voiced
                self._release(each, now, went_on=not is_floor)
                takes_floor |= is_floor
        return takes_floor

    def turn_over(self, turn: str, now: Seconds, *, went_on: bool) -> None:
        """Wait for nothing of a turn that is over. went_on: it was performed to its end."""
        for each in self._kept.values():
            if each.turn == turn and (each.waits or not each.is_heeded):
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
