"""A recording as a script to be read: who said what to whom, who was looked at, and what was answered. Pure.

    0:13.5  robot to ann, looking at ann, watched by bob and cy: "Ann, are you comfortable?"
            ann answered after 1.0 s: "Not really."

One paragraph for each speech, in the order in which they began. To whom it was is what recognition knew in the end;
of whom it did not know that, nothing is said. `Tiers` have the rest, to the millisecond.
"""

from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct, field

from engage_hri.schemas.recognition import ConnectionEvent, Floor
from engage_hri.schemas.units import Seconds
from engage_hri.services.recording.reading import Recording, RecordingTimes, messages
from engage_hri.services.recording.tiers import Annotation, tiers

GLIMPSE: Seconds = 0.3
"""A look within a speech that is shorter is not told: nobody has seen anything by then."""
SAME: Seconds = 0.5
"""Time between what two programs take for the beginning of one speech."""
PAUSE: Seconds = 0.5
"""Longest pause between what the robot says that is one paragraph."""
ANSWERED = {"speak": "answered", "nod": "nodded", "shake": "shook their head", "point": "pointed", "act": "did it"}


class SpokenLine(Struct):
    """A speech. told: what came of it, a line each."""

    who: str
    begin: Seconds
    end: Seconds
    text: str
    to: tuple[str, ...] = ()
    told: list[str] = field(default_factory=list)


def script(recording: Recording) -> str:
    """Write the script, a text with a paragraph for each speech."""
    robot, found = recording.robot, _Found(recording)
    lines = [*_speeches(found.spans("words", besides=robot), found.spans("speech", besides=robot))]
    lines += _joined(SpokenLine(robot, each.begin, each.end, each.value) for each in found.of(robot, "speech"))
    lines.sort(key=lambda line: (line.begin, line.who))
    for line in lines:
        line.to = found.addressees(line.who, line.begin)
    for event, began in found.events():
        asked = [line for line in lines if line.who == event.initiator and line.begin <= began + SAME]
        told = _answer(event, found.robot)
        if told and asked and told not in asked[-1].told:  # who answers first answers for all, pair by pair
            asked[-1].told.append(told)
    return "".join(f"{text}\n" for line in lines for text in _paragraph(line, found))


def _speeches(words: dict[str, list[Annotation]], sounds: dict[str, list[Annotation]]) -> Iterator[SpokenLine]:
    """Speeches of people: what was understood, and what was heard and not understood."""
    for who in sorted({*words, *sounds}):
        understood = words.get(who, [])
        for each in understood:
            yield SpokenLine(who, each.begin, each.end, each.value)
        for each in sounds.get(who, []):
            if not any(one.begin - SAME < each.end and each.begin < one.end + SAME for one in understood):
                yield SpokenLine(who, each.begin, each.end, "")


def _joined(lines: Iterable[SpokenLine]) -> Iterator[SpokenLine]:
    """Join what the robot says without a pause into one paragraph, whatever blocks it was said by."""
    last: SpokenLine | None = None
    for line in lines:
        if last is not None and line.begin <= last.end + PAUSE:
            last.text, last.end = f"{last.text} {line.text}", line.end
            continue
        if last is not None:
            yield last
        last = line
    if last is not None:
        yield last


def _answer(event: ConnectionEvent, robot: str) -> str:
    """Say in words what was answered; "": that is not known, or no answer is told here."""
    by = event.answered_by or event.responder
    if event.kind == "backchannel":
        return f"{by} showed that they listen" + (f': "{event.words}"' if event.words else "")
    if event.state == "failed" and event.delay is None:
        return f"{by} did not answer" if event.initiator == robot else ""
    if event.response is None:
        return ""
    when = "" if event.delay is None else f" after {event.delay:.1f} s" if event.delay >= 0 else " before it was over"
    return f"{by} {ANSWERED[event.response]}{when}" + (f': "{event.words}"' if event.words and by != robot else "")


def _paragraph(line: SpokenLine, found: "_Found") -> Iterator[str]:
    to = f" to {_listed(line.to)}" if line.to else ""
    at, watched = found.looked_at(line), found.watched_by(line)
    looking = f", looking at {_listed(at)}" if at else ""
    by = f", watched by {_listed(watched)}" if watched else ""
    words = f'"{line.text}"' if line.text else "(without words)"
    minutes, seconds = divmod(round(line.begin, 1), 60)
    yield f"{f'{int(minutes)}:{seconds:04.1f}':>8}  {line.who}{to}{looking}{by}: {words}"
    yield from (f"{'':10}{told}" for told in line.told)


def _listed(names: Sequence[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


class _Found:
    """Speeches, looks, addressees and answers of a recording."""

    def __init__(self, recording: Recording) -> None:
        self.robot = recording.robot
        self._tiers = tiers(recording)
        times = RecordingTimes(recording)
        self._to: dict[str, list[tuple[Seconds, tuple[str, ...]]]] = {}
        self._events: dict[str, tuple[ConnectionEvent, Seconds]] = {}
        for received, at in messages(recording):
            match received.message:
                case Floor(speeches=speeches, ended=ended):
                    for each in (*ended, *speeches):
                        since = times.at(each.since, at)
                        if each.to and since is not None:
                            self._to.setdefault(each.actor, []).append((since, each.to))
                case ConnectionEvent(kind="adjacency_pair" | "backchannel") as event:
                    began = times.at(event.started, at)
                    self._events[event.id] = event, at if began is None else began

    def of(self, actor: str, sort: str) -> list[Annotation]:
        """All that an actor does of one sort, in order."""
        named = [tier for tier in self._tiers if tier.actor == actor and tier.name.startswith(f"{actor} {sort}")]
        return sorted((each for tier in named for each in tier.annotations), key=lambda each: each.begin)

    def spans(self, sort: str, *, besides: str) -> dict[str, list[Annotation]]:
        """The same of all actors but one."""
        return {actor: self.of(actor, sort) for actor in sorted({tier.actor for tier in self._tiers} - {besides})}

    def events(self) -> Iterator[tuple[ConnectionEvent, Seconds]]:
        """Pairs and backchannels as they were told last, and when they began."""
        yield from sorted(self._events.values(), key=lambda each: each[1])

    def addressees(self, who: str, begin: Seconds) -> tuple[str, ...]:
        """Return to whom a speech was that began then, as it was known last."""
        near = [(abs(since - begin), -number, to) for number, (since, to) in enumerate(self._to.get(who, []))]
        return min(near)[2] if near and min(near)[0] <= SAME else ()

    def looked_at(self, line: SpokenLine) -> tuple[str, ...]:
        """Return what the speaker looked at, in order."""
        looks = self.of(line.who, "gaze")
        seen = [each.value for each in looks if _shared(each, line) >= GLIMPSE and each.value != "away"]
        return tuple(dict.fromkeys(seen))

    def watched_by(self, line: SpokenLine) -> tuple[str, ...]:
        """Return those who looked at the speaker for at least half of the speech."""
        actors = sorted({tier.actor for tier in self._tiers} - {line.who})
        looks = {who: [each for each in self.of(who, "gaze") if each.value == line.who] for who in actors}
        shares = {who: sum(_shared(each, line) for each in looks[who]) for who in actors}
        return tuple(who for who, shared in shares.items() if 0 < line.end - line.begin <= 2 * shared)


def _shared(one: Annotation, line: SpokenLine) -> Seconds:
    return max(0.0, min(one.end, line.end) - max(one.begin, line.begin))
