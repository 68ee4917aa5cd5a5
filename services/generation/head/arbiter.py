"""Arbiter of the robot's head: claims by priority, one owner at a time. Thesis 3.3.4.

The claims are those of the policies, in the order of `policies.py`. A higher claim takes over at once; when the
owner lets go the head stays for a dwell before a lower claim gets it. From a face that it has just gone to it goes
to another one by a higher claim only: whoever answers is looked at at once, though the head has just gone on to
another one of those who may answer, and of several who speak and look none draws it away from the other.

Policies move the base gaze by `gazeShift` blocks, which end on arrival and hold nothing. A fragment's own gaze lies
over the base gaze: while it owns the head no shift is sent, with two exceptions. While that gaze is on a face the
base gaze goes there, too, unseen: at the end of a turn the head must not fall back to where it was before. And when
an inhibition that holds the head has that gaze aborted, the base gaze goes to its target: else the head would go
home.
"""

from collections.abc import Mapping
from math import inf

from msgspec import Struct

from engage_hri.schemas.behaviors import (
    After,
    Constraint,
    Event,
    GazeShift,
    Head,
    PostureShift,
    Speech,
    Timing,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.documents.prosody import marked_up
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import Statistics
from engage_hri.schemas.units import Degrees, Probability, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Acquaintances
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.followed import Followed, arranged, checked
from engage_hri.services.generation.head.orders import FragmentPolicy, InhibitionPolicy
from engage_hri.services.generation.head.policies import OWN
from engage_hri.services.generation.head.policy import HeadPolicy, RobotSign, TrunkTurn
from engage_hri.services.generation.head.scene import NOBODY, HeadScene, Observation
from engage_hri.services.generation.inhibitions import Inhibition
from engage_hri.services.generation.turns.continuation import Continuation
from engage_hri.services.reports.same_people import joined

DWELL: Seconds = 0.3
"""Time that the head stays after its owner let go, before a lower claim gets it: a claim that comes back at once
finds it there. Ours."""
LEAST_FIXATION: Seconds = 0.3
"""Time for which a look at anything lasts at least, from when the eyes rest there, before a claim from glance down
takes the head elsewhere: below it nobody has seen anything, and people's eyes take so long to react. In people's talk
4 to 7 % of fixations are shorter."""
ON_THE_WAY: Seconds = 2.0
"""Time after which a look counts as over of which nobody has told that it arrived: a body may be held up. Ours."""
LEAST_LOOK: Seconds = 0.8
"""Time for which a look at a face lasts at least before a claim that is no higher takes the head to another face: of
several people who speak and look, the claims change faster than a head may. People's looks at who speaks last about a
second. Ours."""
RETRY: Seconds = 1.0
"""Pause before a gaze shift that failed is tried again, so that a body that cannot is not asked
all the time. Ours."""
NOD: Probability = 0.3
"""How large a nod is that says no more than that the robot listens: less than an answer's. Ours."""
CONTINUER_PITCH = "high"
"""How a listener's word is said: higher than words elsewhere, and as loud as they are (`continuer_policy.py`)."""
UP_RIGHT: Degrees = 60.0
"""Angle past the table: as far as the neck turns, at nothing that anybody could mean. Thesis 5.3."""


class Aim(Struct, frozen=True):
    """A place for the base gaze. target: "": leave it where it is. beside: past the target, to the upper right."""

    target: str = ""
    beside: bool = False


NOWHERE = Aim()


class Shift(Struct, frozen=True):
    """An order to move the base gaze to `target`. glance: announce an optional mutual facial gaze with it.

    beside: look past the target, to the upper right. turn: with the trunk; of no target that turns back ahead.
    """

    id: str
    target: str
    glance: bool = False
    beside: bool = False
    turn: bool = False

    @property
    def block(self) -> Block:
        if self.turn and not self.target:
            return Block(id=self.id, behaviors=(PostureShift(id="shift"),))
        shift = GazeShift(id="shift", target=self.target, influence="WAIST" if self.turn else "")
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
            anchors=("shift:end",),
            timing=(Timing("start", "shift:start"),),
        )
        return Block(id=self.id, behaviors=(shift, event))


class SignOrder(Struct, frozen=True):
    """An order to give a person who speaks a sign. Recognition has to know of it before it sees or hears it."""

    id: str
    sign: RobotSign

    @property
    def block(self) -> Block:
        person, words = self.sign
        parts: list[Head | Speech] = [Head(id="nod", lexeme="NOD", amount=NOD)]
        if words:
            markup = marked_up(words, (), 0, len(words), pitch=CONTINUER_PITCH)
            parts.insert(0, Speech(id="words", text=words, markup=markup))
        event = Event(
            id="backchannel", kind="backchannel", responder=person, cause="maintenance", needs=(parts[0].id,)
        )
        starts = tuple(f"{each.id}:start" for each in parts)
        first = Constraint(id="first", operators=(After(ref="backchannel:start", syncs=starts),))
        return Block(id=self.id, behaviors=(event, *parts), constraints=(first,))


class Ruling(Struct, frozen=True):
    """The owner of the head. changed: owner or waiting claims differ from the last ruling, so it is published."""

    owner: Claim
    since: Seconds
    waiting: tuple[Claim, ...]
    changed: bool
    shift: Shift | None = None
    sign: SignOrder | None = None


class Arbiter:
    """The policies and the owner of the head. `feed` it what happens; `rule` then, and when `deadline` has come.

    policies: of installed packages, beside ours. One that raises is dropped: the head goes on without it.
    """

    def __init__(self, robot: str, config: GenerationConfig, policies: Mapping[str, type[HeadPolicy]] = {}) -> None:
        self._config = config
        self._scene = scene = HeadScene(robot, config.gaze_half_angle or 0.1)
        self._orders = InhibitionPolicy(scene, config)
        self._fragments = FragmentPolicy(scene, config)
        ordered = {InhibitionPolicy: self._orders, FragmentPolicy: self._fragments}
        followed: list[HeadPolicy] = []
        kinds: dict[str, int] = {}
        for name, each in arranged(OWN, policies, config.policies_off).items():
            policy = ordered.get(each) or each(scene, config)
            policy.name, policy.kind = name, policy.kind or name
            policy.priority = kinds.setdefault(policy.kind, len(kinds) + 1)
            followed.append(policy)
        self.policies = Followed(followed)
        self._people = Acquaintances()
        self._ruled: Seconds = -inf
        """Time of the last ruling."""
        self._since: Seconds = 0.0
        self._waiting: tuple[Claim, ...] | None = None
        """Claims without the head; None before the first ruling, so that this counts as changed."""
        self._lapsed: Seconds | None = None
        """Time when the owner let go, while the head still dwells on its target."""
        self._looks_since: Seconds = 0.0
        self._rests_since: Seconds | None = 0.0
        """Time since which the eyes rest on the owner's target; None: they are on their way."""
        self._stays_until: Seconds | None = None
        """Time until which the head stays on a face though another one is to be looked at."""
        self._base = NOWHERE
        """Place to which the base gaze was last sent."""
        self._held = NOWHERE
        """Target of the fragment's gaze that an inhibition with mode hold has found."""
        self._failed: tuple[Aim, Seconds] | None = None
        """Place that the last shift did not reach, and when to try it again."""
        self._turning: tuple[str, Radians] | None = None
        """The shift with which the trunk turns, and the direction to which it does."""
        self._shifts = self._signs = 0

    @property
    def _owner(self) -> Claim:
        return self._scene.owner

    # -- what happens ---------------------------------------------------------------------------------------------

    def feed(self, observation: Observation, now: Seconds) -> None:
        match observation:
            case World():
                self._people.see([person.id for person in observation.people], now)
            case Statistics(actor=actor) if actor:
                self._people.hear(actor, now)
        self._scene.feed(observation, now)
        self.policies.ask(lambda policy: policy.feed(observation, now))

    def has_body(self, body: Capabilities) -> None:
        """Take what the body can: its trunk, and its gaze cone, before which one in the configuration goes."""
        self._scene.half_angle = self._config.gaze_half_angle or body.gaze_half_angle
        self._scene.has_trunk = "torso" in body.parts

    def inhibit(self, inhibition: Inhibition | None) -> None:
        """Take the inhibition in force: that of the newest lease on gaze, if there is one."""
        self._orders.inhibition = inhibition
        if self._orders.mode != "hold":
            self._held = NOWHERE

    def fragment_gazes(self, target: str, reason: str = "") -> None:
        """Note that a gaze of a fragment has started."""
        self._fragments.gazes(target, reason)

    def fragment_shifts(self, target: str, reason: str = "") -> None:
        """Note that a fragment has started to move the base gaze."""
        self._fragments.gazes(target, reason)
        self._base = Aim(target)

    def fragment_rests(self) -> None:
        """Note that a fragment's gaze has ended and its block has not: it keeps the head, on the base gaze."""
        self._fragments.gazes(self._base.target, "until its block ends")

    def fragment_lets_go(self) -> None:
        """Note that the blocks of all fragments that moved the head have ended."""
        self._fragments.lets_go()

    def think(self, target: str) -> None:
        """Claim the head for `target` until the turn's next fragment: the robot averts its gaze to think."""
        self._fragments.think(target)

    def stop_thinking(self) -> None:
        self._fragments.think("")

    def speak_to(self, person: str) -> None:
        self._scene.partner, self._scene.waits = person, False

    def has_turn(self, has: bool) -> None:
        """Note whether the robot has a turn, which it may not have begun yet."""
        self._scene.has_turn = has

    def says(self, words: float) -> None:
        """Note how many words the fragment has that is sent now."""
        self._scene.words = words

    def wait_for_answers(self) -> None:
        """Note that the robot's turn is over: from now on those whom it has asked may answer."""
        self._scene.waits = True

    def join(self, other: str, name: str) -> None:
        """Take two ids for one person, who is called `name` from now on. The next world has nobody called `other`."""
        self._scene.join(other, name)
        self.policies.ask(lambda policy: policy.join(other, name))
        self._scene.owner = joined(self._owner, other, name)
        self._base, self._held = joined(self._base, other, name), joined(self._held, other, name)

    def shift_arrived(self, id: str, now: Seconds) -> None:
        """Note that shift `id` is at its target: a body need not tell what its eyes rest on."""
        is_beneath = self._owner.kind == FragmentPolicy.kind
        if id.rpartition("-")[2] == str(self._shifts) and self._rests_since is None and not is_beneath:
            self._rests_since = now
        if self._turning is not None and self._turning[0] == id:
            self._scene.facing, self._turning = self._turning[1], None

    def shift_failed(self, id: str, now: Seconds) -> None:
        """Note that shift `id` did not arrive: the same place is tried again after a pause, any other at once."""
        if id.rpartition("-")[2] == str(self._shifts):
            self._failed = self._base, now + RETRY
            self._base = NOWHERE
        if self._turning is not None and self._turning[0] == id:
            self._turning = None

    def body_lost(self) -> None:
        """Forget where the base gaze and the trunk are: another body may come, and look elsewhere."""
        self._base, self._turning, self._scene.facing = NOWHERE, None, 0.0

    def recognition_lost(self) -> None:
        """Drop what recognition told: the ends of its events and speeches will never come."""
        self._scene.recognition_lost()
        self.policies.ask(lambda policy: policy.recognition_lost())

    # -- what follows ---------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        asked = self.policies.ask(lambda policy: checked("deadline", policy.deadline, float | int | None))
        # What was due by the last ruling counted there: a policy that still names it would have it ruled for ever.
        due = [at for at in asked if at is not None and self._ruled < at < inf]
        due += [self._failed[1]] if self._failed else []
        if self._stays_until is not None:
            due.append(self._stays_until)
        elif self._lapsed is not None:
            due.append(self._lapsed + DWELL)
        return min(due, default=None)

    def rule(self, now: Seconds) -> Ruling:
        """Decide on the owner by now, and on the gaze shift that takes the head to its target."""
        self._ruled = now
        for person in self._people.forgotten(now):
            self._forget(person)
        claims = self._claims(now)
        before, waited = self._owner, self._waiting
        if waited is None:
            self._since = now
        self._note_rest(before, now)
        owner = self._scene.owner = self._next_owner(claims, now)
        if owner.target != before.target:
            self._looks_since, self._rests_since = now, None
        self._note_rest(owner, now)
        if owner != before:
            self._lapsed = None
            arrives = owner.kind == "inhibition" != before.kind
            if arrives and self._orders.mode == "hold" and self._fragments.gaze is not None:
                self._held = Aim(self._fragments.gaze.target)
            if (owner.kind, owner.target) != (before.kind, before.target):
                self._since = now
        state = self._scene.state
        self._scene.head_on = owner.target or (state.looking_at if state else "") or self._base.target
        self.policies.ask(lambda policy: policy.has_head(owner.kind == policy.kind, now))
        self._waiting = tuple(claim for claim in claims if claim.kind != owner.kind)
        changed = owner != before or self._waiting != waited
        shift = self._shift(now) or self._turn(now)
        return Ruling(owner, self._since, self._waiting, changed, shift, self._sign(now))

    def _note_rest(self, owner: Claim, now: Seconds) -> None:
        """Note that the eyes have come to rest on the target of `owner`, if they have."""
        state = self._scene.state
        if self._rests_since is None and (state is None or state.looking_at == owner.target):
            self._rests_since = now

    def _forget(self, person: str) -> None:
        self._scene.sight.forget(person)
        self.policies.ask(lambda policy: policy.forget(person))

    def _claims(self, now: Seconds) -> list[Claim]:
        """Claims of the policies, the strongest first, one of each kind."""
        claims: list[Claim] = []

        def ask(policy: HeadPolicy) -> None:
            claim = checked("claim", policy.claim(now, claims), Claim | None)
            if claim is not None:
                claims[:] = [claim, *(each for each in claims if each.kind != claim.kind)]

        self.policies.ask(ask)
        return claims

    def _next_owner(self, claims: list[Claim], now: Seconds) -> Claim:
        """The claim that gets the head, or still the owner while its look is too short."""
        wanted = self._strongest(claims, now)
        ends = self._least_end(wanted, now)
        is_ordered = wanted.kind in (InhibitionPolicy.kind, FragmentPolicy.kind)
        is_brief = now < ends and wanted.target != self._owner.target and not is_ordered
        self._stays_until = ends if is_brief else None
        return wanted if self._stays_until is None else self._owner

    def _least_end(self, wanted: Claim, now: Seconds) -> Seconds:
        """Time until which the look of the owner lasts at least before `wanted`."""
        if self._owner is NOBODY:
            return now
        rests = self._rests_since
        ends = self._looks_since + ON_THE_WAY if rests is None else rests + LEAST_FIXATION
        faces = {self._owner.target, wanted.target}
        is_speaker = self._owner.kind == wanted.kind and wanted.target == self._scene.listens_to
        is_stronger = wanted.priority < self._owner.priority or is_speaker
        if faces <= {*self._scene.sight.present(now)} and wanted.kind in ("response", "face") and not is_stronger:
            return max(ends, self._looks_since + LEAST_LOOK)
        return ends

    def rest(self, now: Seconds) -> Continuation:
        """The time until what the eyes rest on has been looked at for long enough; none if they are on their way."""
        rests, on = self._rests_since, self._owner.target
        return Continuation(
            eyes_on=on, seen_after=max(rests + LEAST_FIXATION - now, 0.0) if rests is not None else 0.0
        )

    def _strongest(self, claims: list[Claim], now: Seconds) -> Claim:
        best = claims[0] if claims else NOBODY
        own = next((claim for claim in claims if claim.kind == self._owner.kind), None)
        if self._owner is NOBODY or (claims and best.priority < self._owner.priority):
            return best
        if own is not None:
            self._lapsed = None
            return own
        if self._lapsed is None:
            self._lapsed = now
        return best if now >= self._lapsed + DWELL else self._owner

    def _shift(self, now: Seconds) -> Shift | None:
        """The shift to send; None while the base gaze is where it belongs, or a fragment's gaze has the head."""
        if self._failed is not None and now >= self._failed[1]:
            self._failed = None
        owner, aim = self._owner, self._aim()
        if not aim.target or aim == self._base or self._lapsed is not None:
            return None
        # Who was lost a moment ago still counts as present, so that the head stays on them; it cannot go there.
        if self._scene.sight.is_missed(aim.target):
            return None
        if self._failed is not None and aim == self._failed[0]:
            return None
        lies_over = owner.kind == "fragment" and self._fragments.gaze is not None
        if lies_over and not self._scene.sight.is_face(aim.target):
            return None
        self._base = aim
        self._shifts += 1
        cause = "response" if owner.kind == "response" else "maintenance"
        return Shift(f"{cause}-{self._shifts}", aim.target, glance=owner.kind == "glance", beside=aim.beside)

    def _turn(self, now: Seconds) -> Shift | None:
        """The shift with which the trunk turns, while the eyes rest where it turns to, or are on nobody."""
        scene = self._scene
        if self._is_ordered or self._turning is not None or self._failed is not None or not scene.has_trunk:
            return None
        turn = self.policies.first(lambda policy: checked("turn", policy.turn(now), TrunkTurn | None))
        if turn is None or (turn.person and (self._rests_since is None or self._base != Aim(turn.person))):
            return None
        self._shifts += 1
        shift = Shift(f"maintenance-{self._shifts}", turn.person, turn=True)
        self._turning = shift.id, turn.direction
        return shift

    @property
    def _is_ordered(self) -> bool:
        """True while somebody's order has the head."""
        return self._owner.kind in (InhibitionPolicy.kind, FragmentPolicy.kind)

    def _sign(self, now: Seconds) -> SignOrder | None:
        if self._is_ordered or self._scene.has_turn:
            return None
        sign = self.policies.first(lambda policy: checked("sign", policy.sign(now), RobotSign | None))
        if sign is None:
            return None
        self._scene.signed[sign.person] = now
        self._signs += 1
        return SignOrder(f"nod-{self._signs}", sign)

    def _aim(self) -> Aim:
        if self._owner.kind == "inhibition" and self._orders.mode == "hold":
            return self._held
        if self._owner.kind == "inhibition" and self._orders.mode == "stare":
            return Aim(self._scene.landmark, beside=True)
        return Aim(self._owner.target)
