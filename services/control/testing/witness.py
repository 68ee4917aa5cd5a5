"""Watching whether sync points are true: an oracle that takes from a body only where its eyes, arms and joints are.

From that, and from what the suite itself has asked for, it says whether what a body reports can be so.
"""

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from random import Random

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Gaze,
    GazeShift,
    Gesture,
    Hand,
    Head,
    HeadDirectionShift,
    Pointing,
    Pose,
    PostureShift,
)
from engage_hri.schemas.body import Ray
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import BehaviorRefused, Body, BodyFailed, BodyState, Progress, Reached
from engage_hri.services.control.testing.findings import findings_of
from engage_hri.services.control.testing.laws import Finding, angle, angles, aside, beside, degrees, ms, named
from engage_hri.services.control.testing.points import PROMPT
from engage_hri.services.control.testing.stage import PATIENCE, Stage, standing
from engage_hri.services.control.testing.suite import Suite

SHIFTS = GazeShift | HeadDirectionShift
AWAY: Meters = 0.02
"""Distance of a hand at least from where it rests, at the stroke of a gesture."""
NODDED: Radians = math.radians(1.0)
WIDEST: Meters = 0.1
"""Most that a pointing may be beside its target, whatever radius a body states."""
LEVER: Meters = 0.7
"""Distance at which an error of the joints of an arm counts at the hand."""
Untrue = tuple[str, str]
"""Expected, and measured."""
Maker = Callable[[str, Random, Sequence[str]], BlockBehavior]
LOOKS: tuple[Maker, ...] = (
    lambda id, chance, targets: Gaze(id=id, target=chance.choice(targets)),
    lambda id, chance, targets: Gaze(id=id, target=chance.choice(targets)),
    lambda id, chance, targets: GazeShift(id=id, target=chance.choice(targets)),
    lambda id, chance, targets: HeadDirectionShift(id=id, target=chance.choice(targets)),
)
NODS: tuple[Maker, ...] = (
    lambda id, chance, _: Head(id=id, lexeme="NOD", repetition=chance.randrange(1, 4)),
    lambda id, chance, _: Head(id=id, lexeme="SHAKE"),
)
ARMS: tuple[Maker, ...] = (
    lambda id, chance, targets: Pointing(id=id, target=chance.choice(targets[1:] or targets), mode=one_hand(chance)),
    lambda id, chance, targets: Pointing(id=id, target=chance.choice(targets[1:] or targets), mode=one_hand(chance)),
    lambda id, chance, _: Gesture(id=id, lexeme="BEAT", mode=one_hand(chance)),
    lambda id, chance, _: Gesture(id=id, lexeme="WAVE", mode="BOTH_HANDS"),
)
CROWDS: Mapping[str, tuple[Maker, ...]] = {"looks": LOOKS, "nods": NODS, "arms": ARMS, "all but nods": LOOKS + ARMS}


def one_hand(chance: Random) -> Hand:
    """Choose a hand."""
    hands: tuple[Hand, Hand] = ("LEFT_HAND", "RIGHT_HAND")
    return chance.choice(hands)


class Witness:
    """Memory of what was asked for. rest: the body at home, before anything.

    base: where the head belongs: an entity; empty: where it was; None: unknown, since a shift was broken off.
    lies: reports that cannot be true.
    """

    def __init__(self, suite: Suite, body: Body) -> None:
        self.suite, self.body = suite, body
        self.rest = suite.observed(body)
        self.stages: list[WatchedStage] = []
        self.base: str | None = ""
        self.lies: list[Finding] = []

    def begin(self, behavior: BlockBehavior, through: str) -> "WatchedStage":
        """Begin a behavior whose reports are judged as they come."""
        stage = WatchedStage(self, self.body, behavior, through)
        self.stages.append(stage)
        return stage

    def hear(self, stage: "WatchedStage", reached: Reached) -> None:
        """Take a report, as it comes."""
        behavior, sync = stage.behavior, reached.sync
        late = asyncio.get_running_loop().time() - reached.at
        if not 0.0 <= late + 1e-6 <= PROMPT + self.suite.tolerance + 1e-6:
            self._note(behavior, sync, "a report as it is passed", f"it is told {ms(late)} after its `at`")
        if isinstance(behavior, SHIFTS):
            self.base = behavior.target if sync == "end" else None if sync == "start" else self.base
        elif isinstance(behavior, PostureShift | Pose):
            self.base = None  # the trunk takes the head with it
        if untrue := self._untrue(behavior, sync, self.suite.observed(self.body)):
            self._note(behavior, sync, *untrue)

    def _note(self, behavior: BlockBehavior, sync: str, expected: str, measured: str) -> None:
        self.lies.append(Finding(behavior=named(behavior), sync=sync, expected=expected, measured=measured))

    # -- what must be so -----------------------------------------------------------------------------------------

    def _untrue(self, behavior: BlockBehavior, sync: str, state: BodyState) -> Untrue | None:
        """Expected and measured, if a report cannot be true."""
        match behavior, sync:
            case Gaze(target=target), "stroke" | "stroke_end" | "relax":
                return self._looks_at(state.gaze, target)
            case Gaze(), "end":
                return self._is_at_base(state.gaze)
            case ((GazeShift(target=target) | HeadDirectionShift(target=target)), "end") if not self._has_look():
                return self._looks_at(state.gaze, target)
            case Head(), "stroke":
                return self._has_nodded(state)
            case Head(), "end":
                return self._is_as_at_rest(state.gaze)
            case Pointing(target=target, mode=mode), "stroke" | "stroke_end":
                return self._points_at(arms(state, mode), target)
            case Gesture(mode=mode), "stroke":
                return self._hands(state, mode, is_away=True)
            case ((Gesture(mode=mode) | Pointing(mode=mode)), "end"):
                return self._hands(state, mode, is_away=False)
        return None

    @property
    def _near(self) -> Radians:
        return self.suite.accuracy + self.suite.gaze_slack

    def _looks_at(self, gaze: Ray | None, target: str) -> Untrue | None:
        off = aside(gaze, self.suite.position(target)) if gaze else 0.0
        if off <= self._near:
            return None
        return f"eyes on {target}, within {degrees(self._near)}", f"{degrees(off)} beside it"

    def _is_at_base(self, gaze: Ray | None) -> Untrue | None:
        if self.base is None:
            return None
        return self._looks_at(gaze, self.base) if self.base else self._is_as_at_rest(gaze)

    def _is_as_at_rest(self, gaze: Ray | None) -> Untrue | None:
        off = angle(gaze.axis, self.rest.gaze.axis) if gaze and self.rest.gaze else 0.0
        if off <= self._near:
            return None
        return f"the head where it was, within {degrees(self._near)}", f"{degrees(off)} away"

    def _has_nodded(self, state: BodyState) -> Untrue | None:
        if state.gaze and self.rest.gaze:
            moved = angle(state.gaze.axis, self.rest.gaze.axis)
        else:
            before, now = angles(self.rest.pose), angles(state.pose)
            moved = max((abs(now[joint] - before[joint]) for joint in before if joint in now), default=math.inf)
        return (f"a head that has moved by {degrees(NODDED)} at least", degrees(moved)) if moved < NODDED else None

    def _points_at(self, rays: Sequence[Ray | None], target: str) -> Untrue | None:
        off = [beside(ray, self.suite.position(target)) for ray in rays if ray is not None]
        near = min(self.body.capabilities.pointing_radius, WIDEST) + LEVER * self.suite.gaze_slack
        if not off or min(off) <= near:
            return None
        way = f"{min(off) * 100:.1f} cm beside it" if min(off) < math.inf else "away from it"
        return f"a forearm that points at {target}, within {near * 100:.1f} cm", way

    def _hands(self, state: BodyState, mode: str | None, *, is_away: bool) -> Untrue | None:
        pairs = zip(arms(state, mode), arms(self.rest, mode), strict=True)
        moved = [math.dist(one.tip, other.tip) for one, other in pairs if one and other and one.tip and other.tip]
        if not moved:
            return None
        near, away = AWAY / 2 + LEVER * self.suite.gaze_slack, max(moved)
        if is_away and (short := min(moved) if mode else away) <= AWAY:
            return f"a hand {AWAY * 100:.0f} cm from rest at least", f"{short * 100:.1f} cm"
        if not is_away and away >= near:
            return f"a hand at rest, within {near * 100:.1f} cm", f"{away * 100:.1f} cm away"
        return None

    def _has_look(self) -> bool:
        return any(isinstance(each.behavior, Gaze) and not each.task.done() for each in self.stages)

    # -- the end -------------------------------------------------------------------------------------------------

    async def close(self, *, may_fail: bool = False, patience: Seconds = PATIENCE) -> list[Finding]:
        """Let everything come to its end, and return what cannot be true.

        may_fail: a behavior may fail by a name, or never come to a point; then it is aborted, and has to end.
        patience: seconds after which they are.
        """
        for stage in self.stages:
            stage.authority.go_on()
            stage.authority.extend("end")
        loop = asyncio.get_running_loop()
        deadline = loop.time() + patience
        for stage in self.stages:
            try:
                if may_fail:
                    await stage.until(lambda: False, max(0.0, deadline - loop.time()))
                    if not stage.task.done():
                        stage.authority.revoke("relax")
                await stage.over()
            except BehaviorRefused as refused:
                stage.is_refused = True
                if stage.progress or not refused.fault.reason:
                    self._note(
                        stage.behavior,
                        stage.next_point,
                        "a refusal with a reason, before its first point",
                        f"refused: {refused.fault}; passed {len(stage.passed)} points",
                    )
            except BodyFailed as failed:
                stage.has_failed = True
                if not may_fail or not failed.fault.reason:
                    self._note(
                        stage.behavior,
                        stage.next_point,
                        "a fault with a reason" if may_fail else "that it can do this",
                        f"failed: {failed.fault}",
                    )
            except Exception as error:
                stage.has_failed = True
                self.lies += findings_of(error, named(stage.behavior)) or ()
        for stage in self.stages:
            self._check_end(stage)
        if not may_fail:
            if not await standing(self.body):
                self.lies.append(Finding(expected="a body that comes to stand", measured="`moving` stays true"))
            elif untrue := self._is_at_base(self.suite.observed(self.body).gaze):
                self.lies.append(Finding(expected=f"in the end {untrue[0]}", measured=untrue[1]))
        return self.lies

    def _check_end(self, stage: "WatchedStage") -> None:
        told = tuple(sync for sync in stage.passed if not sync.startswith("stroke:"))
        points, how = sync_points(stage.behavior), stage.authority.revoked
        if told != points[: len(told)]:
            self._note(stage.behavior, "", f"points in order: {', '.join(points)}", ", ".join(told))
        elif told != points and how is None and not (stage.is_refused or stage.has_failed):
            self._note(stage.behavior, stage.next_point, "all points, since nobody has revoked it", ", ".join(told))
        elif told == points and (stage.is_refused or stage.has_failed):
            self._note(stage.behavior, "end", "no `end` of what has failed", ", ".join(told))


class WatchedStage(Stage):
    """A stage whose reports a witness hears as they come."""

    def __init__(self, witness: Witness, body: Body, behavior: BlockBehavior, through: str) -> None:
        self.is_refused = self.has_failed = False
        self._witness = witness
        super().__init__(body, behavior, through)

    def hear(self, progress: Progress) -> None:
        """Pass it on."""
        if isinstance(progress, Reached):
            self._witness.hear(self, progress)


def arms(state: BodyState, mode: str | None) -> tuple[Ray | None, ...]:
    """The forearms that a mode names; without a mode all."""
    both = {"LEFT_HAND": (state.left_arm,), "RIGHT_HAND": (state.right_arm,)}
    return both.get(mode or "", (state.left_arm, state.right_arm))


async def crowded(
    suite: Suite, body: Body, makers: Sequence[Maker], chance: Random, acts: int = 25
) -> Witness | None:
    """Begin, extend, hold, release and abort at random; None if the body has none of these behaviors."""
    targets = [entity.id for entity in suite.world.entities]
    able = [make for make in makers if type_name(make("any", chance, targets)) in suite.types(body)]
    if not able:
        return None
    witness = Witness(suite, body)
    for number in range(acts):
        await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.5), chance.uniform(0.0, 2.0))))
        live = [each for each in witness.stages if not each.task.done()]
        act = chance.choice(("begin", "begin", "extend", "hold", "go on", "abort")) if live else "begin"
        if act == "begin":
            behavior = chance.choice(able)(f"{number}", chance, targets)
            witness.begin(behavior, chance.choice(("start", "end", *sync_points(behavior))))
            continue
        one = chance.choice(live)
        match act:
            case "extend":
                one.authority.extend(chance.choice(one.authority.points))
            case "hold":
                one.authority.hold()
            case "go on":
                one.authority.go_on()
            case "abort":
                if isinstance(one.behavior, SHIFTS):
                    witness.base = None
                one.authority.revoke(chance.choice(("relax", "freeze")))
    return witness


async def witnessed(body: Body, world: World, makers: Sequence[Maker], chance: Random) -> Witness | None:
    """Let a crowd of behaviors come to its end, and return who has watched; None: the body has none of them."""
    suite = Suite()
    suite.world = world
    witness = await crowded(suite, body, makers, chance)
    if witness is not None:
        await witness.close()
    return witness
