"""The contract between the realizer and a body: behaviors out, sync points back.

Movement authority. `PerformBehavior.through` names the last sync point the body may pass without asking; it
holds at the hold point before the next one and says so (`SyncPointArrived`). The realizer extends the authority
by sending the request again, same id, with a later `through`; it lasts as long as `KeepAlive` renews it (decision
0001). Authority never shrinks. Where each type can hold is in
docs/control.md: before and after the stroke of an arm or a nod, on target (`stroke` and `relax`) what lasts there.
"""

from typing import ClassVar, Literal, Self

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Degrees, Duration, Meters, Radians, Stamp, Vector


class PlannedInstant(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """When the body is to come to a sync point."""

    sync: str
    at: Stamp


class PerformBehavior(Request, frozen=True, kw_only=True, tag="perform_behavior", omit_defaults=True):
    """cmd: realizer -> control. Terminal state: `BehaviorOutcome`.

    through: sync point in the body's own (draft, snake_case) spelling; at least `start`.
    """

    is_updatable: ClassVar[bool] = True

    block: str
    behavior: BlockBehavior
    through: str
    pace: tuple[PlannedInstant, ...] = ()
    """Where its own pace would miss them, instants of its coming points: it is to be slower, or faster, or smaller,
    as near to them as it can. The newest says all; empty: as is natural."""

    @property
    def authority(self) -> str:
        return self.through

    def with_authority(self, authority: str) -> Self:
        return replace(self, through=authority)


class AbortBehavior(Request, frozen=True, kw_only=True, tag="abort_behavior", omit_defaults=True):
    """cmd: generation -> control: end a behavior of a block, whoever asked for it. Ends in `BehaviorAborted`.

    how: relaxing, or freezing and then relaxing. Who asked for the behavior itself sends a `Cancel`.
    """

    block: str
    behavior: str
    how: Literal["relax", "freeze"] = "relax"


class BehaviorAborted(Outcome, frozen=True, kw_only=True, tag="behavior_aborted", omit_defaults=True):
    """evt: terminal state of `AbortBehavior`: the behavior has ended, one way or another."""


class GoHome(Request, frozen=True, kw_only=True, tag="go_home", omit_defaults=True):
    """cmd: realizer -> control: move `parts` (empty: all) to the safe pose. Ends in `HomeReached`."""

    parts: tuple[str, ...] = ()


class HomeReached(Outcome, frozen=True, kw_only=True, tag="home_reached", omit_defaults=True):
    at: Stamp


class SyncPointArrived(Struct, frozen=True, kw_only=True, tag="sync_point_arrived", omit_defaults=True):
    """evt: the body has come to a hold point it may not pass yet, and waits there."""

    id: str
    """Of the `PerformBehavior` request."""
    block: str
    behavior: str
    sync: str
    at: Stamp
    requester: str = ""
    """Of that request; empty where the body does not say."""


class SyncPointReached(Struct, frozen=True, kw_only=True, tag="sync_point_reached", omit_defaults=True):
    """evt: the body has passed a sync point, at `at`. Each point of a behavior once, in order.

    sync: of a repeated movement also `stroke:2`, `stroke:3` ... if the estimate has phases to them.
    arrived: when it came to the point; earlier than `at` if it had to hold there.
    """

    id: str
    block: str
    behavior: str
    sync: str
    at: Stamp
    arrived: Stamp
    requester: str = ""


class WordSpoken(Struct, frozen=True, kw_only=True, tag="word_spoken", omit_defaults=True):
    """evt: the voice has finished a word. `position`: characters of the text said so far."""

    block: str
    behavior: str
    word: str
    position: int
    at: Stamp


class BehaviorOutcome(Outcome, frozen=True, kw_only=True, tag="behavior_outcome", omit_defaults=True):
    """evt: terminal state of `PerformBehavior`. done: after its `end`. spoken: what the voice said of it."""

    block: str
    behavior: str
    status: Literal["done", "aborted", "failed"]
    at: Stamp
    spoken: str = ""
    fault: Fault | None = None


class JointAngle(Struct, frozen=True, omit_defaults=True):
    joint: str
    angle: Radians


class BodyPose(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Joint angles of a body: where it is, or where a behavior would leave it."""

    joints: tuple[JointAngle, ...] = ()


class Phase(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """From one sync point of a behavior to its next: how long it takes.

    hold: the body can wait at `to` for as long as it must. longest None: no upper limit.
    An estimate with a phase that is no number, negative, or longer than a day is refused: nothing is planned with it.
    """

    since: str
    to: str
    shortest: Duration
    natural: Duration
    longest: Duration | None = None
    hold: bool = False


class Ray(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A gaze axis (origin: the eyes) or a forearm (origin: the elbow, tip: the hand). `axis` is a unit vector."""

    origin: Vector
    axis: Vector
    tip: Vector | None = None


class Estimate(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What a body expects of a behavior. Not feasible: `fault` says why, with the type of warning it deserves."""

    behavior: str
    feasible: bool
    fault: Fault | None = None
    warning: str = ""
    """NO_SUCH_TARGET, BEHAVIOR_TYPE_NOT_SUPPORTED, CANNOT_CREATE_BEHAVIOR ... when not feasible."""
    parts: tuple[str, ...] = ()
    phases: tuple[Phase, ...] = ()
    """From `start` to `end`, without gaps; sync points in the draft's spelling, and `stroke:2` and on of a repeated
    movement if the body reports them: what it does not, is expected in equal parts from `stroke` to `stroke_end`."""
    head_degrees: Degrees = 0.0
    """Sum over the head's joints of the rotation from the starting pose to the target. Cg of thesis 3.3.2."""
    arm_degrees: Degrees = 0.0
    """The same for the arm used. Cp of thesis 3.3.2."""
    ray: Ray | None = None
    """Gaze axis or forearm once on target."""
    pose_after: BodyPose | None = None
    """Pose on target (for a sequence of references), joints as in `BodyPose`."""


class EstimateItem(Struct, frozen=True, kw_only=True, omit_defaults=True):
    behavior: BlockBehavior
    pose: BodyPose | None = None
    """Start from here; None: from where the body is now."""


class EstimateBehaviors(Struct, frozen=True, kw_only=True, tag="estimate_behaviors", omit_defaults=True):
    """rpc: realizer or generation -> control, answered with `Estimates` in the same order."""

    items: tuple[EstimateItem, ...]


class Estimates(Struct, frozen=True, kw_only=True, tag="estimates", omit_defaults=True):
    items: tuple[Estimate, ...]


class DescribeBody(Struct, frozen=True, kw_only=True, tag="describe_body", omit_defaults=True):
    """rpc: anyone -> control, answered with `Capabilities`."""


class NoPointZone(Struct, frozen=True, kw_only=True, omit_defaults=True):
    center: Vector
    radius: Meters


class JointLimit(Struct, frozen=True, kw_only=True, omit_defaults=True):
    joint: str
    part: str
    low: Radians
    high: Radians
    speed: float
    """rad/s"""
    acceleration: float
    """rad/s^2"""


class Capabilities(Struct, frozen=True, kw_only=True, tag="capabilities", omit_defaults=True):
    """What a body can do: behavior types (BML names), its parts and joints, reach and forbidden zones."""

    body: str
    types: tuple[str, ...]
    parts: tuple[str, ...]
    joints: tuple[JointLimit, ...] = ()
    reach: Meters = 0.0
    no_point_zones: tuple[NoPointZone, ...] = ()
    gaze_half_angle: Radians = 0.1
    """Half-angle of the gaze cone as a person perceives it."""
    pointing_radius: Meters = 0.05
    """Radius of the pointing cylinder."""


class RobotState(Struct, frozen=True, kw_only=True, tag="robot_state", omit_defaults=True):
    """stream: control, at a fixed rate: pose, gaze axis, arms, what is being said."""

    at: Stamp
    pose: BodyPose
    gaze: Ray
    left_arm: Ray
    right_arm: Ray
    looking_at: str = ""
    speaking: str = ""
