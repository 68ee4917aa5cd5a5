"""Bodies that claim what they do not do, of themselves or of what is to come. See `test_liars.py`."""

from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import aclosing

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Speech
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, Phase
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import BodyState, MouthShape, MovementAuthority, Progress
from engage_hri.services.control.torso.body import SimulatedBody


class Claiming(SimulatedBody):
    """Says of each behavior what `claim` makes of its estimate, in rehearsals, too."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return self.claim(super().estimate(behavior, pose, world))

    def claim(self, told: Estimate) -> Estimate:
        return told


def with_phases(told: Estimate, change: Callable[[Phase], Phase]) -> Estimate:
    return replace(told, phases=tuple(change(phase) for phase in told.phases))


class Backward(Claiming):
    """Says that its eyes and forearms are along the opposite ray."""

    def claim(self, told):
        if told.ray is None:
            return told
        x, y, z = told.ray.axis
        return replace(told, ray=replace(told.ray, axis=(-x, -y, z)))


class Rayless(Claiming):
    """Says nothing of where its eyes will be."""

    def claim(self, told):
        return replace(told, ray=None)


class Effortless(Claiming):
    """Turns by no degrees."""

    def claim(self, told):
        return replace(told, head_degrees=0.0, arm_degrees=0.0)


class Laborious(Claiming):
    """Counts each degree ten times."""

    def claim(self, told):
        return replace(told, head_degrees=10.0 * told.head_degrees, arm_degrees=10.0 * told.arm_degrees)


class Boasting(Claiming):
    """Says that it can be fifty times as fast."""

    def claim(self, told):
        return with_phases(told, lambda phase: replace(phase, shortest=phase.natural / 50))


class Endless(Claiming):
    """Says that it can be as slow as anybody asks."""

    def claim(self, told):
        return with_phases(told, lambda phase: replace(phase, longest=None))


class Rehearsing(SimulatedBody):
    """Says in rehearsals, which plans are made of, three times what its estimates say."""

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        told = super().rehearse(items, world, others)
        return [with_phases(each, lambda phase: replace(phase, natural=3.0 * phase.natural)) for each in told]


class Wide(SimulatedBody):
    """Points at everything."""

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = replace(self.capabilities, pointing_radius=9.0)


class Aside(Wide):
    """Has forearms that point half a metre beside, within the radius that it states."""

    def state(self) -> BodyState:
        state = super().state()
        arms = {}
        for side in ("left_arm", "right_arm"):
            ray = getattr(state, side)
            x, y, z = ray.origin
            arms[side] = replace(ray, origin=(x, y, z + 0.5))
        return replace(state, **arms)


class Centimetres(SimulatedBody):
    """States its reach in centimetres."""

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = replace(self.capabilities, reach=100.0 * self.capabilities.reach)


class Modest(SimulatedBody):
    """States a reach of 90 cm, and points farther."""

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = replace(self.capabilities, reach=0.9)


class Squinting(SimulatedBody):
    """Has a cone of gaze half as wide as the room."""

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = replace(self.capabilities, gaze_half_angle=3.0)


class Sprinting(SimulatedBody):
    """States limits ten times as high as those of its joints."""

    def __init__(self) -> None:
        super().__init__()
        joints = (replace(each, speed=10 * each.speed) for each in self.capabilities.joints)
        self.capabilities = replace(self.capabilities, joints=tuple(joints))


class Oblivious(SimulatedBody):
    """Takes note of the world once."""

    has_seen = False

    def see(self, world: World) -> None:
        if not self.has_seen:
            super().see(world)
        self.has_seen = True


class Halfway(SimulatedBody):
    """Follows half the way of what it looks at."""

    def see(self, world: World) -> None:
        before = self.moves.world
        moved = tuple(
            each
            if (old := before.entity(each.id)) is None or not self.moves.runs.get("head")
            else replace(each, position=tuple((a + b) / 2 for a, b in zip(old.position, each.position, strict=True)))
            for each in world.entities
        )
        super().see(replace(world, entities=moved))


class Hasty(SimulatedBody):
    """Says that it looks at its target from the first instant on."""

    target = ""

    def perform(self, behavior, authority):
        if isinstance(behavior, Gaze | GazeShift):
            self.target = behavior.target
        return super().perform(behavior, authority)

    def state(self) -> BodyState:
        return replace(super().state(), looking_at=self.target)


class Absent(SimulatedBody):
    """Says that it looks at nothing."""

    def state(self) -> BodyState:
        return replace(super().state(), looking_at="")


class Whole(SimulatedBody):
    """Takes all parts home, whichever it is asked for."""

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        await super().home()


class Rooted(SimulatedBody):
    """Takes none home but all."""

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if not parts:
            await super().home()


class Gaping(SimulatedBody):
    """Keeps its mouth open until long after it has spoken."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if isinstance(behavior, Speech):
            self.on_lips([MouthShape(self._loop.time(), 1.0), MouthShape(self._loop.time() + 1000.0, 0.0)])
        async with aclosing(super().perform(behavior, authority)) as stream:
            async for progress in stream:
                yield progress
