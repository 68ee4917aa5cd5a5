"""Laws of truth: no sync point that the joints do not bear out, alone, in a crowd, and with a fault."""

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES, sync_points
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
from engage_hri.schemas.body import Capabilities, Ray
from engage_hri.schemas.body_faults import BodyFault, kind_of, parts_of, words
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.services.control.contract.body import BehaviorRefused, Body, BodyFailed, BodyState, Progress, Reached
from engage_hri.services.control.testing.findings import (
    Finding,
    LawBroken,
    angle,
    angles,
    aside,
    beside,
    broken,
    degrees,
    findings_of,
    ms,
    named,
    turned,
)
from engage_hri.services.control.testing.motions import Recording, recorded
from engage_hri.services.control.testing.plugin import virtual_loop
from engage_hri.services.control.testing.points import PROMPT
from engage_hri.services.control.testing.stage import (
    LOOK_EVERY,
    PATIENCE,
    Stage,
    default,
    done,
    standing,
    target_point,
    times,
    until_target,
)
from engage_hri.services.control.testing.suite import (
    STILL,
    Suite,
    by_each,
    does_not_apply,
    has_joints,
    trials,
)

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

    def _looks_at(self, gaze: Ray | None, target: str) -> Untrue | None:
        off = aside(gaze, self.suite.position(target)) if gaze else 0.0
        if off <= self.suite.near:
            return None
        return f"eyes on {target}, within {degrees(self.suite.near)}", f"{degrees(off)} beside it"

    def _is_at_base(self, gaze: Ray | None) -> Untrue | None:
        if self.base is None:
            return None
        return self._looks_at(gaze, self.base) if self.base else self._is_as_at_rest(gaze)

    def _is_as_at_rest(self, gaze: Ray | None) -> Untrue | None:
        off = angle(gaze.axis, self.rest.gaze.axis) if gaze and self.rest.gaze else 0.0
        if off <= self.suite.near:
            return None
        return f"the head where it was, within {degrees(self.suite.near)}", f"{degrees(off)} away"

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
        told = default(stage.passed)
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


# -- faults that a body can play ------------------------------------------------------------------------------------

Make = Callable[[], Body]
BY_ENCODERS = ("noisy",)
"""Kinds that make measurements worse and nothing else: for these a suite states `noise`."""
AMOUNT = 10.0
"""Of a kind that needs an amount and has no usual one: degrees, as far as its range goes."""


def playable(able: Capabilities) -> tuple[BodyFault, ...]:
    """List a fault of each kind that a body can play, in every part that can have it, or in its first joint."""
    found = []
    for kind in able.faults:
        row, part, amount = kind_of(kind, able), "", None
        if kind in BY_ENCODERS:
            continue
        if row is not None and row.on == "joint":
            if not (known := parts_of(row, able)):
                continue
            part = known[0]
        if row is not None and row.needs_amount:
            amount = row.usual if row.usual is not None else min(max(AMOUNT, row.low), row.high)
        found.append(BodyFault(kind=kind, part=part, amount=amount))
    return tuple(found)


def played(make: Make, faults: Iterable[BodyFault] | None = None) -> Mapping[str, Make]:
    """Name faults in words, and say how to make the body that has each from its start.

    make: makes the body without faults. faults: None: one of each kind that it says it can play; to know these, a
    body is made, in a loop of its own.
    """
    return {words(fault): Played(make, fault) for fault in (faults if faults is not None else _all(make))}


class Played:
    """Maker of a body that has a fault from its start to its end: one of it is as good as the next."""

    def __init__(self, make: Make, fault: BodyFault) -> None:
        self._make, self._fault = make, fault

    def __call__(self) -> Body:
        body = self._make()
        body.switch_faults((self._fault,))
        return body


def _all(make: Make) -> tuple[BodyFault, ...]:
    try:
        asyncio.get_running_loop()
    except RuntimeError:  # pytest asks for the names before it runs a test
        with asyncio.Runner(loop_factory=virtual_loop) as runner:
            return playable(runner.run(_able(make)))
    return playable(make().capabilities)


async def _able(make: Make) -> Capabilities:
    return make().capabilities


# -- the laws -------------------------------------------------------------------------------------------------------

TRIMMED = 6
"""Samples at both ends of a stand that are not judged: a measurement of motion comes late."""
SETTLED: Seconds = 1.0
"""Time within which a body that is at home stands."""
PATIENCE_WITH_FAULTS: Seconds = 15.0
"""Time after which a behavior that a fault keeps from its next point is aborted. Those who tell points by the clock
have told them by then."""
CROWDS_WITH_FAULTS = ("all but nods", "nods")
"""They have all behaviors of the others, too."""
ACTS_WITH_FAULTS = 8


class TruthLaws(Suite):
    """Part of `BodyContract`."""

    topic = "truth"

    async def test_measures_all_its_joints_within_their_noise(self, body: Body) -> None:
        """`state()` has each joint of the capabilities, and at rest it scatters no more than the stated `noise`.

        Usually the encoders are noisier than it was said: state what is measured here, or filter them. All other laws
        allow for the noise that is stated.
        """
        named_joints = {limit.joint for limit in body.capabilities.joints}
        if not named_joints:
            does_not_apply("its capabilities name no joints")
        if missing := sorted(named_joints - set(angles(body.state().pose))):
            broken(expected="an angle of each joint in `state().pose`", measured=f"none of {', '.join(missing)}")
        async with recorded(body, self.joints(body)) as recording:
            await asyncio.sleep(1.0)
        if not recording.joints:
            does_not_apply("its behaviors move no joints")
        scatter = recording.scatter
        worst, most = int(scatter.argmax()), 1.5 * self.noise + STILL / 5
        if scatter[worst] > most:
            broken(
                expected=f"readings at rest that scatter by {degrees(most)} at most (standard deviation)",
                measured=f"{recording.joints[worst]} scatters by {degrees(float(scatter[worst]))}",
                advice=f"state it: `noise = math.radians({float(scatter[worst]) * 57.2958:.2f})`, or --noise",
            )

    @by_each(has_joints, "no joints")
    async def test_says_that_it_moves_as_long_as_it_moves(self, body: Body, behavior: BlockBehavior) -> None:
        """While `moving` is false the joints stand still, within the noise of their encoders.

        Usually `moving` is false once the planned time is over: it is for the measured joints to say.
        """
        recording, stands = Recording(self.joints(body, behavior)), []
        stage = Stage(body, behavior, "end")
        while not stage.task.done() or body.state().moving:
            stands.append(not body.state().moving)
            recording.take(body)
            await asyncio.sleep(LOOK_EVERY)
        await stage.over()
        for first, last in _runs(stands):
            self.check_still(recording.angles[first + TRIMMED : max(first, last - TRIMMED)], recording.joints)

    @by_each()
    async def test_each_point_is_where_the_joints_are(self, body: Body, behavior: BlockBehavior) -> None:
        """Alone, and waiting at each hold point: as each point is told, eyes, forearms and joints are where it says.

        Usually a point is told when the planned time is over, or when the vendor's "finished" comes: tell it when the
        measured angles are there. A movement that takes time has moved a joint by its stroke.
        """
        takes = until_target(body.estimate(behavior, None, self.world), behavior)
        joints, sync = self.joints(body, behavior), target_point(behavior)
        before = angles(self.observed(body).pose)
        witness = Witness(self, body)
        stage = witness.begin(behavior, "start")
        for number, hold in enumerate(self.holds(body, behavior), 1):
            await stage.holding(number)
            stage.authority.extend(hold)
        if lies := await witness.close():
            raise LawBroken(lies)
        if not joints or not has_joints(behavior) or takes < 0.05:
            return
        await body.home()
        async with recorded(body, joints) as recording:
            at = times(await done(body, behavior))[sync]
        if (moved := turned(recording.at(at), before)) < 5 * STILL:
            broken(sync, expected=f"a joint that has moved by {degrees(5 * STILL)} at least", measured=degrees(moved))

    @trials(6)
    @pytest.mark.parametrize("crowd", CROWDS)
    async def test_no_sync_point_that_the_joints_do_not_bear_out(self, body: Body, crowd: str, seed: int) -> None:
        """Begun, extended, held, released and aborted at random, no behavior tells a point that is not so.

        Usually what was taken over or cut goes on to tell its points. As each is told, the eyes are on the target,
        the forearm points at it, the head has nodded; in the end all is back where it belongs.
        """
        witness = await crowded(self, body, CROWDS[crowd], Random(f"{crowd} {seed}"))
        if witness is None:
            kinds = (type_name(make("any", Random(0), ["any"])) for make in CROWDS[crowd])
            self.lacks(body, f"it has nothing for the crowd of {crowd}", *kinds)
        if lies := await witness.close():
            raise LawBroken(lies)

    async def test_with_a_fault_it_passes_or_names_the_fault(self, fault: str | None) -> None:
        """With a fault a behavior is done, fails with a reason, or stays short of a point: it tells nothing untrue.

        Usually points are told by the clock, so that nothing notices a stall; or the error of the SDK comes out:
        catch it, and raise BodyFailed with a reason and an advice.
        """
        if fault is None:
            does_not_apply("no faults are named (`faults` of the suite)")
        make, lies = self.faults()[fault], list[Finding]()
        async with self.connected(make) as body:
            able = [each for each in self.behaviors if type_name(each) in self.types(body)]
        asked = list({_kind(each): each for each in able}.values())
        while asked:
            async with self.connected(make) as body:
                lies += await self._with_fault(body, asked.pop(0))
                while asked and isinstance(make, Played) and await self._is_as_before(body):
                    lies += await self._with_fault(body, asked.pop(0))
        for name in CROWDS_WITH_FAULTS:
            async with self.connected(make) as body:
                witness = await crowded(self, body, CROWDS[name], Random(f"{fault} {name}"), ACTS_WITH_FAULTS)
                if witness is not None:
                    lies += await witness.close(may_fail=True, patience=PATIENCE_WITH_FAULTS)
        if lies:
            raise LawBroken([replace(each, behavior=f"{each.behavior or 'the body'} with {fault}") for each in lies])

    async def _is_as_before(self, body: Body) -> bool:
        """Take a body home; false if it does not get there, so that another one is needed."""
        await Stage.end_all()
        try:
            async with asyncio.timeout(PATIENCE_WITH_FAULTS):
                await body.home()
        except Exception:
            return False
        return await standing(body, SETTLED)

    async def _with_fault(self, body: Body, behavior: BlockBehavior) -> Sequence[Finding]:
        witness = Witness(self, body)
        witness.begin(behavior, "end")
        return await witness.close(may_fail=True, patience=PATIENCE_WITH_FAULTS)


def _kind(behavior: BlockBehavior) -> tuple[str, tuple[str, ...]]:
    """Family and points of a behavior: those that share both use the same parts in the same way."""
    row = TYPES[type_name(behavior)]
    return row.family or row.name, row.points


def _runs(flags: Sequence[bool]) -> Iterator[tuple[int, int]]:
    """First and last index of each run of true ones."""
    first = None
    for index, flag in enumerate((*flags, False)):
        if flag and first is None:
            first = index
        elif not flag and first is not None:
            yield first, index
            first = None
