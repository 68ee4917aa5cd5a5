"""Base of the contract suite: a world, behaviors, tolerances, and how a body is made, connected and left."""

import asyncio
import math
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from functools import wraps
from inspect import signature
from types import UnionType
from typing import Any, ClassVar, NoReturn, TypeVar

import numpy as np
import pytest
import pytest_asyncio
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES, sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Expression,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    HeadDirectionShift,
    Looks,
    Mark,
    Pointing,
    Pose,
    Posture,
    PostureShift,
    Speech,
    Wait,
)
from engage_hri.schemas.body import BodyPose
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import Body, BodyState
from engage_hri.services.control.testing.findings import (
    OTHER_WAY,
    Finding,
    LawBroken,
    angles,
    aside,
    broken,
    degrees,
    findings_of,
    listed,
    ms,
    named,
)
from engage_hri.services.control.testing.motions import Array
from engage_hri.services.control.testing.stage import PATIENCE, Connection, Stage, default, standing, still_running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

AIMED = Looks | Pointing
WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="near-right", kind="object", position=(0.45, -0.25, 0.73), radius=0.03),
        Entity(id="far-left", kind="object", position=(0.70, 0.30, 0.73), radius=0.03),
    )
)
BEHAVIORS: tuple[BlockBehavior, ...] = (
    Gaze(id="gaze", target="near-right"),
    GazeShift(id="gazeShift", target="far-left"),
    GazeShift(id="turn", target="far-left", influence="WAIST"),
    HeadDirectionShift(id="headDirectionShift", target="near-right"),
    Pointing(id="pointing", target="far-left"),
    Gesture(id="gesture", lexeme="BEAT"),
    Head(id="head", lexeme="NOD"),
    Head(id="nods", lexeme="NOD", repetition=3),
    Face(id="face", expressions=(Expression(lexeme="SMILE"), Expression(lexeme="RAISE_BROWS"))),
    FaceLexeme(id="faceLexeme", lexeme="SMILE"),
    FaceFacs(id="faceFacs", au=12),
    FaceShift(id="faceShift", lexeme="SMILE"),
    Posture(id="posture", lexeme="LEAN_FORWARD"),
    PostureShift(id="postureShift", lexeme="TURN_LEFT"),
    Pose(id="pose", lexeme="LEANING_BACKWARD"),
    Speech(id="speech", text="This piece, please.", marks=(Mark("m", 5),)),
    Wait(id="wait", duration=0.5),
)


def behaviors_in(world: World) -> tuple[BlockBehavior, ...]:
    """Direct the behaviors of the suite to what there is in another world: to its first and to its last object.

    world: at least one entity.
    """
    ids = [entity.id for entity in (*world.objects, *world.people, *world.entities)]
    last = ids[max(1, len(world.objects) - 1) % len(ids)]
    places = {"near-right": ids[0], "far-left": last}
    return tuple(replace(each, target=places[each.target]) if isinstance(each, AIMED) else each for each in BEHAVIORS)


HOLDS = {name: row.holds for name, row in TYPES.items() if row.holds}
"""Where each type can wait, as the realizer knows it."""
ONE_INSTANT = {name: row.one_instant for name, row in TYPES.items() if row.one_instant}
"""Points of a type that always coincide, as the realizer knows it."""
ON_AXIS: Radians = math.radians(1.0)
STILL: Radians = math.radians(0.1)
"""What a joint that stands still may move all the same."""
READINGS = 9
"""Readings of which a pose at rest is the middle one, where encoders are noisy."""
Aimed = TypeVar("Aimed", bound=AIMED)
PLUGIN = "engage_hri.services.control.testing.plugin"


class Suite(ABC):
    """Base of the contract suite. A subclass says in `make` how to make the body, and states how exact it is.

    tolerance: stated error of its estimates, seconds from each sync point to the next.
    noise: standard deviation of a reading of its encoders, radians.
    age: by how much one reading may be older than another, seconds; of one that comes again in motion it is measured.
    accuracy: how near the joints come to where they are to be, and the eyes to a target, radians.
    behaviors: what it is asked to do; of each type that it has at least one. world: where their targets are.
    seeds: number of random trials of each law that has some; None: many in virtual time, one in real time.
    unable: types of behaviors that nothing is judged by, since it is known already that they break, with the words.
    """

    topic: ClassVar[str] = ""
    pytestmark: ClassVar[Any] = [pytest.mark.asyncio]
    tolerance: Seconds = 1e-6
    noise: Radians = 0.0
    age: Seconds = 0.001
    accuracy: Radians = ON_AXIS
    behaviors: tuple[BlockBehavior, ...] = BEHAVIORS
    world = WORLD
    seeds: int | None = None
    unable: Mapping[str, str] = {}
    notes: dict[str, None] | None = None
    """What laws have to say of a body that breaks none of them; None: nobody asks."""
    fastest: dict[str, float] | None = None
    """The fastest that each joint was seen to be, radians per second; None: nobody asks."""

    @abstractmethod
    def make(self) -> Body:
        """Make the body, in the running event loop, not connected."""

    def faults(self) -> Mapping[str, Callable[[], Body]]:
        """Name faults, and say how to make the body that has each: a motor that stalls, a connection that is lost."""
        return {}

    def observed(self, body: Body) -> BodyState:
        """Measure the body as a bystander would; by default it is believed."""
        return body.state()

    # -- how pytest runs it --------------------------------------------------------------------------------------

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Make a test of each random trial and of each fault."""
        if "seed" in metafunc.fixturenames:
            most = int(getattr(metafunc.function, "trials", 1))
            is_real = metafunc.definition.get_closest_marker("real_time") is not None
            count = self.seeds if self.seeds is not None else 1 if is_real else most
            metafunc.parametrize("seed", range(min(count, most)))
        if "fault" in metafunc.fixturenames:
            metafunc.parametrize("fault", sorted(self.faults()) or [None])

    @pytest_asyncio.fixture
    async def body(self, request: pytest.FixtureRequest) -> AsyncIterator[Body]:
        """The body of one test, connected and at home."""
        if not request.config.pluginmanager.has_plugin(PLUGIN):
            pytest.fail(f'the suite needs its plugin: pytest_plugins = ["{PLUGIN}"] in conftest.py', pytrace=False)
        async with self.connected(self.make) as body:
            yield body

    @asynccontextmanager
    async def connected(self, make: Callable[[], Body]) -> AsyncIterator[Body]:
        """Make a body, connect it, and bring it home; at the end disconnect, and cancel what tasks it has left."""
        before = asyncio.all_tasks()
        body = make()
        connection = Connection(body)
        await connection.enter()
        try:
            body.see(self.world)
            with suppress(Exception):  # what is wrong with it is for the law of `home` to say
                async with asyncio.timeout(PATIENCE):
                    await body.home()
            yield body
        finally:
            await Stage.end_all()
            await connection.leave()
            left = await still_running(before)
            for task in left:
                task.cancel()
            await asyncio.gather(*left, return_exceptions=True)

    # -- what is there to judge ----------------------------------------------------------------------------------

    def able(self, body: Body) -> list[BlockBehavior]:
        """List the suite's behaviors that the body says it can do. If there are none, no law applies."""
        types = self.types(body)
        able = [
            each
            for each in self.behaviors
            if type_name(each) in types and body.estimate(each, None, self.world).feasible
        ]
        if not able:
            self.lacks(body, "it can do nothing of what it is asked for", *body.capabilities.types)
        return able

    def types(self, body: Body) -> tuple[str, ...]:
        """List the types of behaviors that it has and can be judged by."""
        return tuple(kind for kind in body.capabilities.types if kind not in self.unable)

    def lacks(self, body: Body, what: str, *kinds: str) -> NoReturn:
        """End a test that needs behaviors of these types: its law does not apply, or cannot be judged.

        what: the body lacks, in words. kinds: of types that it has, but breaks at.

        Raises LawBroken with what these break by, if it has one of them.
        """
        whys = {self.unable[kind] for kind in kinds if kind in self.unable and kind in body.capabilities.types}
        if whys:
            expected = "a behavior to judge it by"
            raise LawBroken([Finding(expected=expected, measured=why, cause=why) for why in sorted(whys)])
        does_not_apply(what)

    def needs(self, body: Body, what: str, *kinds: str) -> None:
        """End a test that needs all of these types of behaviors, unless the body has them. what: without them."""
        if not set(kinds) <= set(self.types(body)):
            self.lacks(body, f"it has no {what}", *kinds)

    async def judge(
        self,
        body: Body,
        law: Callable[[BlockBehavior], Awaitable[None]],
        which: "Which | UnionType | type",
        lacks: str,
    ) -> None:
        """Judge a law by one behavior after the other, so that what one of them breaks does not hide the others.

        which: behaviors that the law is about, or their types. lacks: what a body has not got if there are none.

        Raises LawBroken after the last one, with all findings; if the law applies to none of them, it says so.
        """
        __tracebackhide__ = True
        is_one = (lambda each: isinstance(each, which)) if isinstance(which, UnionType | type) else which
        behaviors = [each for each in self.able(body) if is_one(each)]
        if not behaviors:
            unable = [each for each in self.behaviors if type_name(each) in self.unable and is_one(each)]
            self.lacks(body, f"it has {lacks}", *map(type_name, unable))
        findings: list[Finding] = []
        passed: list[BaseException] = []
        for behavior in behaviors:
            try:
                await law(behavior)
            except pytest.skip.Exception as skipped:
                passed.append(skipped)
            except BaseException as error:
                if (found := findings_of(error, named(behavior))) is None:
                    raise
                findings += found
                await Stage.end_all()
                with suppress(Exception):
                    async with asyncio.timeout(PATIENCE):
                        await body.home()
        if findings:
            raise LawBroken(findings)
        if len(passed) == len(behaviors):
            raise passed[0]

    def holds(self, body: Body, behavior: BlockBehavior) -> tuple[str, ...]:
        """List where it can wait; in a speech where the body says so, at marks between two words."""
        if not isinstance(behavior, Speech):
            return HOLDS.get(type_name(behavior), ())
        return tuple(phase.to for phase in body.estimate(behavior, None, self.world).phases if phase.hold)

    def with_one_hand(self, body: Body, behavior: Pointing | Gesture) -> Pointing | Gesture:
        """Choose a hand for a behavior, so that a second one like it takes over the same arm."""
        for mode in ("RIGHT_HAND", "LEFT_HAND"):
            chosen = replace(behavior, mode=mode)
            if body.estimate(chosen, None, self.world).feasible:
                return chosen
        return behavior

    def aims(self, body: Body, behavior: Aimed) -> list[Aimed]:
        """The same behavior again, and one like it at something else if the body can do that; each with an id."""
        entities = [each.id for each in self.world.entities if each.id != behavior.target]
        others = [replace(behavior, id="other", target=each) for each in entities]
        able = [each for each in others if body.estimate(each, None, self.world).feasible]
        return [replace(behavior, id="same"), *able[:1]]

    def joints(self, body: Body, *behaviors: BlockBehavior) -> set[str]:
        """Names of the joints of the parts that behaviors move; of none: of all parts that any of them moves."""
        parts: set[str] = set()
        for behavior in behaviors or self.able(body):
            parts |= set(body.estimate(behavior, None, self.world).parts)
        return {limit.joint for limit in body.capabilities.joints if limit.part in parts}

    def half(self, body: Body, behavior: BlockBehavior) -> Seconds:
        """Half of the time that it takes by itself from here."""
        return sum(phase.natural for phase in body.estimate(behavior, None, self.world).phases) / 2

    def position(self, entity: str, world: World | None = None) -> Vector:
        """Look up where an entity of the world is, metres. world: None: that of the suite."""
        found = (world or self.world).entity(entity)
        assert found is not None
        return found.position

    def world_with(self, entity: str, place: Vector) -> World:
        """The world, with an entity elsewhere."""
        moved = (replace(each, position=place) if each.id == entity else each for each in self.world.entities)
        return replace(self.world, entities=tuple(moved))

    def note(self, words: str) -> None:
        """Say something of the body that is no breach of the contract."""
        if self.notes is not None:
            self.notes[words] = None

    # -- measuring -----------------------------------------------------------------------------------------------

    @property
    def slack(self) -> Radians:
        """Angle by which two single readings of one joint may differ by noise alone."""
        return 6.0 * math.sqrt(2.0) * self.noise

    @property
    def gaze_slack(self) -> Radians:
        """Angle by which a reading of a gaze or forearm, through three or four joints, may be off by noise alone."""
        return 12.0 * self.noise

    @property
    def near(self) -> Radians:
        """Angle by which eyes may be beside what they are on."""
        return self.accuracy + self.gaze_slack

    @property
    def dwell(self) -> Seconds:
        """Time for which something is watched that is not to happen."""
        return 5.0 if isinstance(asyncio.get_running_loop(), VirtualTimeLoop) else 0.5

    async def pose(self, body: Body) -> dict[str, Radians]:
        """Measure the joints of a body that stands: with noisy encoders the median of some readings."""
        if not self.noise:
            return angles(body.state().pose)
        readings = []
        for _ in range(READINGS):
            readings.append(angles(body.state().pose))
            await asyncio.sleep(0.02)
        return {joint: sorted(each[joint] for each in readings)[READINGS // 2] for joint in readings[0]}

    def check_pose(
        self,
        seen: Mapping[str, Radians],
        wanted: Mapping[str, Radians],
        joints: Iterable[str],
        sync: str = "",
        *,
        what: str,
        behavior: BlockBehavior | None = None,
    ) -> None:
        """Compare two poses. Raises LawBroken with the joint that is farthest off, and `what` was due."""
        off = {joint: abs(seen[joint] - wanted[joint]) for joint in joints if joint in seen and joint in wanted}
        limit = self.accuracy + self.slack
        if off and off[worst := max(off, key=lambda joint: off[joint])] > limit:
            is_mirrored = abs(seen[worst] + wanted[worst]) <= limit < abs(wanted[worst])
            broken(
                sync,
                behavior=behavior,
                advice=OTHER_WAY if is_mirrored else "",
                expected=f"{what}: {worst} at {degrees(wanted[worst])}, within {degrees(limit)}",
                measured=f"{worst} at {degrees(seen[worst])}",
            )

    def check_eyes(
        self, body: Body, place: Vector, what: str, sync: str = "", behavior: BlockBehavior | None = None
    ) -> None:
        """See that the eyes of a body are on a place. what: is there, in words. Raises LawBroken."""
        gaze = self.observed(body).gaze
        if gaze is not None and (off := aside(gaze, place)) > self.near:
            eyes = f"eyes on {what}, within {degrees(self.near)}"
            broken(sync, behavior=behavior, expected=eyes, measured=f"{degrees(off)} beside it")

    def check_still(self, samples: Array, joints: Sequence[str], sync: str = "") -> None:
        """See that joints stand still. samples: their angles, of shape (samples, joints). Raises LawBroken."""
        moved = np.ptp(samples, axis=0) if samples.size else np.zeros(1)
        worst, still = int(moved.argmax()), STILL + 2.0 * self.slack
        if moved[worst] > still:
            by = f"{joints[worst]} moves by {degrees(float(moved[worst]))} meanwhile"
            broken(sync, expected=f"joints that stand still, within {degrees(still)}", measured=by)

    def check_passed(self, stage: Stage) -> None:
        """See that a behavior has passed all of its points, each once and in order. Raises LawBroken."""
        if default(stage.passed) != (points := sync_points(stage.behavior)):
            broken(behavior=stage.behavior, expected=listed(points), measured=listed(stage.passed))

    async def check_stands(self, body: Body, sync: str = "", patience: Seconds = PATIENCE) -> None:
        """See that a body comes to stand. Raises LawBroken."""
        if not await standing(body, patience):
            broken(sync, expected=f"a body that stands within {ms(patience)}", measured="`moving` stays true")

    async def check_rest(self, body: Body, home: Mapping[str, Radians], behavior: BlockBehavior, what: str) -> None:
        """See that a body comes to stand, at home and silent. Raises LawBroken."""
        await self.check_stands(body)
        self.check_pose(await self.pose(body), home, self.joints(body, behavior), what=f"the safe pose {what}")
        if saying := body.state().speaking:
            broken(expected=f"silence {what}", measured=f"`speaking` is {saying!r}")


Which = Callable[[BlockBehavior], bool]
Law = Callable[..., Awaitable[None]]


def by_each(which: Which | UnionType | type = object, lacks: str = "no such behavior") -> Callable[[Law], Law]:
    """Make a law of one behavior one of a body: it is judged by each behavior that the body can do.

    The law takes `behavior`; if it takes `home`, too, that is the pose of the body before the first of them.

    which, lacks: as of `Suite.judge`.
    """

    def of_a_body(law: Law) -> Law:
        asked = signature(law)
        own = [each for name, each in asked.parameters.items() if name not in ("behavior", "home")]

        @wraps(law)
        async def judged(suite: Suite, body: Body, **trial: Any) -> None:
            __tracebackhide__ = True
            if "home" in asked.parameters:
                trial["home"] = await suite.pose(body)
            await suite.judge(body, lambda behavior: law(suite, body, behavior=behavior, **trial), which, lacks)

        judged.__signature__ = asked.replace(parameters=own)  # type: ignore[attr-defined]  # pytest reads it
        return judged

    return of_a_body


def has_joints(behavior: BlockBehavior) -> bool:
    """True for what is done with joints."""
    return not isinstance(behavior, Speech | Wait)


def does_not_apply(why: str) -> NoReturn:
    """End a test: its law cannot be judged by this body."""
    pytest.skip(why)


def trials(count: int) -> Callable[[Any], Any]:
    """Say how often a law with a `seed` is tried in virtual time."""

    def mark(law: Any) -> Any:
        law.trials = count
        return law

    return mark


def pose_angles(pose: BodyPose | None) -> dict[str, Radians]:
    """The angle of each joint of a pose; of none: nothing."""
    return {} if pose is None else angles(pose)
