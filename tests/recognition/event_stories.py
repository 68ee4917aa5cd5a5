"""Stories (`tests/stories.py`) of what is observed, and of what becomes of each connection event.

    a person answers within the limit
        1 robot +speak; 1 asks ap turn=turn-1; 2 robot -speak; 2 turn ended; 2.4 human +nod; 3.4 human -nod
        robot's ap-1: started 1, succeeded 2.4 after 0.4 by nod, completed 3.4 lasting 1

The lines at the end say what becomes of every event, in the order in which they started.

| step | says |
|---|---|
| `1 human +act blue`, `2 human -act blue` | an action begins, ends; last comes its target or its behavior |
| `5 human ~act blue since=1` | an action goes on that began at 1, which becomes known only now |
| `1 asks dg blue cause=reference` | the realizer requests an event: `ap`, `dg`, `mfg` or `bc` |
| `1 cancels 2` | the second request is cancelled; `cause=gone`: because nobody is there any more who asked |
| `1 turn ended turn=turn-9` | a turn (turn-1) ended, or `aborted`, `answered`, `repaired` |
| `1 passes gaze-1:stroke`, `1 block done` | feedback of block-1: a sync point, the end |
| `1 owner fragment blue` | who has the robot's head, and where |
| `1 lost human`, `2 found human` | a face |
| `9 time` | nothing happens |
| `1 asked nod` | the robot asks at 1 for a nod, its turn ends at 2 or `until=4`; `asking`: goes on |

`told 2.3` behind a change: it became known only then. `deadline 4.5`: when time alone changes something next.
"""

from collections.abc import Iterator
from typing import Any

from engage_hri.schemas.behaviors import EVENT_KINDS
from engage_hri.schemas.recognition import ConnectionEvent
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, number

KINDS = {kind.prefix: name for name, kind in EVENT_KINDS.items()}
NAMES = {
    "blue": "blue-square", "pink": "pink-square", "words": "block-1:speech-1", "next-words": "block-2:speech-1",
}  # fmt: skip
MEASURES = {"started": "since", "completed": "lasting"}


def check(story: Story) -> None:
    """Play the story: all its events become what it says, and each request is answered as its event was decided."""
    log = Log(**{name: float(value) if value[0].isdigit() else value for name, value in story.config.items()})
    known = play(log, story.steps)
    becomes = lives(log, known)
    if any(line.startswith("deadline") for line in story.becomes):
        becomes.append(f"deadline {number(log.session.deadline)}")

    assert (becomes or ["nothing"]) == story.becomes
    assert all({event.initiator, event.responder} == {ROBOT, HUMAN} for event in log.events)
    decided = _decisions(log)
    for answer in log.outcomes:
        assert (answer.state, answer.delay, answer.response) == decided[answer.event]
    assert {event.id for event in log.events if event.block} & decided.keys() <= {each.event for each in log.outcomes}


def play(log: Log, steps: list[str]) -> list[tuple[float, float]]:
    """Of each effect: when it was told, and when something could have been told before that."""
    known: list[tuple[float, float]] = []
    before = now = 0.0

    def reach(time: float) -> None:
        nonlocal before, now
        known.extend([(now, before)] * (len(log.effects) - len(known)))
        if time > now:
            before, now = now, time

    for step in _spelled_out(steps):
        time, *words = step.split()
        if words == ["time"]:
            while (due := log.session.deadline) is not None and due < float(time):
                reach(due)
                log.until(now)
                assert log.session.deadline != due, "a deadline that stays would spin"
        reach(float(time))
        _take(log, float(time), *words)
    reach(now)
    return known


def lives(log: Log, known: list[tuple[float, float]]) -> list[str]:
    """A line for each event."""
    lines: dict[str, str] = {}
    short = {name: word for word, name in NAMES.items()}
    for effect, (now, before) in zip(log.effects, known, strict=True):
        if isinstance(effect, ConnectionEvent):
            at = " at " + " ".join(short.get(each, each) for each in effect.objects) if effect.objects else ""
            line = lines.get(effect.id, f"{effect.initiator}'s {effect.id}{at}:")
            in_time = before < effect.at.seconds <= now or effect.at.seconds == now
            lines[effect.id] = f"{line} {_change(effect)}{'' if in_time else f' told {number(now)}'},"
    return [line.rstrip(",") for line in lines.values()]


def _change(event: ConnectionEvent) -> str:
    at, measured = event.at.seconds, event.delay
    if event.state == "started":
        measured = None if at == event.started.seconds else event.started.seconds
    elif event.state == "completed":
        measured = event.duration
    text = f"{event.state} {number(at)}"
    if measured is not None:
        text += f" {MEASURES.get(event.state, 'after')} {number(measured)}"
    return text + (f" by {event.response}" if event.state == "succeeded" and event.response else "")


def _decisions(log: Log) -> dict[str, tuple[object, ...]]:
    """What came next after the start of each event, if anything did."""
    changes: dict[str, list[ConnectionEvent]] = {}
    for event in log.events:
        changes.setdefault(event.id, []).append(event)
    return {id: (life[1].state, life[1].delay, life[1].response) for id, life in changes.items() if life[1:]}


def _take(log: Log, at: float, verb: str, *words: str) -> None:
    plain = [NAMES.get(word, word) for word in words if "=" not in word]
    named: dict[str, Any] = dict(word.split("=") for word in words if "=" in word)
    match verb:
        case "human" | "robot":
            act, what = plain[0][0], plain[0][1:]
            since = float(named.get("since", at))
            is_behavior = what == "speak" or ":" in "".join(plain[1:])
            about = {"behavior" if is_behavior else "target": plain[1] if plain[1:] else ""}
            if act not in "+-~":
                raise ValueError(f"{verb} {plain[0]}: an action begins with + or ~, or ends with -")
            if act == "~":
                log.goes_on(verb, what, at, since, **about)  # type: ignore[arg-type]
            else:
                (log.begins if act == "+" else log.ends)(verb, what, at, **about)  # type: ignore[arg-type]
        case "asks":
            for name in ("accept", "anchors"):
                named[name] = tuple(filter(None, named.get(name, "").split(",")))
            if "limit" in named:
                named["limit"] = float(named["limit"])
            log.requests_event(KINDS[plain[0]], at, *plain[1:], **named)  # type: ignore[arg-type]
        case "cancels":
            log.cancels(f"request-{plain[0]}", at, named.get("cause", ""))
        case "turn":
            log.signals(plain[0], at, **named)
        case "passes":
            log.passes(plain[0], at)
        case "block":
            log.block_ends(at, *plain)
        case "owner":
            log.owner(plain[0], plain[1].replace("person", HUMAN), at)  # type: ignore[arg-type]
        case "lost" | "found":
            (log.lost if verb == "lost" else log.found)(plain[0], at)
        case "time":
            log.until(at)
        case _:
            raise ValueError(f"no step begins with {verb!r}")


def _spelled_out(steps: list[str]) -> Iterator[str]:
    for step in steps:
        time, verb, *accepted = step.split()
        if verb not in ("asked", "asking"):
            yield step
            continue
        end = next((word.removeprefix("until=") for word in accepted if word.startswith("until=")), "2")
        accept = ",".join(word for word in accepted if "=" not in word)
        yield from (f"{time} robot +speak words", f"{time} asks ap turn=turn-1 accept={accept}")
        if verb == "asked":
            yield from (f"{end} robot -speak words", f"{end} turn ended")
