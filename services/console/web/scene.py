"""The scene in space: the world as perception tells it, the robot's body, and who does what. Pure."""

from engage_hri.schemas.body import Capabilities, RobotState
from engage_hri.schemas.units import Radians, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.console.view import Actor, Scene
from engage_hri.services.console.web import above
from engage_hri.services.console.web.sections import Above, Arm, BodyShown, PersonShown, SceneSection, Thing

HALF_ANGLE: Radians = 0.1
"""Half the angle of the gaze cone of a body that has not said its own."""


def section(scene: Scene, world: World | None, state: RobotState | None, body: Capabilities | None) -> SceneSection:
    """Everything that is seen in space. world, state, body: None: nothing was told of it yet."""
    entities = world.entities if world is not None else ()
    people = {entity.id: entity.position for entity in entities if entity.kind == "person"}
    actors = [actor.id for actor in scene.actors if actor.id != scene.robot and actor.present]
    shown = tuple(_person(scene.actor(id), people.get(id)) for id in dict.fromkeys((*people, *actors)))
    edges = above.frame(entities, [each.at for each in shown if each.at is not None and each.present])
    return SceneSection(
        robot=scene.robot,
        body=_body(state, scene.actor(scene.robot), body) if state is not None else None,
        things=tuple(_thing(entity) for entity in entities if entity.kind != "person"),
        people=shown,
        above=Above(above.RIGHT, above.DOWN, above.PictureEdges(*map(_short, edges))),
    )


def label(entity: Entity) -> str:
    """Name of a thing for people: its own, else its color and what it is, else its id."""
    return entity.name or " ".join(filter(None, (entity.color, entity.category or entity.shape))) or entity.id


def _thing(entity: Entity) -> Thing:
    outline = [(_short(x), _short(y)) for x, y in above.outline(entity)]
    return Thing(
        entity.id, entity.kind, _place(entity.position), _short(entity.yaw), tuple(outline), _short(entity.radius),
        entity.color, label(entity), entity.owner,
    )  # fmt: skip


def _person(actor: Actor, at: Vector | None) -> PersonShown:
    def targets(action: str) -> tuple[str, ...]:
        return tuple(target for doing in actor.doing if doing.action == action for target in doing.targets)

    doing = {each.action for each in actor.doing}
    return PersonShown(
        id=actor.id, at=None if at is None else _place(at), present=actor.present,
        looks=actor.look.targets if actor.look is not None else None,
        points=targets("point"), acts=targets("act") or (("",) if "act" in doing else ()),
        nods="nod" if "nod" in doing else "shake" if "shake" in doing else "", speaks="speak" in doing,
    )  # fmt: skip


def _body(state: RobotState, actor: Actor, body: Capabilities | None) -> BodyShown:
    arms = [
        Arm(side, _place(ray.origin), _place(ray.tip or ray.origin))
        for side, ray in (("left", state.left_arm), ("right", state.right_arm))
        if ray is not None
    ]
    return BodyShown(
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
