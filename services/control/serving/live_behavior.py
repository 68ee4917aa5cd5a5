"""Behaviors that the body performs: what was asked, what the driver has told of each, and why it waits. Pure.

A driver is a program of somebody else. Bodies are held to all of the contract by `testing`; here is what would make a
message untrue by itself. `sound` makes values of what a driver tells, so that they can be noted; `Told` compares them
with what was told before.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import isfinite
from typing import Any, Literal

from lxml import etree
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES, sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Head, Speech
from engage_hri.schemas.body import Estimate, EstimateItem, PerformBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, MovementAuthority, Progress, Reached, Spoke
from engage_hri.services.control.serving.steps import Nonsense
from engage_hri.services.text.ear import Heard, heard

# -- words for the ear -----------------------------------------------------------------------------------------------
# The text of a speech is its author's, with marks of Markdown, tags and emoji. Whatever voice says it, ours or
# another one, it is given a speech of the words alone (services/text), with marks and markup where they belong in
# these. What it tells of that one is told on of the author's: the places of words, and the estimates.


def spoken(behavior: BlockBehavior) -> BlockBehavior:
    """The behavior that a body is given for one as it was asked for."""
    return _words_of(behavior) if isinstance(behavior, Speech) else behavior


def spoken_items(items: Sequence[EstimateItem]) -> list[EstimateItem]:
    """The items that a body is asked about."""
    return [replace(each, behavior=spoken(each.behavior)) for each in items]


def progress_of(behavior: BlockBehavior, progress: Progress) -> Progress:
    """Progress that a body tells of `spoken(behavior)`, as progress of the behavior."""
    if isinstance(behavior, Speech) and isinstance(progress, Spoke):
        return replace(progress, position=heard(behavior.text).written(int(progress.position)))
    return progress


def estimate_of(behavior: BlockBehavior, estimate: Estimate) -> Estimate:
    """Estimate of `spoken(behavior)` as one of the behavior; what will not be said is told in it."""
    if not isinstance(behavior, Speech) or (ear := heard(behavior.text)).text == behavior.text:
        return estimate
    words = tuple(replace(each, position=ear.written(each.position)) for each in estimate.words)
    told = "; ".join(each for each in (*ear.problems, estimate.degraded) if each)
    return replace(estimate, words=words, degraded=told if estimate.feasible else estimate.degraded)


@lru_cache(256)  # of a plan the same speeches are estimated again and again
def _words_of(speech: Speech) -> Speech:
    ear = heard(speech.text)
    if ear.text == speech.text:
        return speech
    marks = tuple(replace(each, position=ear.place(each.position)) for each in speech.marks)
    return replace(speech, text=ear.text, marks=marks, markup=_markup(speech, ear))


def _markup(speech: Speech, ear: Heard) -> str:
    """The markup around the words that are for the ear; as it is where it has other words than the text."""
    try:
        root = etree.fromstring(f"<speak>{speech.markup}</speak>".encode(), _PARSER)
    except etree.XMLSyntaxError:
        return speech.markup
    if not speech.markup or "".join("".join(map(str, root.itertext())).split()) != "".join(speech.text.split()):
        return speech.markup
    said: dict[int, str] = {}
    last = 0
    for letter, place in zip(ear.text, ear.places, strict=True):
        # A pause where a line ends has the place of the line break. It belongs to the letter before.
        last = place if letter.isspace() or not speech.text[place].isspace() else last
        said[last] = said.get(last, "") + letter
    places = iter([place for place, letter in enumerate(speech.text) if not letter.isspace()])

    def words(text: str | None) -> str:
        return "".join(each if each.isspace() else said.get(next(places), "") for each in text or "")

    def through(element: etree._Element) -> None:
        element.text = words(element.text)
        for child in element:
            through(child)
            child.tail = words(child.tail)

    through(root)
    return etree.tostring(root, encoding="unicode").removeprefix("<speak>").removesuffix("</speak>")


_PARSER = etree.XMLParser(resolve_entities=False, no_network=True, recover=False, remove_comments=True)


Status = Literal["done", "taken_over", "aborted", "lapsed", "failed"]


class LiveBehavior:
    """A `PerformBehavior` that is under way.

    id: as the requester gave it; `request.id` is unique among the requests of all requesters.
    authority: what it may do, as it was decided; the one that the driver has is made to say the same.
    voiced: the behavior as the driver is given it. told: what the driver has told of it.
    is_accepted: true once the driver has told anything. position: characters that the voice has said.
    passed: the last sync point that it has passed. status, fault: of its outcome, if it ended now.
    why: why it is to end early. lapses: true if it does so without its requester.
    aborts: ids of the abort requests that end with it.
    is_held: somebody has asked to hold it. is_unheard: it is held because its requester is not heard.
    overdue: time at which its driver has not done what it was told; None: it was told nothing of the kind.
    is_broken_off: the driver was cut off, for it did not end it. is_broken: the driver has told what cannot be.
    """

    def __init__(self, request: PerformBehavior, id: str, now: Seconds) -> None:
        """Begin. Raises ValueError: the behavior has no sync point `through`."""
        self.request = request
        self.id = id
        self.authority = MovementAuthority(request.behavior, request.through)
        self.voiced = spoken(request.behavior)
        self.told = Told(self.voiced, self.authority, now)
        self.is_accepted = False
        self.position = 0
        self.passed = ""
        self.status: Status = "aborted"
        self.fault: Fault | None = None
        self.why: Fault | None = None
        self.lapses = False
        self.aborts: list[str] = []
        self.is_held = request.held
        self.is_unheard = False
        self.overdue: Seconds | None = None
        self.is_broken_off = False
        self.is_broken = False

    @property
    def label(self) -> str:
        return f"{self.request.block}:{self.request.behavior.id}"

    @property
    def spoken(self) -> str:
        """Text that the voice has said so far; empty for a behavior that is no speech."""
        behavior = self.request.behavior
        return behavior.text[: self.position] if isinstance(behavior, Speech) else ""

    def stop(self, why: Fault, *, lapses: bool = False) -> None:
        """Note why it is to end early; what came first counts."""
        if self.why is None:
            self.why, self.lapses = why, lapses


SKEW: Seconds = 0.25
"""What a body tells may be this much older than its behavior, or this much ahead: a robot has a clock of its own."""


def sound(told: object) -> Progress | Nonsense:
    """Pass on what a driver tells: the same, with each field of its type, or why that cannot be."""
    try:
        match told:
            case Reached(sync=sync, at=at, arrived=arrived):
                return Reached(_name(sync), _time(sync, at), _time(sync, arrived))
            case Arrived(sync=sync, at=at):
                return Arrived(_name(sync), _time(sync, at))
            case Spoke(word=word, position=position, at=at):
                return Spoke(str(word), _position(position), _time("a word", at))
    except ValueError as error:
        return Nonsense(str(error))
    return Nonsense(f"a {type(told).__name__}, which is no progress")


def _name(sync: object) -> str:
    if not isinstance(sync, str):
        raise ValueError(f"{sync!r}, which is no name of a sync point")
    return sync


def _time(what: str, at: object) -> Seconds:
    if isinstance(at, bool) or not isinstance(at, int | float) or not isfinite(at):
        raise ValueError(f"{what!r} at {at!r}, which is no time of the loop")
    return float(at)


def _position(position: Any) -> int:
    try:
        return int(position)  # a driver's number, of whatever type
    except (TypeError, ValueError):
        raise ValueError(f"a word that ends at {position!r}, which is no number of characters") from None


class Told:
    """Points and words of a behavior that its body has told so far."""

    def __init__(self, behavior: BlockBehavior, authority: MovementAuthority, began: Seconds) -> None:
        """authority: as it is extended and revoked. began: loop time at which the behavior was begun."""
        self._points: Sequence[str] = sync_points(behavior)
        self._holds = self._points if isinstance(behavior, Speech) else TYPES[type_name(behavior)].holds
        self._length = len(behavior.text) if isinstance(behavior, Speech) else 0
        self._type = type_name(behavior)
        self._authority = authority
        self._began = began
        self._passed = -1
        """Number of the last point that it has passed."""
        self._said = 0
        repetitions = behavior.repetition if isinstance(behavior, Head) else 1
        self._strokes = [f"stroke:{number}" for number in range(2, repetitions + 1)]
        """Points of a repeated movement that a body may tell of, or not."""
        self._struck = 1
        """Strokes of a repeated movement that are over, once the first is."""

    def flaw(self, progress: Progress, now: Seconds) -> str:
        """Say what cannot be in what the body tells now; empty: nothing. now: loop time."""
        match progress:
            case Reached(sync=sync, at=at, arrived=arrived):
                untimely = self._untimely(sync, now, at, arrived)
                return untimely or (self._strikes(sync) if sync in self._strokes else self._passes(sync))
            case Arrived(sync=sync, at=at):
                return self._untimely(sync, now, at) or self._unpassed(sync)
            case Spoke(position=position, at=at):
                return self._untimely("a word", now, at) or self._says(position)

    def missing(self) -> str:
        """Say what is missing now that the body has ended the behavior; empty: nothing."""
        if self._authority.revoked is not None or self._passed == len(self._points) - 1:
            return ""
        after = f"after {self._points[self._passed]!r}" if self._passed >= 0 else "before its start"
        return f"an end of this {self._type} {after}, and nobody has told it to end it there"

    def _untimely(self, what: str, now: Seconds, *times: Seconds) -> str:
        for at in times:
            if at > now + SKEW:
                return f"{what!r} {at - now:.3f} s before it is"
            if at < self._began - SKEW:
                return f"{what!r} {self._began - at:.3f} s before the behavior began"
        return f"{what!r} before it had come there" if len(times) > 1 and times[1] > times[0] + SKEW else ""

    def _strikes(self, sync: str) -> str:
        self._struck += 1
        if sync == f"stroke:{self._struck}" and self._passed == self._points.index("stroke"):
            return ""
        return f"{sync!r} where it does not follow the stroke before it"

    def _unpassed(self, sync: str) -> str:
        if sync not in self._points:
            return f"{sync!r}, and a {self._type} has the points {', '.join(self._points)}"
        if self._points.index(sync) <= self._passed:
            return f"{sync!r} after {self._points[self._passed]!r}"
        return ""

    def _passes(self, sync: str) -> str:
        if wrong := self._unpassed(sync):
            return wrong
        place, allowed = self._points.index(sync), self._points.index(self._authority.through)
        # Where it cannot hold it need not: it goes on to where it can.
        if any(point in self._holds for point in self._points[allowed + 1 : place + 1]):
            return f"{sync!r}, and it may go no further than {self._authority.through!r}"
        before, self._passed = self._passed, place
        if self._passed != before + 1 and self._authority.revoked is None:
            return f"{sync!r} without {self._points[before + 1]!r} before it"
        return ""

    def _says(self, position: int) -> str:
        before, self._said = self._said, position
        if not before <= self._said <= self._length:
            return f"a word that ends at {self._said} of {self._length} characters after one that ended at {before}"
        return ""
