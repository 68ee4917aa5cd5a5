"""Who owns the robot's head: six claims by priority, one owner at a time. Thesis 3.3.4.

A higher claim takes over at once; when the owner lets go the head stays for a dwell before a lower claim gets it.
Claims 3 to 6 move the base gaze by `gazeShift` blocks, which end on arrival and hold nothing; a fragment's own
gaze overlays it, and is never fought: while it owns the head nothing else is sent. Where it is on a face the base
goes there too, unseen beneath it: the gaze at the end of a turn must not fall back to where the head was before.
So it does when an inhibition that holds the head has a fragment's gaze aborted: else the head would go home.
"""

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.attention import Claim
from engage_hri.schemas.behaviors import Event, GazeShift, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Degrees, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.inhibitions import Inhibition
from engage_hri.services.generation.head.maintenance_policy import FaceWatch, GlanceWatch, HandWatch
from engage_hri.services.generation.head.response_policy import ResponsePolicy

NOBODY = Claim(kind="none", priority=0, reason="nobody has been seen")
UP_RIGHT: Degrees = 60.0
"""From the table: at nothing that anybody could mean, as far as the neck turns. Thesis 5.3."""
Observation = (
    World | RobotState | Statistics | ConnectionEvent | ActionBegan | ActionEnded | ActorFound | ActorLost
)  # fmt: skip


class Aim(Struct, frozen=True):
    """Where the base gaze belongs. target: empty to leave it where it is. beside: past it, to the upper right."""

    target: str = ""
    beside: bool = False


NOWHERE = Aim()


class Shift(Struct, frozen=True):
    """Move the base gaze to `target`. glance: announce an optional mutual facial gaze with it.

    beside: look past it, to the upper right.
    """

    id: str
    target: str
    glance: bool = False
    beside: bool = False

    @property
    def block(self) -> Block:
        shift = GazeShift(id="shift", target=self.target)
        if self.beside:
            shift = GazeShift(id="shift", target=self.target, offset_direction="UPRIGHT", offset_angle=UP_RIGHT)
        if not self.glance:
            return Block(id=self.id, behaviors=(shift,))
        event = Event(
            id="glance",
            kind="mutual_facial_gaze",
            responder=self.target,
            cause="maintenance",
            optional=True,
            timing=(Timing("start", "shift:start"),),
        )
        return Block(id=self.id, behaviors=(shift, event))


class Ruling(Struct, frozen=True):
    """Who owns the head now. changed: since the last ruling, so worth publishing."""

    owner: Claim
    since: Seconds
    waiting: tuple[Claim, ...]
    changed: bool
    shift: Shift | None = None


class Arbiter:
    """Feed it what happens, then ask for its ruling; ask again when `deadline` has come."""

    def __init__(self, robot: str, config: GenerationConfig) -> None:
        self._config = config
        self._responses = ResponsePolicy(robot, config)
        self._hands = HandWatch(robot, config)
        self._faces = FaceWatch(robot, config)
        self._glances = GlanceWatch(config)
        self._inhibition: Inhibition | None = None
        self._fragment: Claim | None = None
        self._thought: Claim | None = None
        self._world: World | None = None
        self._state: RobotState | None = None
        self._half_angle: Radians = config.gaze_half_angle or 0.1
        self._owner = NOBODY
        self._since: Seconds = 0.0
        self._waiting: tuple[Claim, ...] | None = None
        """None before the first ruling, which is always news."""
        self._lapsed: Seconds | None = None
        self._base = NOWHERE
        """Where the base gaze was last sent."""
        self._held = NOWHERE
        """Where an inhibition with mode hold found the gaze of a fragment."""
        self._failed: tuple[Aim, Seconds] | None = None
        """What the last shift did not reach, and when to try that again."""
        self._shifts = 0

    # -- what happens ---------------------------------------------------------------------------------------------

    def feed(self, observation: Observation, now: Seconds) -> None:
        match observation:
            case World():
                self._world = observation
                self._hands.feed(observation, now)
                self._faces.feed(observation, now)
            case RobotState():
                self._state = observation
            case Statistics():
                self._glances.feed(observation, now)
            case ConnectionEvent():
                self._glances.feed(observation, now)
                self._responses.feed(
                    observation,
                    now,
                    world=self._world,
                    gaze=self._state.gaze if self._state else None,
                    half_angle=self._half_angle,
                    fragment_target=self._owner.target if self._owner.kind == "fragment" else "",
                )
            case ActionBegan() | ActionEnded():
                self._hands.feed(observation, now)
            case ActorFound():
                self._faces.feed(observation, now)
            case ActorLost():
                self._faces.feed(observation, now)
                self._hands.feed(observation, now)

    def gaze_perceived_within(self, half_angle: Radians) -> None:
        """What the body says of its gaze cone; the configuration goes before."""
        self._half_angle = self._config.gaze_half_angle or half_angle

    def inhibit(self, inhibition: Inhibition | None) -> None:
        """The newest lease on gaze, if there is one."""
        self._inhibition = inhibition
        if self._mode != "hold":
            self._held = NOWHERE

    def fragment_gazes(self, target: str, reason: str = "") -> None:
        """A gaze of a fragment has started."""
        self._fragment = Claim(kind="fragment", priority=2, target=target, reason=reason)

    def fragment_shifts(self, target: str, reason: str = "") -> None:
        """A fragment moves the base gaze itself."""
        self.fragment_gazes(target, reason)
        self._base = Aim(target)

    def fragment_rests(self) -> None:
        """Its gaze has ended, its block has not: the head is back on the base gaze, and stays the fragment's."""
        self._fragment = Claim(kind="fragment", priority=2, target=self._base.target, reason="until its block ends")

    def fragment_lets_go(self) -> None:
        """Its block has ended."""
        self._fragment = None

    def think(self, target: str) -> None:
        """Between two fragments of a turn: avert the gaze until the next one."""
        self._thought = Claim(kind="fragment", priority=2, target=target, reason="thinks")

    def stop_thinking(self) -> None:
        self._thought = None

    def speak_to(self, person: str) -> None:
        self._faces.partner = person

    def shift_failed(self, id: str, now: Seconds) -> None:
        """The base gaze is not where it was sent: try that again after a pause, and anything else at once."""
        if id.rpartition("-")[2] == str(self._shifts):
            self._failed = self._base, now + self._config.retry
            self._base = NOWHERE

    def body_lost(self) -> None:
        """Another may come, and look elsewhere."""
        self._base = NOWHERE

    def recognition_lost(self) -> None:
        """Nobody will say how the events end that it began."""
        self._responses.forget()

    # -- what follows ---------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        due = [self._hands.deadline, self._faces.deadline, self._glances.deadline, self._responses.deadline]
        due.append(self._failed[1] if self._failed else None)
        if self._lapsed is not None:
            due.append(self._lapsed + self._config.dwell)
        return min((each for each in due if each is not None), default=None)

    def rule(self, now: Seconds) -> Ruling:
        """The owner by now, and the gaze shift that takes the head there."""
        claims = self._claims(now)
        before, waited = self._owner, self._waiting
        self._owner = self._next_owner(claims, now)
        if self._owner != before:
            self._lapsed = None
            arrives = self._owner.kind == "inhibition" != before.kind
            if arrives and self._mode == "hold" and self._fragment is not None:
                self._held = Aim(self._fragment.target)
            if (self._owner.kind, self._owner.target) != (before.kind, before.target):
                self._since = now
            if self._owner.kind == "glance" != before.kind:
                self._glances.began(now)
        if before.kind == "glance" != self._owner.kind:
            self._glances.ended(now)
        self._glances.head_is_on_face(self._faces.is_face(self._head_on()), now)
        self._waiting = tuple(claim for claim in claims if claim.kind != self._owner.kind)
        changed = self._owner != before or self._waiting != waited
        return Ruling(self._owner, self._since, self._waiting, changed, self._shift(now))

    def _claims(self, now: Seconds) -> list[Claim]:
        face = self._faces.claim(now)
        self._glances.face = face.target if face else ""
        claims = [
            self._inhibition.claim if self._inhibition else None, self._fragment or self._thought,
            self._glances.claim(now), self._responses.claim(now), self._hands.claim(now), face,
        ]  # fmt: skip
        return [claim for claim in claims if claim is not None]

    def _head_on(self) -> str:
        """What the head is on or on its way to: the owner's target, else what the body says."""
        return self._owner.target or (self._state.looking_at if self._state else "") or self._base.target

    def _next_owner(self, claims: list[Claim], now: Seconds) -> Claim:
        best = claims[0] if claims else NOBODY
        own = next((claim for claim in claims if claim.kind == self._owner.kind), None)
        if self._owner is NOBODY or (claims and best.priority < self._owner.priority):
            return best
        if own is not None:
            self._lapsed = None
            return own
        if self._lapsed is None:
            self._lapsed = now
        return best if now >= self._lapsed + self._config.dwell else self._owner

    def _shift(self, now: Seconds) -> Shift | None:
        """None while the head is where it belongs, or is not ours to move."""
        if self._failed is not None and now >= self._failed[1]:
            self._failed = None
        owner, aim = self._owner, self._aim()
        if not aim.target or aim == self._base or self._lapsed is not None:
            return None
        if self._failed is not None and aim == self._failed[0]:
            return None
        if owner.kind == "fragment" and self._fragment is not None and not self._faces.is_face(aim.target):
            return None
        self._base = aim
        self._shifts += 1
        cause = "response" if owner.kind == "response" else "maintenance"
        return Shift(f"{cause}-{self._shifts}", aim.target, glance=owner.kind == "glance", beside=aim.beside)

    def _aim(self) -> Aim:
        if self._owner.kind == "inhibition" and self._mode == "hold":
            return self._held
        if self._owner.kind == "inhibition" and self._mode == "stare":
            return Aim(self._landmark(), beside=True)
        return Aim(self._owner.target)

    @property
    def _mode(self) -> str:
        return self._inhibition.mode if self._inhibition is not None else ""

    def _landmark(self) -> str:
        """What the head stares past in the study's condition without gaze: a surface, or else whatever there is."""
        entities = self._world.entities if self._world else ()
        surfaces = [entity.id for entity in entities if entity.kind == "surface"]
        return next(iter([*surfaces, *(entity.id for entity in entities)]), "")
