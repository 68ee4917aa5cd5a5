"""Speech and waiting on loop time: the behaviors of a body that move no joint.

A voice hands sound over `lead` seconds before it is heard. So each word has two instants: when it is handed over, and
whether it may be is decided, and when it is heard and told of. Without a sound device they are one.
"""

from array import array
from collections import deque
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import aclosing
from math import inf
from typing import Protocol

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech, Wait
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.body import (
    Arrived,
    BodyFailed,
    MouthShape,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
)
from engage_hri.services.control.voice.outlets import Nowhere, Outlet
from engage_hri.services.control.voice.parts import Part, silent
from engage_hri.services.control.voice.visemes import Lips
from engage_hri.services.control.waiting import Bell

OnLips = Callable[[Sequence[MouthShape]], None]
FADE: Seconds = 0.004
"""Seconds in which sound fades where it is cut between two words, so that it does not click."""


class Parts(Protocol):
    """The parts of a speech, as they become ready."""

    def part(self, number: int) -> Part | None:
        """The part of this number, from 0; None: it is not ready yet. Raises BodyFailed: it never will be."""

    def watch(self, bell: Bell) -> Callable[[], None]:
        """Ring a bell when another part is ready, until the returned function is called."""


class OnePart:
    """A speech that is ready as a whole."""

    def __init__(self, part: Part) -> None:
        self._part = part

    def part(self, number: int) -> Part | None:
        return self._part

    def watch(self, bell: Bell) -> Callable[[], None]:
        return lambda: None


class _Gap(Struct, frozen=True):
    """Silence before a word.

    part: the number of its part. since, until: seconds in the part, from this word to the next one. word: its end.
    """

    part: int
    since: Seconds
    until: Seconds
    word: "_Item"


class _More(Struct, frozen=True):
    """The place at which the next part has to be ready. part: its number."""

    part: int


class _Item(Struct, frozen=True):
    """A thing that is to come at `at`, seconds from the start of the utterance.

    is_gap: of a mark between two words.
    """

    at: Seconds
    what: Reached | Spoke | _Gap | _More
    is_gap: bool = False


async def speak(behavior: Speech, authority: MovementAuthority, pace: float = 1.0) -> AsyncGenerator[Progress, None]:
    """Say a text in silence, word by word. pace: 2 takes twice as long. Like `utter_parts`."""
    bell = Bell()
    parts = OnePart(silent(behavior.text, pace))
    async with aclosing(utter_parts(behavior, authority, parts, Nowhere(bell.now))) as progress:
        async for each in progress:
            yield each


async def utter_parts(
    behavior: Speech,
    authority: MovementAuthority,
    parts: Parts,
    outlet: Outlet,
    on_lips: OnLips = lambda shapes: None,
) -> AsyncGenerator[Progress, None]:
    """Say a text word by word. At a mark between two words the voice pauses until it may pass the mark.

    While it is held it pauses before the next word, too. If the authority is revoked, the voice finishes the words
    that were handed over: the current one, and perhaps the next. Raises BodyFailed: nothing is heard any more.
    """
    bell = Bell()
    ends = [authority.watch(bell.ring), outlet.watch(bell.ring), parts.watch(bell)]
    utterance = _Utterance(behavior, authority, parts, outlet, on_lips, bell)
    try:
        while not utterance.is_over:
            utterance.hand_over()
            told = utterance.next_told()
            if told is not None:
                yield told
            elif not utterance.is_over:
                await bell.wait(utterance.deadline)
    finally:
        utterance.end()
        for end in ends:
            end()


class _Utterance:
    """A text that is being said. begin: loop time of its start; pauses move it."""

    def __init__(
        self,
        behavior: Speech,
        authority: MovementAuthority,
        parts: Parts,
        outlet: Outlet,
        on_lips: OnLips,
        bell: Bell,
    ) -> None:
        self._behavior, self._authority, self._parts = behavior, authority, parts
        self._outlet, self._on_lips, self._bell = outlet, on_lips, bell
        self._begin = outlet.earliest() if outlet.lead else bell.now()
        self._ready: list[Part] = []
        self._ahead: deque[_Item] = deque([_Item(0.0, _More(0))])
        """What is not handed over yet, in time order."""
        self._coming: deque[_Item] = deque()
        """What is handed over and not told yet."""
        self._word: _Item | None = None
        """The word that was handed over last, until its end is in `_coming`."""
        self._lips: list[Lips] = []
        self._tail: tuple[bytes, Seconds, int] | None = None
        """The last samples of a word, which fade if no word follows at once; when they sound, and their rate."""
        self._arrived: Seconds | None = None
        """Loop time at which the voice came to the mark where it waits."""
        self._waits = self._is_paused = self._is_cut = self._is_done = False

    @property
    def is_over(self) -> bool:
        return self._is_done or (self._is_cut and not self._coming)

    @property
    def deadline(self) -> Seconds:
        """Loop time of what comes next by itself."""
        due = [self._begin + self._coming[0].at] if self._coming else []
        if self._ahead:
            due.append(self._begin + self._ahead[0].at - (0.0 if self._waits else self._outlet.lead))
        return min((each for each in due if not self._bell.is_past(each)), default=inf)

    def hand_over(self) -> None:
        """Hand over all that is due and may be said. Raises BodyFailed."""
        if self._outlet.fault is not None:
            raise BodyFailed(replace(self._outlet.fault, where=self._behavior.id))
        if self._authority.revoked is not None:
            self._cut()
        while self._ahead:
            item = self._ahead[0]
            if not self._waits and not self._bell.is_past(self._begin + item.at - self._outlet.lead):
                return
            if not self._may_go(item):
                if not self._waits:
                    self._waits = True
                    self._rest()
                return
            if self._waits:
                self._resume(item)
            self._ahead.popleft()
            self._do(item)

    def next_told(self) -> Progress | None:
        """Take the next thing that is heard by now; None: nothing new."""
        if self._coming:
            if not self._bell.is_past(self._begin + self._coming[0].at):
                return None
            item = self._coming.popleft()
            at = self._begin + item.at
            if isinstance(item.what, Spoke):
                return replace(item.what, at=at)
            assert isinstance(item.what, Reached)
            self._is_done = item.what.sync == "end"
            return replace(item.what, at=at, arrived=min(at, item.what.arrived))
        if self._waits and self._ahead and self._bell.is_past(due := self._begin + self._ahead[0].at):
            self._pause()
            what = self._ahead[0].what
            if isinstance(what, Reached) and self._arrived is None:
                self._arrived = due
                return Arrived(what.sync, due)
        return None

    def end(self) -> None:
        """Close the mouth of a voice that says no more before its end."""
        if not self._is_done and self._lips:
            self._on_lips(())

    # -- handing over -------------------------------------------------------------------------------------------

    def _may_go(self, item: _Item) -> bool:
        match item.what:
            case _More(part=number):
                return self._parts.part(number) is not None
            case _Gap():
                return not self._authority.held
            case Reached(sync=sync) if item.is_gap:
                return self._authority.covers(sync)
        return True

    def _do(self, item: _Item) -> None:
        match item.what:
            case _More(part=number):
                part = self._parts.part(number)
                assert part is not None
                self._begin_part(part, number, item.at)
            case _Gap() as gap:
                self._word = gap.word
                self._play(gap, item.at)
            case Reached() as reached:
                arrived, self._arrived = self._arrived, None
                self._coming.append(replace(item, what=replace(reached, arrived=inf if arrived is None else arrived)))
                if reached.sync == "end":
                    self._rest()
            case Spoke():
                self._coming.append(item)
                if item == self._word:
                    self._word = None

    def _begin_part(self, part: Part, number: int, at: Seconds) -> None:
        start = self._ready[-1].end if self._ready else 0
        self._ready.append(part)
        self._ahead.extend(_score(self._behavior, part, number, start, at))
        self._lips += [Lips(each.at + at, each.opening, each.width) for each in part.lips]
        self._tell_lips()

    def _cut(self) -> None:
        """Say no more than the words that were handed over."""
        if not self._is_cut:
            self._is_cut = True
            words = [item for item in self._coming if isinstance(item.what, Spoke)]
            self._coming = deque([*words, *([self._word] if self._word is not None else [])])
            self._ahead.clear()
            self._rest()

    def _play(self, gap: _Gap, at: Seconds) -> None:
        part = self._ready[gap.part]
        if not part.samples:
            return
        since, until = (2 * round(each * part.rate) for each in (gap.since, gap.until))
        kept = 2 * round(FADE * part.rate)
        if self._tail is not None:
            tail, sounds, _ = self._tail
            self._outlet.play(tail, self._begin + sounds)
        middle = max(since, until - kept)
        self._outlet.play(part.samples[since:middle], self._begin + at)
        self._tail = (part.samples[middle:until], at + (middle - since) / 2 / part.rate, part.rate)

    def _rest(self) -> None:
        """Take note that silence follows the word that was handed over last."""
        if self._tail is not None:
            tail, sounds, _ = self._tail
            self._tail = None
            self._outlet.play(_faded(tail), self._begin + sounds)
            self._outlet.rest()

    def _pause(self) -> None:
        if not self._is_paused:
            self._is_paused = True
            if self._lips:
                self._on_lips(())

    def _resume(self, item: _Item) -> None:
        """Go on after a pause: all that is to come is later."""
        due = self._begin + item.at
        if self._outlet.lead:
            self._begin += max(0.0, self._outlet.earliest() - due)
        elif self._bell.now() > due:
            self._begin = self._bell.now() - item.at
        self._waits = False
        if self._is_paused:
            self._is_paused = False
            self._tell_lips()

    def _tell_lips(self) -> None:
        """Tell all shapes from now on, and the one that the mouth has now."""
        since = self._bell.now() - self._begin
        passed = [number for number, each in enumerate(self._lips) if each.at <= since]
        self._lips = self._lips[passed[-1] if passed else 0 :]
        if self._lips:
            self._on_lips([MouthShape(self._begin + each.at, each.opening, each.width) for each in self._lips])


def _faded(samples: bytes) -> bytes:
    values = array("h", samples)
    count = len(values)
    return array("h", [value * (count - place) // count for place, value in enumerate(values)]).tobytes()


def _score(behavior: Speech, part: Part, number: int, start: int, base: Seconds) -> list[_Item]:
    """List all that is to come in a part, in time order. start: characters of the text before it.

    Reports of one instant are in the order of the text: a word, the mark after it, the gap before the next.
    """
    last, utterance = len(behavior.text), part.utterance
    is_last = part.end >= last
    score: list[tuple[Seconds, int, _Item]] = []
    if number == 0:
        score.append((0.0, -1, _Item(0.0, Reached("start", 0.0, 0.0))))
    told = {}
    for word in utterance.words:
        told[word.position] = _Item(base + word.end, Spoke(word.text, word.position, word.end))
        score.append((word.end, word.position, told[word.position]))
    for mark in sorted(behavior.marks, key=lambda mark: mark.position):
        if start <= mark.position < part.end or (is_last and mark.position >= part.end):
            at = utterance.said_by(mark.position)
            item = _Item(base + at, Reached(mark.id, at, at), utterance.is_gap(mark.position))
            score.append((at, mark.position, item))
    said = [word for word in utterance.words if word.end > word.start]
    following = [word.start for word in said[1:]] + [utterance.seconds] * bool(said)
    for word, until in zip(said, following, strict=True):
        gap = _Gap(number, word.start if word is not said[0] else 0.0, until, told[word.position])
        score.append((word.start, word.position - len(word.text), _Item(base + word.start, gap)))
    if is_last:
        end = _Item(base + utterance.seconds, Reached("end", 0.0, 0.0))
        score.append((utterance.seconds, last, end))
    else:
        after = utterance.seconds + part.pause
        score.append((after, part.end, _Item(base + after, _More(number + 1))))
    return [item for _, _, item in sorted(score, key=lambda each: each[:2])]


async def wait(behavior: Wait, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
    """Let the duration of the behavior pass, and then hold until its end may be passed."""
    bell = Bell()
    begin = bell.now()
    due = begin + (behavior.duration or 0.0)
    unwatch = authority.watch(bell.ring)
    try:
        yield Reached("start", begin, begin)
        while not bell.is_past(due) and authority.revoked is None:
            await bell.wait(due)
        left = due
        if authority.revoked is None and not authority.covers("end"):
            yield Arrived("end", due)
            while authority.revoked is None and not authority.covers("end"):
                await bell.wait(inf)
            left = bell.now()
        if authority.revoked is None:
            yield Reached("end", left, due)
    finally:
        unwatch()
