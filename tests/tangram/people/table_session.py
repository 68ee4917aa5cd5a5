"""The one session of two people that has the numbers of Table 2.1 to the last digit. Nothing of it is drawn."""

from collections.abc import Mapping

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.units import Seconds
from tests.tangram.people.human_session import BETWEEN, EXPLAINER, LISTENER, OBJECTS, TURN, Planned
from tests.tangram.people.table_2_1 import EVENTS, LONGEST_GAP, MTBCE, TABLE

DELAYS: Mapping[tuple[EventKind, bool], tuple[Seconds, ...]] = {
    ("directed_gaze", True): (*[0.0] * 4, *[0.1] * 6, 0.65, 0.65, 2.0),
    ("directed_gaze", False): (1.5,),
    ("mutual_facial_gaze", True): (0.0, *[0.7] * 8, 0.6, 1.5),
    ("mutual_facial_gaze", False): (0.3, *[0.5] * 10, 0.7, 1.8),
    ("adjacency_pair", True): (0.0, *[0.4] * 27, 0.1, 1.1),
    ("adjacency_pair", False): (0.1, *[0.7] * 11, 1.6, 7.4),
}
"""Single delays, by kind and success, that have the table's counts, extremes and means. They are ours."""


def exactly() -> tuple[Planned, ...]:
    """The session whose statistics are those of Table 2.1 to the last digit. Nothing is drawn.

    Its events come evenly, but for one: a request that somebody busy with another does not answer for 7.4 s, and
    nothing else for 70.
    """
    events = [(kind, ok, delay) for (kind, ok), delays in DELAYS.items() for delay in delays]
    task, unanswered = events.index(("adjacency_pair", True, 0.4)), events.index(("adjacency_pair", False, 7.4))
    two = [events[task], events[unanswered]]
    rest: list[tuple[EventKind, bool, Seconds | None]] = [
        event for index, event in enumerate(events) if index not in (task, unanswered)
    ]
    rest += [("backchannel", True, None)] * TABLE["backchannel"].count
    # Kinds are mixed by a stride that is prime to their number.
    mixed = [rest[index * 31 % len(rest)] for index in range(len(rest))]
    middle = len(mixed) // 2
    between = ((EVENTS - 1) * MTBCE - LONGEST_GAP) / (EVENTS - 2)
    plan, start = [], 1.0
    for number, (kind, ok, delay) in enumerate([*mixed[:middle], *two, *mixed[middle:]]):
        answers_request = (ok and kind != "backchannel") or kind == "mutual_facial_gaze"
        plan.append(
            Planned(
                kind=kind,
                initiator=LISTENER if answers_request and number % 2 and number != middle else EXPLAINER,
                start=start,
                succeeds=ok,
                delay=delay,
                turn=(TURN[0] if ok or delay is None else min(TURN[0], delay / 2))
                if kind == "adjacency_pair"
                else 0.0,
                object=OBJECTS[number % len(OBJECTS)] if kind == "directed_gaze" else "",
                task_until=start + between + LONGEST_GAP - BETWEEN if number == middle else None,
            )
        )
        start += LONGEST_GAP if number == middle + 1 else between
    return tuple(plan)
