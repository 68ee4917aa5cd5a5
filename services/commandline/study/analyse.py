"""Command `engage analyse`: recorded sessions in the tables of `engage simulate`."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated, NamedTuple

import typer
from msgspec import Struct, structs

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.commandline.shell.options import Quiet
from engage_hri.services.commandline.shell.outputs import Terminal
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.roster import widest
from engage_hri.services.commandline.study.again import play_again
from engage_hri.services.commandline.study.tables import StudyReport
from engage_hri.services.console.follow import FOLLOWED
from engage_hri.services.console.heard import Heard
from engage_hri.services.recognition.statistics.tally import EventTally
from engage_hri.services.recording.reading import Recording, RecordingTimes, messages, moved
from engage_hri.services.recording.settings import COLUMNS, LifeSettings, changed, flat, rows, settings_of
from engage_hri.services.reports.in_force import InForce
from engage_hri.services.runtime.service import shown
from engage_hri.services.study import summary
from engage_hri.services.study.hypotheses import BASELINE, HypothesisResult, findings
from engage_hri.services.study.records import EventRecord, SessionRecord
from engage_hri.services.study.records import SessionRecorder as Record
from engage_hri.services.study.summary import BETWEEN, WITHIN, NumberTable

WINDOW: Seconds = 30.0
"""Window of a tally whose recent numbers nobody reads."""


COUNTED = (*FOLLOWED, keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING)
"""Expressions for all messages that the numbers come from."""


class Told(NamedTuple):
    """A message, and the time in the recording that it tells of. past: it is from before the recording."""

    message: Message
    at: Seconds
    past: bool = False


UNNAMED = "recorded"
"""Condition of recordings that name none."""


class Stretch(Struct, frozen=True):
    """A part of a recording. name: of the condition; empty: it belongs to none. begin, end: in the recording."""

    name: str
    begin: Seconds
    end: Seconds

    @property
    def seconds(self) -> Seconds:
        return self.end - self.begin


def stretches(told: Iterable[tuple[Message, Seconds]], named: str, duration: Seconds) -> list[Stretch]:
    """Divide a recording where a condition was set. All of it is one stretch if none was.

    told: messages with their times in the recording. named: the condition that the recording was made
    under, as the recorder was told; it holds until one is set. A condition that was set ends with its generation:
    none is in force until one is set again.
    """
    names, study = [(0.0, named)], InForce()
    for message, at in told:
        before, study = study, study.after(message)
        if study.told is not before.told:
            names.append((max(0.0, at), _name(study, named)))
    begun = dict(sorted(names, key=lambda one: one[0]))  # of two at one instant the later one holds
    found: list[Stretch] = []
    for begin, name in begun.items():
        if found and (found[-1].name == name or begin >= duration):
            continue
        if found:
            found[-1] = Stretch(found[-1].name, found[-1].begin, begin)
        found.append(Stretch(name, begin, duration))
    return found if any(one.name for one in found) else [Stretch(UNNAMED, 0.0, duration)]


def _name(study: InForce, named: str) -> str:
    """The condition that counts. named: the recorder's, which counts where nobody has set one."""
    if study.told is not None and study.told.by:
        return study.told.name
    return named if study.lost is None else ""


class Session(Struct, frozen=True, kw_only=True):
    """A recording in numbers, or the part of it under one condition. participant: empty: not told.

    published: what recognition said itself in the end; None: it said nothing, or of more than this part.
    doubts: what may be wrong with these numbers, in words. settings: those under which its services ran.
    """

    path: Path
    condition: str
    participant: str
    record: SessionRecord
    events: tuple[EventRecord, ...]
    published: WindowStatistics | None
    doubts: tuple[str, ...] = ()
    settings: tuple[LifeSettings, ...] = ()


def sessions(recording: Recording) -> list[Session]:
    """Take a recording's numbers: a session for each condition that was set in it, or one of all of it.

    Of several, those under no condition, and those with nobody there, are left out; a doubt says so.
    """
    times = RecordingTimes(recording)
    told = [*_told(recording, times)]
    doubts, settings = tuple(_doubts(recording, told, times)), tuple(settings_of(recording))
    parts = stretches(
        ((one.message, one.at) for one in told), recording.facts.get("condition", ""), recording.duration
    )
    found = (_session(recording, told, times, part) for part in parts if part.name)
    made = [structs.replace(one, doubts=doubts, settings=settings) for one in found]
    if len(parts) == 1:
        return made
    kept = [one for one in made if one.events or one.record.eye_contact is not None] or made
    lost = [f"{part.seconds:.0f} s under no condition" for part in parts if not part.name]
    lost += [f"{one.record.duration:.0f} s of {one.condition} with nobody there" for one in made if one not in kept]
    if lost:
        kept[0] = structs.replace(kept[0], doubts=(*kept[0].doubts, f"left out: {', '.join(lost)}"))
    return kept


def _told(recording: Recording, times: RecordingTimes) -> Iterator[Told]:
    """The messages that count, as people are to hear them: what a killed program told is over with it."""
    heard = Heard(recording.robot, recording.clock, times.at, times.told)
    for received, _ in messages(recording):
        if keys.is_presence(received.key) or keys.first(COUNTED, received.key) is not None:
            came = max(0.0, received.at - recording.began)
            yield from (Told(*one) for one in heard.advance(came))
            taken = heard.take(structs.replace(received, at=came), came)
            yield from (Told(message, at, received.past) for message, at in taken)
    yield from (Told(*one) for one in heard.advance(recording.duration))


def _session(recording: Recording, told: Sequence[Told], times: RecordingTimes, part: Stretch) -> Session:
    """Take the numbers of a part: of all connection events that began in it, as recognition decided them."""
    tally, record = EventTally(WINDOW), Record(recording.robot)
    published: WindowStatistics | None = None
    until = part.end if part.end < recording.duration else inf
    within: dict[str, bool] = {}
    for message, at, past in told:
        if isinstance(message, Statistics):
            published = message.session if message.actor == "" else published
            continue
        if isinstance(message, ConnectionEvent):
            if not within.setdefault(message.id, not past and _began(message, times, recording, part.begin, until)):
                continue
            tally.feed(message)
        elif at >= until or (at < part.begin and not _lasts(message)):
            continue
        record(_in_time(message, times, at, part.begin), min(max(0.0, at - part.begin), part.seconds))
    end = Stamp("recording", part.seconds)
    record(Statistics(actor="", at=end, session=tally.session(), recent=WindowStatistics()), part.seconds)
    is_all = part.begin == 0.0 and until == inf
    return Session(
        path=Path(recording.name), condition=part.name, participant=recording.facts.get("participant", ""),
        record=record.session(session=0, condition=part.name, seed=0),
        events=record.events(session=0, condition=part.name), published=published if is_all else None,
    )  # fmt: skip


def _began(
    event: ConnectionEvent, times: RecordingTimes, recording: Recording, begin: Seconds, until: Seconds
) -> bool:
    """Tell whether an event began between these times."""
    began = times.at(event.started, recording.duration)
    return began is not None and begin <= began < until


def _lasts(message: Message) -> bool:
    """True if a message tells what may still be so when a later part begins: who is there, and looks where."""
    is_look = isinstance(message, ActionBegan | ActionEnded) and message.action == "look"
    return is_look or isinstance(message, ActorFound | ActorLost)


def _in_time(message: Message, times: RecordingTimes, at: Seconds, begin: Seconds) -> Message:
    """The message with its instants in seconds since `begin`. at: when it came, in the recording."""

    def instant(stamp: Stamp) -> Stamp:
        found = times.at(stamp, at)
        return Stamp("recording", (at if found is None else found) - begin)

    told: Message = moved(message, instant)
    return told


def _doubts(recording: Recording, told: Sequence[Told], times: RecordingTimes) -> Iterable[str]:
    """List what is doubtful in all numbers of a recording."""
    lives, known = set[str](), dict[str, bool]()
    for event, _, past in told:
        if isinstance(event, ConnectionEvent):
            is_here = known.setdefault(event.id, not past and _began(event, times, recording, 0.0, inf))
            lives |= {event.session} if is_here else set()
    before = sum(not counts for counts in known.values())
    if not recording.has_all_data:
        yield f"its end is missing or damaged: the numbers are of the first {recording.duration:.0f} s"
    if recording.repaired:
        yield f"it is a copy of a recording that lacked something: {recording.repaired}"
    if recording.losses.total:
        yield f"{recording.losses.total} messages are missing"
    if recording.losses.still:
        yield f"the recorder stood still for {recording.losses.still:.1f} s: motion of that time is missing"
    if recording.damaged:
        places = "one place" if len(recording.damaged) == 1 else f"{len(recording.damaged)} places"
        yield f"damaged in {places}, and what was there is left out"
    if before:
        yield f"{before} events that began before the recording are not counted"
    if len(lives) > 1:
        often = "once" if len(lives) == 2 else f"{len(lives) - 1} times"
        yield f"recognition was restarted {often}: what was open then is lost"
    if not lives:
        yield "there is no connection event in it"


# -- the command -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Options:
    recordings: Annotated[
        list[Path], typer.Argument(metavar="FILE...|DIR", help="Recordings, or a folder of them.", show_default=False)
    ]
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where tables and plots go; else they are only printed.")
    ] = None
    baseline: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Condition that others are compared with.", show_default=BASELINE),
    ] = None
    again: Annotated[
        bool,
        typer.Option(
            "--again", help="Play it to the services once more, and compare. Exit 1 if they do something else."
        ),
    ] = False
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="With --again: SERVICE.KEY=VALUE, in place of what it had."),
    ] = None
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results that are there.")] = False
    quiet: Quiet = False


def main(options: Options) -> int:
    paths = found(options.recordings)
    console = Terminal(quiet=options.quiet)
    if options.again:
        return play_again(paths, options.settings or (), console)
    if options.settings:
        raise InputRefused(Fault(reason="is for --again: all else is as it was recorded", where="--set"))
    report = StudyReport(console, options.out, ("recordings.csv", "settings.csv"), overwrite=options.overwrite)
    played, is_within = numbered([one for path in paths for one in sessions(opened(path))])
    compared, tables = compare(played, options.baseline, is_within=is_within)
    records, events = [one.record for one in played], [event for one in played for event in one.events]
    more = {"recordings.csv": listed(played), "settings.csv": settings(played)}
    report.end(records, events, compared, [*tables, configured(played)], more)
    return DONE


def found(given: Sequence[Path]) -> list[Path]:
    """Files of recordings: those that are given, and those in folders. Raises InputRefused: there are none."""
    paths = [path for one in given for path in (sorted(one.glob("*.mcap")) if one.is_dir() else [one])]
    if not paths:
        raise InputRefused(Fault(reason="no recordings (*.mcap) in it", where=", ".join(map(str, given))))
    return list(dict.fromkeys(paths))


def numbered(sessions: Sequence[Session]) -> tuple[list[Session], bool]:
    """Number the sessions. Returns them, and whether sessions of one number are of one participant.

    They are if all participants are named, none has two sessions in one condition, and any has some in several.
    """
    seen = Counter((one.participant, one.condition) for one in sessions)
    conditions = {one.participant: set[str]() for one in sessions}
    for one in sessions:
        conditions[one.participant].add(one.condition)
    is_within = (
        all(one.participant for one in sessions)
        and max(seen.values()) == 1
        and any(len(names) > 1 for names in conditions.values())
    )
    if is_within:
        numbers = {name: number for number, name in enumerate(conditions)}
        return [_with_number(one, numbers[one.participant]) for one in sessions], True
    return [_with_number(one, number) for number, one in enumerate(sessions)], False


def _with_number(one: Session, number: int) -> Session:
    from msgspec.structs import replace

    events = tuple(replace(event, session=number) for event in one.events)
    return replace(one, record=replace(one.record, session=number), events=events)


def compare(
    sessions: Sequence[Session], baseline: str | None, *, is_within: bool
) -> tuple[list[HypothesisResult], list[NumberTable]]:
    """Make the findings and all tables. Raises InputRefused: there is no such baseline."""
    records = [one.record for one in sessions]
    conditions = list(dict.fromkeys(record.condition for record in records))
    if baseline is not None and baseline not in conditions:
        advice = f"there are: {', '.join(conditions)}"
        raise InputRefused(
            Fault(reason=f"no recording has the condition {baseline!r}", where="--baseline", advice=advice)
        )
    tables = [summary.overview(records)]
    against = baseline or BASELINE
    found: list[HypothesisResult] = []
    if len(conditions) > 1 and against in conditions:
        others = [name for name in conditions if name != against]
        found = findings(records, baseline=against, others=others, is_paired=is_within)
        tables.append(summary.hypotheses(found, WITHIN if is_within else BETWEEN))
    tables.append(overview(sessions, against))
    return found, tables


def overview(sessions: Sequence[Session], baseline: str) -> NumberTable:
    """Table with a row for each session, and what to doubt."""
    rows = tuple(
        (
            one.path.name, one.condition, one.participant or summary.MISSING, f"{one.record.duration:.0f}",
            str(one.record.statistics.events), summary.number(one.record.statistics.mtbce),
        )
        for one in sessions
    )  # fmt: skip
    conditions = {one.condition for one in sessions}
    notes = list(dict.fromkeys(f"{one.path.name}: {doubt}." for one in sessions for doubt in one.doubts))
    if len(conditions) > 1 and baseline not in conditions:
        notes.append(f"No recording has the condition {baseline!r}, so nothing is compared: name one by --baseline.")
    if UNNAMED in conditions:
        notes.append("Some name no condition (by `engage record --condition` or the window): they count together.")
    columns = ("", "condition", "participant", "seconds", "events", "MTBCE (s)")
    return NumberTable(title="Recordings", columns=columns, rows=rows, notes=tuple(notes))


def configured(sessions: Sequence[Session]) -> NumberTable:
    """Table with the settings of the services that are not as by default, and those of later lives that changed."""
    by_default = dict(flat(shown(widest()())))
    found: list[tuple[str, ...]] = []
    notes = []
    for one in {one.path: one for one in sessions}.values():
        before: dict[str, Mapping[str, str]] = {}
        for life in one.settings:
            told = life.told
            if life.unread:
                notes.append(f"{one.path.name}: {told.participant}, life {life.number}: not read: {life.unread}.")
                continue
            others = before.get(told.participant, by_default)
            since = "" if life.number == 1 else f"life {life.number}, from {life.since:.1f} s"
            found += [(one.path.name, told.participant, since, line) for line in changed(life, others)]
            before[told.participant] = life.values
        if not one.settings:
            notes.append(f"{one.path.name}: it has no settings of its services; nobody knows what they were.")
    if any(one.settings for one in sessions):
        notes.append("All others are as by default in this Engage; `engage export --settings` has them all.")
    return NumberTable(
        title="Settings", columns=("", "service", "life", "setting"), rows=tuple(found), notes=tuple(notes)
    )  # fmt: skip


def settings(sessions: Sequence[Session]) -> str:
    """CSV of all settings of all services of all recordings."""
    found = ((one.record.session, one.condition, *row) for one in sessions for row in rows(one.settings))
    return summary.csv_table(("session", "condition", *COLUMNS), found)


def listed(sessions: Sequence[Session]) -> str:
    """CSV of the recordings: what `session` in the other files stands for."""
    found = (
        (one.record.session, one.condition, one.path.name, one.participant, "; ".join(one.doubts)) for one in sessions
    )
    return summary.csv_table(("session", "condition", "file", "participant", "doubts"), found)
