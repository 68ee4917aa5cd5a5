"""Tiers of a recording: who did what from when to when, and what became of each connection event. Pure.

Times count from the beginning of the recording. Within a tier nothing overlaps, as annotation tools want it: what
does goes to another tier of the same name with a number.
"""

from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.attention import HeadOwner
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.conditions import StudyCondition, words
from engage_hri.schemas.feedback import BlockProgress, SyncPointProgress
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, OpenEvents
from engage_hri.schemas.units import Seconds
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.times import Times, messages

SHORTEST: Seconds = 0.001
"""Shortest annotation: annotation tools count milliseconds."""
NAMES = {
    "speak": "speech", "look": "gaze", "point": "points", "nod": "nods", "shake": "shakes", "act": "manipulations",
}  # fmt: skip
"""Tiers of the actions."""
STUDY = "study"
"""Actor of the tier that tells which condition of a study was in force."""
DO_NOT_END_EACH_OTHER = ("point", "act")
"""Actions of which an actor may do several at once."""


class Annotation(Struct, frozen=True):
    """A stretch of time with what is said of it."""

    begin: Seconds
    end: Seconds
    value: str


class Tier(Struct, frozen=True):
    """Annotations in the order of their beginnings. actor: whose; `connection events` for both sides."""

    name: str
    actor: str
    annotations: tuple[Annotation, ...]


def tiers(recording: Recording) -> list[Tier]:
    """Make all tiers. What had begun before the recording begins with it, what did not end ends with it."""
    collected = _Collected(recording.robot, Times(recording))
    for received, at in messages(recording):
        if keys.key_class(received.key) in ("evt", "state"):
            collected.take(received.message, max(0.0, at))
    return collected.tiers(recording.duration)


class _Collected:
    """Annotations by tier, as they are found."""

    def __init__(self, robot: str, times: Times) -> None:
        self._robot = robot
        self._times = times
        self._found: dict[tuple[str, str], list[Annotation]] = {}
        self._open: dict[tuple[str, ...], tuple[Seconds, str]] = {}
        """Beginning and value of what goes on: of actions by actor, action and more; of others by their sort."""
        self._events: dict[str, ConnectionEvent] = {}
        self._began: dict[str, Seconds] = {}
        self._word_end: dict[str, Seconds] = {}
        self._words: dict[str, list[str]] = {}
        self._head: tuple[Seconds, str] | None = None
        self._seen: set[tuple[object, ...]] = set()
        """Actions and words that were taken: those in a history may come twice."""

    def take(self, message: Message, at: Seconds) -> None:
        match message:
            case ActionBegan():
                self._begins(message, at)
            case OngoingActions(actions=actions):
                for action in actions:
                    began = self._times.at(action.at, at)
                    self._begins(action, max(0.0, at if began is None else began))
            case OpenEvents(events=events):
                for event in events:
                    if event.id not in self._events:
                        told = self._times.at(event.at, at)
                        self._event(event, at if told is None else told)
            case ActionEnded(actor=actor, action=action):
                self._end((actor, action, *self._more(message)), at)
            case ActorFound(actor=actor):
                self._open.setdefault((actor, "present"), (at, "here"))
            case ActorLost(actor=actor):
                for name in [name for name in self._open if name[0] == actor]:
                    self._end(name, at)
            case WordSpoken():
                self._word(message, at)
            case BlockProgress(block=str() as block, progress="start"):
                self._open[self._robot, "blocks", block] = (at, block)
            case BlockProgress(block=str() as block, progress="end", status=status):
                for name in [name for name in self._open if name[-1].startswith(f"{block}:")]:
                    if name[1] == "behaviors":  # those that were broken off have no end of their own
                        self._end(name, at)
                self._end((self._robot, "blocks", block), at, f"{block}: {status}")
            case SyncPointProgress(block=block, behavior=behavior, sync="start"):
                self._open[self._robot, "behaviors", f"{block}:{behavior}"] = (at, f"{block}:{behavior}")
            case SyncPointProgress(block=block, behavior=behavior, sync="end"):
                self._end((self._robot, "behaviors", f"{block}:{behavior}"), at)
            case ConnectionEvent():
                self._event(message, at)
            case StudyCondition(name=name, speech_only=speech_only, by=by):
                self._end((STUDY, "condition"), at)
                if by or speech_only:
                    self._open[STUDY, "condition"] = (at, words(name, speech_only))
            case HeadOwner(owner=owner):
                self._owner("" if owner.kind == "none" else f"{owner.kind} {owner.target}".strip(), at)

    def _more(self, action: ActionBegan | ActionEnded) -> tuple[str, ...]:
        several = action.behavior or action.action in DO_NOT_END_EACH_OTHER
        return (action.behavior, *action.targets) if several else ()

    def _begins(self, began: ActionBegan, at: Seconds) -> None:
        once = (began.actor, began.action, began.behavior, began.targets, began.at)
        if once in self._seen:
            return
        self._seen.add(once)
        if began.action == "look":
            for name in [name for name in self._open if name[:2] == (began.actor, "look")]:
                self._end(name, at)
        name = (began.actor, began.action, *self._more(began))
        self._end(name, at)
        value = " ".join(began.targets) or ("away" if began.action == "look" else began.behavior or began.action)
        self._open[name] = (at, value)

    def _end(self, name: tuple[str, ...], at: Seconds, value: str = "") -> None:
        if (begun := self._open.pop(name, None)) is None:
            return
        since, text = begun
        if name[1] == "speak" and len(name) > 2 and (words := self._words.pop(name[2], None)):
            text = " ".join(words)
        self._add(name[0], NAMES.get(name[1], name[1]), since, at, value or text)

    def _word(self, word: WordSpoken, at: Seconds) -> None:
        behavior = f"{word.block}:{word.behavior}"
        if (behavior, word.position) in self._seen:
            return
        self._seen.add((behavior, word.position))
        speech = self._open.get((self._robot, "speak", behavior))
        since = self._word_end.get(behavior, at if speech is None else speech[0])
        self._word_end[behavior] = at
        self._words.setdefault(behavior, []).append(word.word)
        self._add(self._robot, "words", since, at, word.word)

    def _event(self, event: ConnectionEvent, at: Seconds) -> None:
        if event.id not in self._events:
            self._began[event.id] = at - (event.at.seconds - event.started.seconds)
        decided = self._events.get(event.id)
        if event.state in ENDINGS:
            was = decided if event.state == "completed" and decided is not None else event
            self._add("connection events", event.kind, max(0.0, self._began[event.id]), at, said(was, self._robot))
            self._events.pop(event.id, None)
        else:
            self._events[event.id] = event

    def _owner(self, owner: str, at: Seconds) -> None:
        if self._head is not None:
            if self._head[1] == owner:
                return
            self._add(self._robot, "head owner", self._head[0], at, self._head[1])
        self._head = (at, owner) if owner else None

    def _add(self, actor: str, name: str, begin: Seconds, end: Seconds, value: str) -> None:
        annotation = Annotation(begin, max(end, begin + SHORTEST), value)
        self._found.setdefault((actor, name), []).append(annotation)

    def tiers(self, end: Seconds) -> list[Tier]:
        for name in list(self._open):
            self._end(name, end)
        for event in self._events.values():
            begin = max(0.0, self._began[event.id])
            self._add("connection events", event.kind, begin, end, said(event, self._robot))
        self._owner("", end)
        self._events.clear()
        found = sorted(self._found.items(), key=lambda one: (one[0][0] == "connection events", *one[0]))
        return [tier for (actor, name), annotations in found for tier in _apart(actor, name, annotations)]


def said(event: ConnectionEvent, robot: str) -> str:
    """Words about a connection event: what became of it, who began it, what it is about."""
    state = {"started": "open", "lost": "lost"}.get(event.state, event.state)
    delay = "" if event.delay is None else f" {event.delay:.3f} s"
    about = f", about {' '.join(event.objects)}" if event.objects else ""
    optional = ", optional" if event.optional else ""
    return f"{state}{delay}, {event.initiator} to {event.responder}{about}, {event.cause}{optional}"


def _apart(actor: str, name: str, annotations: Iterable[Annotation]) -> Iterator[Tier]:
    """Tiers in which nothing overlaps."""
    lanes: list[list[Annotation]] = []
    for one in sorted(annotations, key=lambda one: (one.begin, one.end)):
        lane = next((lane for lane in lanes if milliseconds(lane[-1].end) <= milliseconds(one.begin)), None)
        if lane is None:
            lanes.append(lane := [])
        lane.append(one)
    for number, lane in enumerate(lanes, 1):
        yield Tier(f"{actor} {name}" if number == 1 else f"{actor} {name} {number}", actor, tuple(lane))


def milliseconds(at: Seconds) -> int:
    return round(at * 1000)


def rows(all_tiers: Sequence[Tier]) -> Iterator[tuple[str, str, float, float, str]]:
    """Tier, actor, beginning, end and value of each annotation, by tier."""
    for tier in all_tiers:
        for one in tier.annotations:
            yield tier.name, tier.actor, round(one.begin, 6), round(one.end, 6), one.value
