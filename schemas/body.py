"""The contract between the realizer and a body: behaviors out, sync points back.

Movement authority. `PerformBehavior.through` names the last sync point that the body may pass without asking; it
holds at the hold point before the next one and says so (`SyncPointArrived`). The realizer extends the authority by
sending the request again, same id, with a later `through`; it lasts as long as `KeepAlive` renews it (decision 0001).
Authority never shrinks; a behavior that is `held` waits all the same, and then goes on with it. The hold points of
each type are in docs/control.md: before and after the stroke of an arm or a nod; on target (`stroke` and `relax`) for
a gaze, a face or a posture.
"""

from math import inf
from typing import ClassVar, Literal, Self

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Degrees, Duration, Meters, Radians, Seconds, Stamp, Vector


class PlannedInstant(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Instant at which the body is to come to a sync point."""

    sync: str
    at: Stamp


class PerformBehavior(Request, frozen=True, kw_only=True, tag="perform_behavior", omit_defaults=True):
    """cmd: realizer -> control: perform a behavior. Terminal state: `BehaviorOutcome`.

    through: the last sync point that the body may pass without asking, in the drafts' spelling; at least `start`.
    """

    is_updatable: ClassVar[bool] = True

    block: str
    behavior: BlockBehavior
    through: str
    pace: tuple[PlannedInstant, ...] = ()
    """Instants for coming sync points which the natural pace would miss. The body comes as near to them as it can, by
    moving faster, slower or less far. The newest request replaces all earlier instants; empty: natural pace."""
    held: bool = False
    """True to wait at the next place where the body can, whatever `through` says: a movement at its next hold point
    (`SyncPointArrived`), a voice at the next word gap, mark or no mark. It goes there at its `pace`. Sent again
    without it, the behavior goes on as far as `through` says. One that can wait nowhere any more ends by itself."""
    held_after: Seconds = 0.0
    """Seconds after the last renewal from which on the behavior is held, as by `held`, until it is renewed; 0: never.
    Renewed is it by a `KeepAlive` that names it, or by being sent again. Its `lease` says when it ends."""

    @property
    def unheard(self) -> Seconds:
        return self.held_after

    @property
    def authority(self) -> str:
        return self.through

    def with_authority(self, authority: str) -> Self:
        return replace(self, through=authority)


class AbortBehavior(Request, frozen=True, kw_only=True, tag="abort_behavior", omit_defaults=True):
    """cmd: generation -> control: end a behavior that the realizer asked for. Ends in `BehaviorAborted`.

    The requester of the behavior sends a `Cancel` instead.

    how: relax at once, or freeze and then relax.
    """

    block: str
    behavior: str
    how: Literal["relax", "freeze"] = "relax"


class BehaviorAborted(Outcome, frozen=True, kw_only=True, tag="behavior_aborted", omit_defaults=True):
    """evt: terminal state of `AbortBehavior`: the behavior has ended, by this or by itself."""


class GoHome(Request, frozen=True, kw_only=True, tag="go_home", omit_defaults=True):
    """cmd: realizer -> control: move `parts` (empty: all) to the safe pose. Ends in `HomeReached`."""

    parts: tuple[str, ...] = ()


class HomeReached(Outcome, frozen=True, kw_only=True, tag="home_reached", omit_defaults=True):
    """evt: terminal state of `GoHome`: the parts are in the safe pose."""

    at: Stamp


class SyncPointArrived(Struct, frozen=True, kw_only=True, tag="sync_point_arrived", omit_defaults=True):
    """evt: the body has come to a hold point it may not pass yet, and waits there."""

    id: str
    """Id of the `PerformBehavior` request."""
    block: str
    behavior: str
    sync: str
    at: Stamp
    requester: str = ""
    """Requester of that request; empty if the body does not say."""


class SyncPointReached(Struct, frozen=True, kw_only=True, tag="sync_point_reached", omit_defaults=True):
    """evt: the body has passed a sync point. Each point of a behavior once, in order.

    sync: of a repeated movement also `stroke:2`, `stroke:3` ... if the estimate has phases to them.
    at: when the body passed the point.
    arrived: when the body came to the point; earlier than `at` if it had to hold there.
    """

    id: str
    block: str
    behavior: str
    sync: str
    at: Stamp
    arrived: Stamp
    requester: str = ""


class WordSpoken(Struct, frozen=True, kw_only=True, tag="word_spoken", omit_defaults=True):
    """evt: the voice has finished a word.

    position: characters of the text said so far.
    """

    block: str
    behavior: str
    word: str
    position: int
    at: Stamp


class BehaviorOutcome(Outcome, frozen=True, kw_only=True, tag="behavior_outcome", omit_defaults=True):
    """evt: terminal state of `PerformBehavior`.

    status: `done`: its `end` was passed; `taken_over`: before that another behavior took one of its parts, at `at`;
    `aborted`: it was ended before; `lapsed`: its requester was lost, and the body goes home; `failed`: see `fault`.
    passed: the last sync point that was passed; empty: none, or the body does not say.
    spoken: of a speech, the words that the voice has said.
    """

    block: str
    behavior: str
    status: Literal["done", "taken_over", "aborted", "lapsed", "failed"]
    at: Stamp
    passed: str = ""
    spoken: str = ""
    fault: Fault | None = None


class JointAngle(Struct, frozen=True, omit_defaults=True, gc=False):
    """Angle of one joint."""

    joint: str
    angle: Radians


class BodyPose(Struct, frozen=True, kw_only=True, omit_defaults=True, gc=False):
    """Joint angles of a body, at some instant or at the end of a behavior."""

    joints: tuple[JointAngle, ...] = ()


class Phase(Struct, frozen=True, kw_only=True, omit_defaults=True, gc=False):
    """Time that the body needs from one sync point of a behavior to the next.

    An estimate in which a duration is no number, negative, or longer than a day is refused.

    since: the first of the two sync points. to: the second.
    shortest: at full speed. natural: as the body likes to move. longest: at its slowest; None: no limit.
    hold: true if the body can wait at `to` for as long as it must.
    """

    since: str
    to: str
    shortest: Duration
    natural: Duration
    longest: Duration | None = None
    hold: bool = False


class WordTime(Struct, frozen=True, kw_only=True, omit_defaults=True, gc=False):
    """Time of a word in a speech that waits nowhere.

    position: characters of the text up to its end, as `WordSpoken` tells them.
    start, end: seconds from the start of the speech.
    """

    position: int
    start: Duration
    end: Duration


class Ray(Struct, frozen=True, kw_only=True, omit_defaults=True, gc=False):
    """A gaze axis or a forearm.

    origin: the eyes, or the elbow. axis: the direction, a unit vector. tip: of a forearm, the hand.
    error: half the angle of the cone around the axis in which it really lies, 19 times in 20; 0: as it is measured.
    """

    origin: Vector
    axis: Vector
    tip: Vector | None = None
    error: Radians = 0.0


class Estimate(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Prediction of a body for one behavior: feasible or not, body parts, times, and where it would end.

    fault: why it is not feasible.
    """

    behavior: str
    feasible: bool
    fault: Fault | None = None
    warning: str = ""
    """Type of the warning when not feasible: NO_SUCH_TARGET, BEHAVIOR_TYPE_NOT_SUPPORTED, CANNOT_CREATE_BEHAVIOR
    ..."""
    degraded: str = ""
    """What is performed in place of what was asked, in words, if the body has only something near it: "this body has
    no gesture 'EMBLEM'; it performs 'WAVE', the nearest"; for several things one after the other, with "; " between
    them. The realizer warns of it, and performs the behavior. `engage play` reads from it what the body does."""
    parts: tuple[str, ...] = ()
    phases: tuple[Phase, ...] = ()
    """Phases from `start` to `end`, without gaps, in the drafts' spelling. Of a repeated movement also `stroke:2` and
    on, if the body reports them; strokes that it does not report are expected at equal distances up to
    `stroke_end`."""
    words: tuple[WordTime, ...] = ()
    """Of a speech, its words in the order of the text, each of which the body tells as `WordSpoken` when it is said.
    From these the realizer sees how late the next mark will come. Empty: the voice does not know; then the marks
    alone say how late it is."""
    head_degrees: Degrees = 0.0
    """Rotations of the head's joints on their way from the pose to the target, added up. Cg of thesis 3.3.2."""
    arm_degrees: Degrees = 0.0
    """The same for the arm used. Cp of thesis 3.3.2."""
    ray: Ray | None = None
    """Gaze axis or forearm once on target."""
    pose_after: BodyPose | None = None
    """Pose on target (for a sequence of references), joints as in `BodyPose`."""
    pose_end: BodyPose | None = None
    """Pose at the end, once its parts have gone back to rest; of a shift the same as on target. None: not known."""


class PlannedTime(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Time planned for a sync point. at: seconds from now. through: for a hold point, true if the behavior is told in
    time that it may pass: it is slower on its way, and does not stop there."""

    sync: str
    at: Seconds
    through: bool = False


class EstimateItem(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A behavior to be estimated."""

    behavior: BlockBehavior
    pose: BodyPose | None = None
    """Pose to start from; None: the present one."""
    times: tuple[PlannedTime, ...] = ()
    """Times of its start, of the hold points at which it has to wait, and of points that it has to reach faster or
    slower than by itself; empty: it is estimated by itself. The items of one question that have times are one plan: a
    body that can rehearse it estimates each from where the others will have brought its parts by then."""
    reached: int = 0
    """Number of its sync points that it has reached: the first of its times are theirs, and have passed. It is under
    way then. Phases that are over count for nothing in its estimate; it has none if it moves nothing."""
    only: Literal["", "posture", "degrees"] = ""
    """`posture`: asked is only what it comes to: whether it can be done, with which parts, degrees, ray and poses.
    `degrees`: of these neither ray nor poses. The body may leave out the rest; phases are most of the work, poses
    most of the answer. Empty: all."""


class EstimateBehaviors(Struct, frozen=True, kw_only=True, tag="estimate_behaviors", omit_defaults=True):
    """rpc: realizer or generation -> control, answered with `Estimates` in the same order."""

    items: tuple[EstimateItem, ...]
    others: tuple[EstimateItem, ...] = ()
    """Behaviors that move the body meanwhile, with their times: mostly of other blocks. They are not answered. A body
    that can rehearse lets them move, too."""


class Estimates(Struct, frozen=True, kw_only=True, tag="estimates", omit_defaults=True):
    """Answer to `EstimateBehaviors`, in its order."""

    items: tuple[Estimate, ...]


class DescribeBody(Struct, frozen=True, kw_only=True, tag="describe_body", omit_defaults=True):
    """rpc: anyone -> control, answered with `Capabilities`."""


class NoPointZone(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A ball in space at which the robot must not point, in the robot's frame."""

    center: Vector
    radius: Meters


class JointLimit(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Range and greatest speed and acceleration of a joint.

    joint: its name. part: the body part that it belongs to. low, high: the ends of its range.
    speed: the greatest, radians per second. acceleration: the greatest, radians per second squared.
    """

    joint: str
    part: str
    low: Radians
    high: Radians
    speed: float
    acceleration: float


class FaultKind(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A kind of fault.

    kind: its name, where no table has it. does: what goes wrong, and what one sees of it.
    on: what `part` may name; empty: it takes none. voice: true if the voice is among these parts. parts: the only
    ones that it may name; empty: all of which `on` tells.
    amount: what `amount` is, with its unit; empty: it takes none. usual: the amount where none is given; None: as
    `amount` says. low, high: the range of the amount. needs_amount: true if there must be one.
    before, behavior: true if it takes that field.
    """

    kind: str = ""
    does: str
    on: Literal["", "part", "joint", "part or joint"] = ""
    voice: bool = False
    parts: tuple[str, ...] = ()
    amount: str = ""
    usual: float | None = None
    low: float = 0.0
    high: float = inf
    needs_amount: bool = False
    before: bool = False
    behavior: bool = False


class Capabilities(Struct, frozen=True, kw_only=True, tag="capabilities", omit_defaults=True):
    """Abilities of a body. Answer to `DescribeBody`.

    body: its name. types: the behavior types that it performs, by their BML names. reach: from the shoulder to the
    farthest thing that it points at; 0: it does not say, or does not point.
    """

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
    faults: tuple[str, ...] = ()
    """Kinds of faults that it can play when it is told to (`SwitchFaults`); none: a real body."""
    fault_kinds: tuple[FaultKind, ...] = ()
    """What those of them are that it has alone, or means in another way than `schemas/body_faults.py` says."""


class RobotSeen(Struct, frozen=True, kw_only=True, tag="robot_seen", omit_defaults=True):
    """state: control, of a simulated body, for those who simulate people and cameras: where eyes and forearms really
    are while that is not where they measure. None: as `RobotState` says, or it has no such part.
    """

    at: Stamp
    gaze: Ray | None = None
    left_arm: Ray | None = None
    right_arm: Ray | None = None


class RobotState(Struct, frozen=True, kw_only=True, tag="robot_state", omit_defaults=True):
    """state and stream: control, the present state of the body, seldom and often.

    gaze: from the eyes. left_arm, right_arm: the forearms. None: it has no eyes, or no such arm.
    looking_at: target of one entity or several; empty: nothing. speaking: words that are being said; empty: silence.
    """

    at: Stamp
    pose: BodyPose
    gaze: Ray | None = None
    left_arm: Ray | None = None
    right_arm: Ray | None = None
    looking_at: str = ""
    speaking: str = ""
