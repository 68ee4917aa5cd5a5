"""Blocks planned as the fake body estimates them, and what of a plan the tests ask for."""

from itertools import pairwise

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Pointing, Speech, Timing, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from tests.realizer.fake_body import FakeBody, Script

GAZE = Gaze(id="g", target="can")
LEFT = Pointing(id="p", target="can", mode="LEFT_HAND")
LEFT_TOO = Pointing(id="q", target="cup", mode="LEFT_HAND")
SPEECH = Speech(id="s", text="This can?")
OTHER = Speech(id="t", text="Or that?")


def plan(example: Block, *estimates: Estimate, **scripts: Script) -> Plan:
    body = FakeBody(scripts)
    known = {each.behavior: each for each in estimates}
    moved = [each for each in example.behaviors if not isinstance(each, Wait)]
    return plan_block(example, [known.get(each.id) or body.estimate(each) for each in moved])


def at(made: Plan, point: str) -> float:
    behavior, sync = point.split(":")
    return made.predicted(Point(behavior, sync))


def timed(behavior: BlockBehavior, **refs: str) -> BlockBehavior:
    return replace(behavior, timing=tuple(Timing(sync, ref) for sync, ref in refs.items()))


def elastic(id: str, points: tuple[str, ...], shortest: float, natural: float, longest: float | None) -> Estimate:
    """Every phase alike."""
    phases = tuple(
        Phase(since=since, to=to, shortest=shortest, natural=natural, longest=longest)
        for since, to in pairwise(points)
    )
    return Estimate(behavior=id, feasible=True, parts=(f"part of {id}",), phases=phases)


def warnings(made: Plan) -> list[tuple[str, str]]:
    return [(each.kind, each.behavior) for each in made.problems]
