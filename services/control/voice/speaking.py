"""Speech on loop time: a behavior of a body that moves no joint.

A text is said part by part, and a part may come only while the one before it is said. A silent voice has one part,
with the words in time alone; one that sounds has a part for each phrase. What is to come in a part are items in time
order: words, marks, and where sound is handed over.

A voice hands sound over `lead` seconds before it is heard. So each word has two instants: when it is handed over, and
whether it may be is decided, and when it is heard and told of. Without a sound device they are one.
"""

from array import array
from collections import deque
from collections.abc import AsyncGenerator, Callable, Sequence
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.text import tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import (
    EARLY,
    Arrived,
    Bell,
    BodyFailed,
    MouthShape,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
)
from engage_hri.services.control.voice.clauses import Clause
from engage_hri.services.control.voice.outlets import Outlet
from engage_hri.services.control.voice.timeline import Piece, Utterance, Word, spelled, utter, uttered

OnLips = Callable[[Sequence[MouthShape]], None]
CHECK: Seconds = 0.05
"""How often it is looked whether a device takes the sound."""


# -- what is to come ----------------------------------------------------------------------------------------------


class Part(Struct, frozen=True):
    """A part of a speech. Its words have their places in the whole text, and times from the start of the part.

    end: characters of the text up to its end. pause: seconds of silence after it. lips: from the start of the part.
    samples: 16 bit, little-endian, one channel; empty: it is silent. rate: samples per second.
    """

    utterance: Utterance
    end: int
    pause: Seconds = 0.0
    lips: tuple[MouthShape, ...] = ()
    samples: bytes = b""
    rate: int = 0


def silent(speech: Speech, pace: float = 1.0) -> Part:
    """The one part of a speech that is said in silence. pace: 2 takes twice as long."""
    utterance = uttered(speech, pace)
    return Part(utterance, len(speech.text), lips=spelled(utterance))


def sounding(piece: Piece, clause: Clause) -> Part:
    """The part of a phrase that was synthesized."""
    whole = Utterance(_as_written(piece, clause.words), clause.seconds)
    return Part(whole, piece.end, piece.pause, clause.lips, clause.samples, clause.rate)


def expected(piece: Piece, pace: float) -> Part:
    """The part that a phrase will be, for as long as it is not synthesized. pace: 2 takes twice as long."""
    modelled = utter(piece.phrase.text, pace, piece.phrase.prosody)
    return Part(Utterance(_as_written(piece, modelled.words), modelled.seconds), piece.end, piece.pause)


def _as_written(piece: Piece, said: Sequence[Word]) -> tuple[Word, ...]:
    """The words of a phrase as they stand in the text, where there is more: an emoji is not given to the engine."""
    words: list[Word] = []
    number, now = 0, 0.0
    for token in tokens(piece.text):
        begin = token.end - len(token.text)
        since = until = None
        while number < len(said) and said[number].position <= token.end:
            word = said[number]
            number += 1
            if word.position - len(word.text) >= begin:
                since, until = (word.start if since is None else since), word.end
        start, now = (now, now) if since is None or until is None else (since, max(now, until))
        words.append(Word(token.text, min(start, now), now, piece.start + token.end))
    return tuple(words)


def joined(parts: Sequence[Part]) -> Utterance:
    """The whole speech: its parts one after the other; at least one."""
    words: list[Word] = []
    begin = 0.0
    for part in parts:
        words += [replace(word, start=word.start + begin, end=word.end + begin) for word in part.utterance.words]
        begin += part.utterance.seconds + part.pause
    return Utterance(tuple(words), begin - parts[-1].pause)


FADE: Seconds = 0.004
"""Seconds in which sound fades where it is cut between two words, so that it does not click."""


class Gap(Struct, frozen=True):
    """Silence before a word.

    part: the number of its part. since, until: seconds in the part, from this word to the next one. word: its end.
    """

    part: int
    since: Seconds
    until: Seconds
    word: "Item"


class More(Struct, frozen=True):
    """The place at which the next part has to be ready. part: its number."""

    part: int


class Cut(Struct, frozen=True):
    """The place from which on sound is taken back that was handed over. tail: the faded samples before it."""

    tail: bytes


class Item(Struct, frozen=True):
    """A thing that is to come at `at`, seconds from the start of the utterance.

    is_gap: of a mark between two words.
    """

    at: Seconds
    what: Reached | Spoke | Gap | More | Cut
    is_gap: bool = False


def faded(samples: bytes) -> bytes:
    """Let samples end in silence."""
    values = array("h", samples)
    count = len(values)
    return array("h", [value * (count - place) // count for place, value in enumerate(values)]).tobytes()


def items_of(behavior: Speech, part: Part, number: int, start: int, base: Seconds) -> list[Item]:
    """List all that is to come in a part, in time order. start: characters of the text before it.

    Reports of one instant are in the order of the text: a word, the mark after it, the gap before the next.
    """
    last, utterance = len(behavior.text), part.utterance
    is_last = part.end >= last
    score: list[tuple[Seconds, int, Item]] = []
    if number == 0:
        score.append((0.0, -1, Item(0.0, Reached("start", 0.0, 0.0))))
    told = {}
    for word in utterance.words:
        told[word.position] = Item(base + word.end, Spoke(word.text, word.position, word.end))
        score.append((word.end, word.position, told[word.position]))
    for mark in sorted(behavior.marks, key=lambda mark: mark.position):
        if start <= mark.position < part.end or (is_last and mark.position >= part.end):
            at = utterance.said_by(mark.position)
            item = Item(base + at, Reached(mark.id, at, at), utterance.is_gap(mark.position))
            score.append((at, mark.position, item))
    said = [word for word in utterance.words if word.end > word.start]
    following = [word.start for word in said[1:]] + [utterance.seconds] * bool(said)
    for word, until in zip(said, following, strict=True):
        gap = Gap(number, word.start if word is not said[0] else 0.0, until, told[word.position])
        score.append((word.start, word.position - len(word.text), Item(base + word.start, gap)))
    if is_last:
        end = Item(base + utterance.seconds, Reached("end", 0.0, 0.0))
        score.append((utterance.seconds, last, end))
    else:
        after = utterance.seconds + part.pause
        score.append((after, part.end, Item(base + after, More(number + 1))))
    return [item for _, _, item in sorted(score, key=lambda each: each[:2])]


PartOf = Callable[[int], Part | None]
"""The part of a number, from 0; None: it is not ready yet. Raises BodyFailed: it never will be."""


# -- saying it ----------------------------------------------------------------------------------------------------


def speak(
    behavior: Speech, authority: MovementAuthority, pace: float = 1.0, on_lips: OnLips = lambda shapes: None
) -> AsyncGenerator[Progress, None]:
    """Say a text in silence, word by word. pace: 2 takes twice as long. Like `utter_parts`."""
    part = silent(behavior, pace)
    return utter_parts(behavior, authority, lambda number: part, Outlet(Bell().now), on_lips)


async def utter_parts(
    behavior: Speech,
    authority: MovementAuthority,
    part_of: PartOf,
    outlet: Outlet,
    on_lips: OnLips = lambda shapes: None,
    watch_parts: Callable[[Bell], Callable[[], None]] = lambda bell: lambda: None,
) -> AsyncGenerator[Progress, None]:
    """Say a text word by word. At a mark between two words the voice pauses until it may pass the mark.

    While it is held it pauses before the next word, too. If the authority is revoked, the voice finishes the word
    that is heard, and takes back what was handed over after it. What a device has not taken is not told as heard:
    words and lips wait for it.

    watch_parts: rings a bell when another part is ready, until the function that it returns is called.

    Raises BodyFailed: nothing is heard any more.
    """
    bell = Bell()
    ends = [authority.watch(bell.ring), outlet.watch(bell.ring), watch_parts(bell)]
    utterance = _Utterance(behavior, authority, part_of, outlet, on_lips, bell)
    try:
        while not utterance.is_over:
            looked = bell.now()
            utterance.hand_over()
            told = utterance.next_told()
            if told is not None:
                yield told
            elif not utterance.is_over:
                await bell.wait(utterance.deadline(looked))
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
        part_of: PartOf,
        outlet: Outlet,
        on_lips: OnLips,
        bell: Bell,
    ) -> None:
        self._behavior, self._authority, self._part_of = behavior, authority, part_of
        self._outlet, self._on_lips, self._bell = outlet, on_lips, bell
        self._begin = outlet.earliest() if outlet.lead else bell.now()
        self._ready: list[Part] = []
        self._ahead: deque[Item] = deque([Item(0.0, More(0))])
        """What is not handed over yet, in time order."""
        self._coming: deque[Item] = deque()
        """What is handed over and not told yet."""
        self._word: Item | None = None
        """The word that was handed over last, until its end is in `_coming`."""
        self._handed: list[tuple[Gap, Seconds]] = []
        """The words that were handed over, and when each begins."""
        self._lates = 0
        """How many times in a row the device was late."""
        self._lips: list[MouthShape] = []
        self._tail: tuple[bytes, Seconds, int] | None = None
        """The last samples of a word, which fade if no word follows at once; when they sound, and their rate."""
        self._arrived: Seconds | None = None
        """Loop time at which the voice came to the mark where it waits."""
        self._waits = self._is_paused = self._is_cut = self._is_done = False

    @property
    def is_over(self) -> bool:
        return self._is_done or (self._is_cut and not self._coming)

    def deadline(self, looked: Seconds) -> Seconds:
        """Loop time of what comes next by itself. looked: when it was seen last what is due.

        What has become due since then has not been seen yet.
        """
        due = [self._begin + self._coming[0].at] if self._coming else []
        if self._ahead:
            due.append(self._begin + self._ahead[0].at - (0.0 if self._waits else self._outlet.lead))
        if self._sounds:
            due.append(self._bell.now() + CHECK)
        return min((each for each in due if each > looked + EARLY), default=inf)

    def hand_over(self) -> None:
        """Hand over all that is due and may be said. Raises BodyFailed."""
        if self._outlet.fault is not None:
            raise BodyFailed(replace(self._outlet.fault, where=self._behavior.id))
        self._keep_up()
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
            if isinstance(item.what, Cut):
                self._outlet.cut(at, item.what.tail)
                return self.next_told()
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

    # -- a device that may be late ------------------------------------------------------------------------------

    @property
    def _sounds(self) -> bool:
        """True if there is sound with a device that may be late."""
        return self._outlet.is_live and (self._word is not None or bool(self._coming))

    def _keep_up(self) -> None:
        """Put off all that is to be told, and the lips, for sound that the device has not taken in time.

        Raises BodyFailed: it takes no more.
        """
        if not self._sounds:
            return
        late = self._outlet.late()
        if self._outlet.fault is not None:
            raise BodyFailed(replace(self._outlet.fault, where=self._behavior.id))
        if late is not None:
            self._begin += late
            self._lates += 1
            if self._lates == 1:
                self._tell_lips()
            elif self._is_cut:
                self._stop()
            elif self._lates == 2 and self._lips:
                self._on_lips(())
        elif self._lates:
            self._lates = 0
            if not self._is_paused:
                self._tell_lips()

    def _stop(self) -> None:
        """Wait no more for the end of the last word."""
        self._coming.clear()
        self._word = self._tail = None
        self._outlet.cut(self._bell.now(), b"")

    # -- handing over -------------------------------------------------------------------------------------------

    def _may_go(self, item: Item) -> bool:
        match item.what:
            case More(part=number):
                return self._part_of(number) is not None
            case Gap():
                return not self._authority.held
            case Reached(sync=sync) if item.is_gap:
                return self._authority.covers(sync)
        return True

    def _do(self, item: Item) -> None:
        match item.what:
            case More(part=number):
                part = self._part_of(number)
                assert part is not None
                self._begin_part(part, number, item.at)
            case Gap() as gap:
                self._word = gap.word
                self._handed.append((gap, item.at))
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
        self._ahead.extend(items_of(self._behavior, part, number, start, at))
        self._lips += [replace(each, at=each.at + at) for each in part.lips]
        self._tell_lips()

    def _cut(self) -> None:
        """Say no more than the word that is heard now."""
        if self._is_cut:
            return
        self._is_cut = True
        self._ahead.clear()
        words = [item for item in self._coming if isinstance(item.what, Spoke)]
        words += [] if self._word is None else [self._word]
        self._coming = deque(words)
        until = self._bell.now() - self._begin
        if self._lates < 2:
            until = next((gap.word.at for gap, at in self._handed if at < until < gap.word.at), until)
        if not self._outlet.lead or not words or words[-1].at <= until:
            self._rest()
            return
        kept = [word for word in words if word.at <= until]
        cut = Item(until, Cut(faded(self._before(until))))
        place = sum(word.at < until for word in kept)
        self._coming = deque([*kept[:place], cut, *kept[place:]])
        self._outlet.announce_cut(self._begin + until)
        self._tail = None

    def _before(self, until: Seconds) -> bytes:
        """The last samples before a time, as many as are to fade."""
        gap, at = next(((gap, at) for gap, at in reversed(self._handed) if at < until), (None, 0.0))
        if gap is None or not (part := self._ready[gap.part]).samples:
            return b""
        end = 2 * round((gap.since + until - at) * part.rate)
        return part.samples[max(0, end - 2 * round(FADE * part.rate)) : end]

    def _play(self, gap: Gap, at: Seconds) -> None:
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
            self._outlet.play(faded(tail), self._begin + sounds)
            self._outlet.rest()

    def _pause(self) -> None:
        if not self._is_paused:
            self._is_paused = True
            if self._lips:
                self._on_lips(())

    def _resume(self, item: Item) -> None:
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
            self._on_lips([replace(each, at=self._begin + each.at) for each in self._lips])
