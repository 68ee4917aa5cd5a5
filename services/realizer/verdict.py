"""Who is to blame for points that wait for each other in a circle: a behavior that is dropped, or the whole block."""

from collections.abc import Collection, Mapping

from schemas.faults import Fault
from services.realizer.assembly import Assembly
from services.realizer.chains import Chain
from services.realizer.classes import Classes
from services.realizer.net import Bound, PetriNet, Place
from services.realizer.points import Point
from services.realizer.prediction import Impossible
from services.realizer.relations import BlockRefused


class Loss(Exception):
    """A behavior that cannot be on time, and why."""

    def __init__(self, behavior: str, reason: str) -> None:
        self.behavior = behavior
        super().__init__(reason)


def judge(
    circle: Impossible,
    assembly: Assembly,
    chains: Mapping[str, Chain],
    required: Collection[str],
    classes: Classes,
    block: str,
    turns: Collection[tuple[str, Point]],
) -> Loss | BlockRefused:
    """A time that cannot be met costs a behavior, the later in the document; waiting for each other costs the block.

    Two that must have the same part at the same time: the later of them. A phase that is too long for the time it
    is given: whose phase it is; else whose phase would have to be longer than it can be.
    """
    net = assembly.net
    ties = [tie for tie, _ in circle.ties]
    route = _route(net, circle)
    rivals = _rivals(ties, assembly, turns)
    slow = {tie.behavior for tie in ties if isinstance(tie, Place) and tie.kind == "phase"}
    quick = {tie.behavior for tie in ties if isinstance(tie, Bound) and tie.kind == "phase"}
    touched = {point.behavior for tie in ties for point in net.transitions[tie.source].points}
    involved = slow | quick or touched
    is_timed = any(tie.source == 0 for tie in ties)
    if rivals or quick or is_timed or len(involved & chains.keys()) == 1:
        for group in (rivals,) if rivals else (slow, quick, touched):
            candidates = [id for id in chains if id in group]
            free = [id for id in candidates if id not in required]
            if free:
                return Loss(free[-1], f"cannot be on time: {route}")
    lines = sorted({line for tie in ties for line in tie.lines} | _lines_of_instants(ties, net, classes))
    fault = Fault(
        reason=f"these points wait for each other in a circle: {route}",
        where=block,
        line=lines[0] if lines else 0,
        advice=f"see lines {', '.join(map(str, lines))}" if len(lines) > 1 else "",
    )
    return BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")


def _rivals(ties: list[Place | Bound], assembly: Assembly, turns: Collection[tuple[str, Point]]) -> set[str]:
    """Those of whom one waits for his turn in this circle."""
    pairs = {
        (assembly.at[point], assembly.at[Point(later, "start")]): {later, point.behavior} for later, point in turns
    }
    series = [(tie.source, tie.target) for tie in ties if tie.kind == "series"]
    return next((pairs[ends] for ends in series if ends in pairs), set())


def _route(net: PetriNet, circle: Impossible) -> str:
    steps = [f"{net.transitions[tie.source].name} ({seconds:+g} s)" for tie, seconds in circle.ties]
    return " -> ".join((*steps, net.transitions[circle.ties[0][0].source].name))


def _lines_of_instants(ties: list[Place | Bound], net: PetriNet, classes: Classes) -> set[int]:
    """Where it is written that the points of these instants belong together."""
    lines: set[int] = set()
    for before, after in zip([ties[-1], *ties], ties, strict=False):
        came, goes = before.behavior, after.behavior
        here = net.transitions[after.source].points
        ends = [next((point for point in here if point.behavior == id), None) for id in (came, goes)]
        lines |= classes.lines(*(end for end in ends if end is not None))
        if after.kind == "delay":
            there = net.transitions[after.target].points
            lines |= classes.lines(here[0], there[0])
    return lines
