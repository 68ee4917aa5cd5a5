"""Tiers of a recording, and files of them for ELAN (`.eaf`) and as CSV. Pure.

A tier says who did what from when to when, or what became of each connection event, and nothing in it overlaps.
Times count from the beginning of the recording. What had begun before begins with it, and what does not end ends with
it, or when the program that told of it has gone for good.
"""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from lxml import etree
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.fragments import HeadOwner, StudyCondition
from engage_hri.schemas.fragments import condition_words as condition
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions, Utterance
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, OpenEvents
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Received
from engage_hri.services.recording.reading import Recording, RecordingTimes, messages
from engage_hri.services.reports.ongoing_actions import ends

SHORTEST: Seconds = 0.001
"""Shortest annotation: annotation tools count milliseconds."""


class Annotation(Struct, frozen=True):
    """A stretch of time with what is said of it."""

    begin: Seconds
    end: Seconds
    value: str

    @property
    def milliseconds(self) -> tuple[int, int]:
        """Beginning and end in whole milliseconds, as ELAN counts; the end is after the beginning."""
        begin = round(self.begin * 1000)
        return begin, max(round(self.end * 1000), begin + 1)


class Tier(Struct, frozen=True):
    """Annotations in the order of their beginnings. actor: whose; `connection events` for both sides."""

    name: str
    actor: str
    annotations: tuple[Annotation, ...]


def apart(actor: str, name: str, annotations: Iterable[Annotation]) -> Iterator[Tier]:
    """Make tiers in which nothing overlaps.

    An instant, such as a dash between two words, is given the shortest length. That is no overlap: what follows it
    begins so much later.
    """
    lanes: list[list[Annotation]] = []
    ends: list[Seconds] = []
    """Of each lane the end of its last annotation as it really was."""
    for one in sorted(annotations, key=lambda one: (one.begin, one.end)):
        at = round(one.begin * 1000)
        number = next((number for number, end in enumerate(ends) if round(end * 1000) <= at), len(lanes))
        if number == len(lanes):
            lanes.append([])
            ends.append(0.0)
        begin = one.begin
        if lanes[number]:
            last = lanes[number][-1]
            until = last.milliseconds[1]
            if until > at or (last.end > ends[number] and last.end > begin):
                begin = max(until / 1000, last.end)
        ends[number] = max(one.begin, one.end)
        end = one.end if one.end - begin >= SHORTEST - 1e-9 else begin + SHORTEST
        lanes[number].append(Annotation(begin, end, one.value))
    for number, lane in enumerate(lanes, 1):
        yield Tier(f"{actor} {name}" if number == 1 else f"{actor} {name} {number}", actor, tuple(lane))


def rows(all_tiers: Sequence[Tier]) -> Iterator[tuple[str, str, float, float, str]]:
    """Tier, actor, beginning, end and value of each annotation, by tier."""
    for tier in all_tiers:
        for one in tier.annotations:
            yield tier.name, tier.actor, round(one.begin, 6), round(one.end, 6), one.value


_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_FORMAT = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
COLUMNS = ("tier", "actor", "begin", "end", "value")


class Media(NamedTuple):
    """A film of a recording, from its beginning on and as fast as it was. relative: address from the document."""

    address: str
    relative: str


def eaf(tiers: Sequence[Tier], *, date: str, media: Media | None = None) -> bytes:
    """An ELAN document. date: of the recording, as XML Schema has it. media: a film of it."""
    root = etree.Element("ANNOTATION_DOCUMENT", nsmap={"xsi": _XSI})
    for name, value in (("AUTHOR", "engage"), ("DATE", date), ("FORMAT", "3.0"), ("VERSION", "3.0")):
        root.set(name, value)
    root.set(f"{{{_XSI}}}noNamespaceSchemaLocation", _FORMAT)
    header = etree.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    if media is not None:
        address, relative = media
        etree.SubElement(
            header, "MEDIA_DESCRIPTOR", MEDIA_URL=address, MIME_TYPE="video/mp4", RELATIVE_MEDIA_URL=relative
        )  # fmt: skip
    times = sorted({at for tier in tiers for one in tier.annotations for at in one.milliseconds})
    slots = {at: f"ts{number}" for number, at in enumerate(times, 1)}
    order = etree.SubElement(root, "TIME_ORDER")
    for at, slot in slots.items():
        etree.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(at))
    number = 0
    for tier, name in zip(tiers, _unique([_xml(tier.name) for tier in tiers]), strict=True):
        element = etree.SubElement(
            root, "TIER", LINGUISTIC_TYPE_REF="default-lt", PARTICIPANT=_xml(tier.actor), TIER_ID=name
        )  # fmt: skip
        for one in tier.annotations:
            number += 1
            begin, end = (slots[at] for at in one.milliseconds)
            holder = etree.SubElement(element, "ANNOTATION")
            annotation = etree.SubElement(
                holder, "ALIGNABLE_ANNOTATION", ANNOTATION_ID=f"a{number}", TIME_SLOT_REF1=begin, TIME_SLOT_REF2=end
            )  # fmt: skip
            etree.SubElement(annotation, "ANNOTATION_VALUE").text = _xml(one.value)
    etree.SubElement(
        root, "LINGUISTIC_TYPE", GRAPHIC_REFERENCES="false", LINGUISTIC_TYPE_ID="default-lt", TIME_ALIGNABLE="true"
    )  # fmt: skip
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _unique(names: Sequence[str]) -> list[str]:
    """The same names, each with a number behind it if there was one like it."""
    found: dict[str, None] = {}
    for name in names:
        new, number = name, 1
        while new in found:
            number += 1
            new = f"{name} ({number})"
        found[new] = None
    return list(found)


def _xml(text: str) -> str:
    """Text without what XML cannot hold."""
    return "".join(
        letter for letter in text if letter in "\t\n\r" or (letter >= " " and letter not in "\ufffe\uffff")
    )


def table(tiers: Sequence[Tier]) -> str:
    """CSV: tier, actor, beginning, end in seconds, value."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows(tiers))
    return text.getvalue()


NAMES = {
    "speak": "speech", "look": "gaze", "point": "points", "nod": "nods", "shake": "shakes", "act": "manipulations",
}  # fmt: skip
"""Tiers of the actions."""
STUDY = "study"
"""Actor of the tier that tells which condition of a study was in force."""
DO_NOT_END_EACH_OTHER = ("point", "act")
"""Actions of which an actor may do several at once."""
TOLD_ONCE = (
    ActionBegan, ActionEnded, ActorFound, ActorLost, WordSpoken, BlockProgress, SyncPointProgress, ConnectionEvent,
    Utterance,
)  # fmt: skip
"""Events. The same one again is from a history, or was sent anew after a cut."""


def tiers(recording: Recording) -> list[Tier]:
    """Make all tiers."""
    collected = _Collected(recording.robot, RecordingTimes(recording))
    for received, at in messages(recording):
        if keys.key_class(received.key) in ("evt", "state", "alive"):
            collected.take(received, at)
    return collected.tiers(recording.duration)


class _Open(Struct):
    """Something that goes on. life: the one that told of it."""

    begin: Seconds
    value: str
    life: str
    action: ActionBegan | None = None


class _OpenEvent(Struct):
    """A connection event that goes on, as it was told last."""

    begin: Seconds
    event: ConnectionEvent
    life: str


class _Lives:
    """Lives of the participants, by who is there."""

    def __init__(self) -> None:
        self._there: dict[str, str] = {}
        self._gone: dict[str, Seconds] = {}

    def come(self, name: str, run: str) -> None:
        self._there[name] = run
        self._gone.pop(run, None)

    def go(self, name: str, at: Seconds) -> None:
        run = self._there.pop(name, None)
        if run is not None and run not in self._there.values():
            self._gone[run] = at

    def gone(self, life: str) -> Seconds | None:
        """Time at which the last participant of a life has gone; None: some is there, or none was ever seen."""
        return self._gone.get(life)

    def until(self, life: str, at: Seconds) -> Seconds:
        """End of what a life has told of: `at`, if it is still there then."""
        return min(at, self._gone.get(life, at))


class _Collected:
    """Annotations by tier, as they are found."""

    def __init__(self, robot: str, times: RecordingTimes) -> None:
        self._robot = robot
        self._times = times
        self._lives = _Lives()
        self._found: dict[tuple[str, str], list[Annotation]] = {}
        self._open: dict[tuple[str, ...], _Open] = {}
        """What goes on: actions by actor, action, behavior and targets; others by their actor and sort, and more."""
        self._events: dict[str, _OpenEvent] = {}
        self._ended: set[str] = set()
        """Connection events that have ended."""
        self._last_words: dict[str, tuple[Seconds, list[str]]] = {}
        """Of each speech of the robot, the end of its last word, and all of them."""
        self._utterances: dict[tuple[str, str], tuple[Seconds, Utterance]] = {}
        self._head: _Open | None = None
        self._told: set[object] = set()

    def take(self, received: Received, at: Seconds) -> None:
        """Take a message that tells of this time."""
        message, life = received.message, received.life
        if isinstance(message, TOLD_ONCE):
            if message in self._told:
                return
            self._told.add(message)
        match message:
            case PeerAlive(participant=participant, run=run):
                self._lives.come(participant, run)
            case PeerGone(participant=participant):
                self._lives.go(participant, at)
            case ActionBegan():
                self._begins(message, at, life)
            case ActionEnded():
                self._ends(message, at)
            case OngoingActions():
                self._goes_on(message, at, life)
            case ActorFound(actor=actor):
                self._open.setdefault((actor, "present"), _Open(at, "here", life))
            case ActorLost(actor=actor):
                self._lost(actor, at)
            case Utterance(actor=actor, id=id, final=True):
                known = self._utterances.get((actor, id))
                if known is None or known[0] <= at:
                    self._utterances[actor, id] = (at, message)
            case WordSpoken():
                self._word(message, at)
            case BlockProgress(block=str() as block, progress="start"):
                self._open[self._robot, "blocks", block] = _Open(at, block, life)
            case BlockProgress(block=str() as block, progress="end", status=status):
                for name in [name for name in self._open if name[-1].startswith(f"{block}:")]:
                    if name[1] == "behaviors":  # those that were broken off have no end of their own
                        self._end(name, at)
                self._end((self._robot, "blocks", block), at, f"{block}: {status}")
            case SyncPointProgress(block=block, behavior=behavior, sync="start"):
                self._open[self._robot, "behaviors", f"{block}:{behavior}"] = _Open(at, f"{block}:{behavior}", life)
            case SyncPointProgress(block=block, behavior=behavior, sync="end"):
                self._end((self._robot, "behaviors", f"{block}:{behavior}"), at)
            case ConnectionEvent():
                self._event(message, at, life)
            case OpenEvents(events=events):
                for event in events:
                    told = self._times.at(event.at, at)
                    self._event(event, at if told is None else told, life)
            case StudyCondition(name=name, speech_only=speech_only):
                self._end((STUDY, "condition"), at)
                if message.is_told:
                    self._open[STUDY, "condition"] = _Open(at, condition(name, speech_only), life)
            case HeadOwner(owner=owner):
                self._owner("" if owner.kind == "none" else f"{owner.kind} {owner.target}".strip(), at, life)

    # -- actions --------------------------------------------------------------------------------------------------

    def _begins(self, began: ActionBegan, at: Seconds, life: str) -> None:
        several = began.behavior or began.action in DO_NOT_END_EACH_OTHER
        name = (began.actor, began.action, *((began.behavior, *began.targets) if several else ()))
        is_look = began.action == "look"
        before = [other for other in self._open if other == name or (is_look and other[:2] == name[:2])]
        if any(self._open[other].life == life and self._open[other].begin > at for other in before):
            return  # it comes from a history, behind the state that has what came after it
        for other in before:
            self._end(other, at)
        value = " ".join(began.targets) or ("away" if is_look else began.behavior or began.action)
        self._open[name] = _Open(at, value, life, began)
        if began.action == "speak":
            self._last_words.pop(began.behavior, None)

    def _ends(self, ended: ActionEnded, at: Seconds) -> None:
        """End all that this is the end of: one without targets ends each that is else the same."""
        for name, one in list(self._open.items()):
            if name[0] == ended.actor and one.action and ends(ended, one.action) and one.begin <= at:
                self._end(name, at)

    def _goes_on(self, told: OngoingActions, at: Seconds, life: str) -> None:
        """Take a state: what is missing in it has ended, what is new in it goes on."""
        if told.seen is False:
            self._lost(told.actor, at)
            return
        if told.seen:
            self._open.setdefault((told.actor, "present"), _Open(at, "here", life))
        going = {(each.action, each.behavior, each.targets): each for each in told.actions}
        for name, one in list(self._open.items()):
            if name[0] != told.actor or one.action is None or one.life != life:
                continue
            if going.pop((one.action.action, one.action.behavior, one.action.targets), None) is None:
                self._end(name, at)
        for each in going.values():
            since = self._times.at(each.at, at)
            is_again = each in self._told  # as of somebody who was lost for a while
            self._begins(each, at if is_again or since is None else since, life)
        self._told.update(told.actions)

    def _lost(self, actor: str, at: Seconds) -> None:
        for name in [name for name in self._open if name[0] == actor]:
            self._end(name, at)

    def _end(self, name: tuple[str, ...], at: Seconds, value: str = "") -> None:
        if (begun := self._open.pop(name, None)) is None:
            return
        text = begun.value
        if name[1] == "speak" and len(name) > 2 and (words := self._last_words.pop(name[2], None)):
            text = " ".join(words[1])
        self._add(name[0], NAMES.get(name[1], name[1]), begun.begin, self._lives.until(begun.life, at), value or text)

    # -- words ----------------------------------------------------------------------------------------------------

    def _word(self, word: WordSpoken, at: Seconds) -> None:
        behavior = f"{word.block}:{word.behavior}"
        speech = self._open.get((self._robot, "speak", behavior))
        since, words = self._last_words.get(behavior, (at if speech is None else speech.begin, []))
        self._last_words[behavior] = (at, [*words, word.word])
        self._add(self._robot, "words", since, at, word.word)

    def _heard(self) -> None:
        """Add the words of people, each utterance as it was understood last."""
        for came, utterance in self._utterances.values():
            begin = self._times.at(utterance.began, came)
            end = None if utterance.ended is None else self._times.at(utterance.ended, came)
            if utterance.text:
                begin, end = came if begin is None else begin, came if end is None else end
                self._add(utterance.actor, "words", begin, end, utterance.text)

    # -- connection events, and who has the head --------------------------------------------------------------------

    def _event(self, event: ConnectionEvent, at: Seconds, life: str) -> None:
        if event.id in self._ended:  # told again with its words, or from a history
            return
        known = self._events.get(event.id)
        began = at - (event.at.seconds - event.started.seconds) if known is None else known.begin
        if event.state not in ENDINGS:
            self._events[event.id] = _OpenEvent(began, event, life)
            return
        self._ended.add(event.id)
        self._events.pop(event.id, None)
        was = known.event if event.state == "completed" and known is not None else event
        self._add("connection events", event.kind, began, at, said(was))

    def _owner(self, owner: str, at: Seconds, life: str) -> None:
        if self._head is not None:
            if (self._head.value, self._head.life) == (owner, life):
                return
            until = self._lives.until(self._head.life, at)
            self._add(self._robot, "head owner", self._head.begin, until, self._head.value)
        self._head = _Open(at, owner, life) if owner else None

    # -- tiers ------------------------------------------------------------------------------------------------------

    def _add(self, actor: str, name: str, begin: Seconds, end: Seconds, value: str) -> None:
        """Add an annotation, but for what was over before the recording began."""
        if end < 0:
            return
        begin = max(0.0, begin)
        self._found.setdefault((actor, name), []).append(Annotation(begin, max(begin, end), value))

    def tiers(self, end: Seconds) -> list[Tier]:
        """End what goes on, and make the tiers."""
        for name in list(self._open):
            self._end(name, end)
        for one in self._events.values():
            gone = self._lives.gone(one.life)
            self._add(
                "connection events", one.event.kind, one.begin, end if gone is None else gone,
                said(one.event, "" if gone is None else "lost"),
            )  # fmt: skip
        self._owner("", end, "")
        self._heard()
        found = sorted(self._found.items(), key=lambda one: (one[0][0] == "connection events", *one[0]))
        return [tier for (actor, name), annotations in found for tier in apart(actor, name, annotations)]


def said(event: ConnectionEvent, state: str = "") -> str:
    """Words about a connection event: what became of it, who began it, what it is about.

    state: other than the one that it has.
    """
    state = state or ("open" if event.state == "started" else event.state)
    delay = "" if event.delay is None else f" {event.delay:.3f} s"
    about = f", about {' '.join(event.objects)}" if event.objects else ""
    optional = ", optional" if event.optional else ""
    return f"{state}{delay}, {event.initiator} to {event.responder}{about}, {event.cause}{optional}"
