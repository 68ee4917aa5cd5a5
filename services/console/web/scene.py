"""The scene in space: the world as perception tells it, the body, who does what, and where the robot looks. Pure.

It is seen from above as the person opposite the robot sees it: the robot is at the top, and its left is on the right.
Where somebody drops a piece in it, the piece is laid at the neighbor whose edge it nearly touches, as a hand would.

The arbiter of the head speaks of claims, of which one owns the head (`schemas/fragments.py`). Here they are told in
words that everybody understands: the target of the robot's looks, and the reason. Researchers find the terms beside.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.body import Capabilities, RobotState
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.tables import SIDES, corners, overlap, poses_touching
from engage_hri.schemas.units import Meters, Radians, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.console.view import Actor, Scene
from engage_hri.services.console.web import sections

HALF_ANGLE: Radians = 0.1
"""Half the angle of the gaze cone of a body that has not said its own."""


def section(
    scene: Scene, world: World | None, state: RobotState | None, body: Capabilities | None
) -> sections.SceneSection:
    """Everything that is seen in space. world, state, body: None: nothing was told of it yet."""
    entities = world.entities if world is not None else ()
    people = {entity.id: entity.position for entity in entities if entity.kind == "person"}
    actors = [actor.id for actor in scene.actors.values() if actor.id != scene.robot and actor.present]
    shown = tuple(_person(scene.actor(id), people.get(id)) for id in dict.fromkeys((*people, *actors)))
    edges = _frame(entities, [each.at for each in shown if each.at is not None and each.present])
    return sections.SceneSection(
        robot=scene.robot,
        body=_body(state, scene.actor(scene.robot), body) if state is not None else None,
        things=tuple(_thing(entity) for entity in entities if entity.kind != "person"),
        people=shown,
        above=sections.Above(RIGHT, DOWN, PictureEdges(*map(_short, edges))),
    )


def label(entity: Entity) -> str:
    """Name of a thing for people: its own, else its color and what it is, else its id."""
    return entity.name or " ".join(filter(None, (entity.color, entity.category or entity.shape))) or entity.id


def _thing(entity: Entity) -> sections.Thing:
    outline = [(_short(x), _short(y)) for x, y in corners(entity)]
    return sections.Thing(
        entity.id, entity.kind, _place(entity.position), _short(entity.yaw), tuple(outline), _short(entity.radius),
        entity.color, label(entity), entity.owner,
    )  # fmt: skip


def _person(actor: Actor, at: Vector | None) -> sections.PersonShown:
    def targets(action: str) -> tuple[str, ...]:
        return tuple(target for doing in actor.doing if doing.action == action for target in doing.targets)

    doing = {each.action for each in actor.doing}
    return sections.PersonShown(
        id=actor.id, at=None if at is None else _place(at), present=actor.present,
        looks=actor.look.targets if actor.look is not None else None,
        one_of=actor.look is not None and actor.look.one_of,
        points=targets("point"), acts=targets("act") or (("",) if "act" in doing else ()),
        nods="nod" if "nod" in doing else "shake" if "shake" in doing else "", speaks="speak" in doing,
    )  # fmt: skip


def _body(state: RobotState, actor: Actor, body: Capabilities | None) -> sections.BodyShown:
    arms = [
        sections.Arm(side, _place(ray.origin), _place(ray.tip or ray.origin))
        for side, ray in (("left", state.left_arm), ("right", state.right_arm))
        if ray is not None
    ]
    return sections.BodyShown(
        eyes=_place(state.gaze.origin) if state.gaze else None,
        gaze=_place(state.gaze.axis) if state.gaze else None,
        spread=_short((body.gaze_half_angle if body else HALF_ANGLE) + (state.gaze.error if state.gaze else 0.0)),
        arms=tuple(arms),
        looks_at=state.looking_at,
        points=tuple(target for doing in actor.doing if doing.action == "point" for target in doing.targets),
        speaking=state.speaking,
        joints={each.joint: _short(each.angle) for each in state.pose.joints},
    )


def _place(vector: Vector) -> Vector:
    x, y, z = vector
    return _short(x), _short(y), _short(z)


def _short(number: float) -> float:
    """A number to a tenth of a millimetre: more is not seen, and costs the way to the browser."""
    return round(number, 4)


RIGHT = (0.0, 1.0)
"""Part that the robot's x and y have in what is to the right in the picture."""
DOWN = (1.0, 0.0)
"""Part that they have in what is down in the picture."""
ROOM: Meters = 0.3
"""Room around a person, for the body and the name."""
STEP: Meters = 0.05
"""Steps of the edges, so that these stand still while somebody moves a little."""


class PictureEdges(NamedTuple):
    """Edges of the picture, in metres to the right and down from the robot."""

    left: Meters
    top: Meters
    right: Meters
    bottom: Meters


LEAST = PictureEdges(-0.62, -0.27, 0.62, 1.5)
"""What is in view at least."""


def seen(x: Meters, y: Meters) -> tuple[Meters, Meters]:
    """Place in the picture, to the right and down, of a place before the robot."""
    return (RIGHT[0] * x + RIGHT[1] * y, DOWN[0] * x + DOWN[1] * y)


def _frame(entities: Iterable[Entity], people: Iterable[Vector]) -> PictureEdges:
    """Frame with everybody and everything: a second person sits beside the table, another world may be wider.

    people: places of those who are there. entities: hands and people among them do not count.
    """
    things = [each for each in entities if each.kind not in ("hand", "person")]
    ends = [corner for each in things for corner in (corners(each) or [each.position[:2]])]
    places = [seen(x, y) for x, y in ends]
    places += [
        (right + ROOM * side, down + ROOM * front)
        for right, down in (seen(x, y) for x, y, _ in people)
        for side, front in ((-1, 0), (1, 0), (0, 1))
    ]
    steps = [(_up(-right), _up(right), _up(down)) for right, down in places]
    return PictureEdges(
        left=min([LEAST.left, *(-left for left, _, _ in steps)]),
        top=LEAST.top,
        right=max([LEAST.right, *(right for _, right, _ in steps)]),
        bottom=max([LEAST.bottom, *(down for _, _, down in steps)]),
    )


def _up(value: Meters) -> Meters:
    return math.ceil(round(value / STEP, 6)) * STEP


NEAR: Meters = 0.045
"""Distance from where a piece is dropped to where it touches another, below which it is laid there."""


def laid(world: World, thing: str, x: Meters, y: Meters) -> Entity | None:
    """The thing as it lies after it was dropped at a place of its surface; None: the world has no such object."""
    piece = world.entity(thing)
    if piece is None or piece.kind != "object":
        return None
    place: Vector = (x, y, piece.position[2])
    dropped = replace(piece, position=_on_surface(world, place))
    others = [each for each in world.objects if each.id != thing and each.footprint]
    best: tuple[float, Entity] | None = None
    for other in others if piece.footprint else ():
        for side in SIDES:
            for pose in poses_touching(dropped, other, side):
                far = math.dist((pose.x, pose.y), (x, y))
                there = replace(dropped, position=(pose.x, pose.y, place[2]), yaw=math.radians(pose.yaw))
                if (
                    far < NEAR
                    and (best is None or far < best[0])
                    and not any(overlap(there, each) for each in others)
                ):
                    best = (far, there)
    return dropped if best is None else best[1]


def _on_surface(world: World, place: Vector) -> Vector:
    """The place, or the nearest one on the surface that is at its height."""
    x, y, z = place
    for surface in world.entities:
        if surface.kind == "surface" and surface.footprint and abs(surface.position[2] - z) < 0.1:
            xs = [surface.position[0] + corner[0] for corner in surface.footprint]
            ys = [surface.position[1] + corner[1] for corner in surface.footprint]
            return (min(max(x, min(xs)), max(xs)), min(max(y, min(ys)), max(ys)), z)
    return place


WHY: dict[str, str] = {
    "inhibition": "somebody keeps its gaze there",
    "fragment": "this belongs to what it is saying",
    "glance": "nothing has passed between them for a while",
    "response": "it answers a look or a gesture",
    "hands": "this hand is moving",
    "face": "it keeps its eyes on a person while nothing else is to be seen",
    "none": "it has not seen anybody yet",
}
"""Reason by the kind of a claim, where nothing more is known."""
CLOSER: dict[tuple[str, str], str] = {
    ("fragment", "until its block ends"): "it has not finished what it is saying",
    ("fragment", "thinks"): "it thinks about what to say next",
    ("hands", "manipulates"): "this hand is moving a thing",
    ("face", "spoken with last"): "it spoke with this person last",
    ("face", "is to answer"): "an answer of this person or another is awaited",
    ("face", "nearest when it came"): "nobody else was nearer",
    ("face", "lost"): "the person there has gone",
}
"""Reason by the kind of a claim and the beginning of what the arbiter says."""
ANSWERED = {
    "directed gaze": "{} looked or pointed there",
    "mutual facial gaze": "{} looks at the robot",
    "adjacency pair": "{} spoke to the robot",
    "backchannel": "{} showed that they listen",
    "speech": "it listens to {}",
}
"""Reason of a response, by what it answers."""
KEPT = {
    "hold": "{} keeps its gaze where it is",
    "release": "{} keeps its gaze at rest",
    "target": "{} keeps its gaze there",
}
"""Reason of an inhibition, by the mode of the lease."""
SPEECH_ONLY = "speech only"


def plainly(claim: Claim, world: World) -> sections.ClaimShown:
    """A claim in plain words, with its terms."""
    return sections.ClaimShown(
        claim.kind, claim.priority, claim.target, claim.reason, _where(claim, world), _why(claim)
    )


def _where(claim: Claim, world: World) -> str:
    """Movement of the head that the claim asks for."""
    if claim.kind == "inhibition" and claim.reason.startswith(SPEECH_ONLY):
        return "look up, past everything"
    if not claim.target:
        return "look straight ahead" if claim.kind == "none" else "keep its head where it is"
    entity = world.entity(claim.target)
    if entity is None:
        return f"look at {claim.target}"
    if entity.kind == "hand" and entity.owner:
        return f"look at a hand of {entity.owner}"
    if entity.kind == "person":
        return f"look at {entity.name or entity.id}"
    return f"look at the {label(entity)}"


def _why(claim: Claim) -> str:
    begins, _, rest = claim.reason.partition(":")
    if claim.kind == "inhibition" and begins == SPEECH_ONLY:
        return "the condition of the study leaves it words alone"
    if claim.kind == "inhibition" and rest.strip() in KEPT:
        return KEPT[rest.strip()].format(begins)
    what, of, who = claim.reason.rpartition(" of ")
    if claim.kind == "response" and of and what in ANSWERED:
        return ANSWERED[what].format(who)
    return CLOSER.get((claim.kind, begins), WHY.get(claim.kind, claim.reason))
