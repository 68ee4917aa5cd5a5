"""Actions of people and the robot for a window that comes late: events told of them before it was there. Pure."""

from msgspec.structs import replace

from engage_hri.schemas.actions import ActionBegan, OngoingActions
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import view
from engage_hri.services.console.view import Actor, Scene


def caught_up(scene: Scene, state: OngoingActions, at: Seconds) -> Scene:
    """The scene with what somebody does who was not known before; events tell of all others.

    at: local instant of the state.
    """
    if scene.actors.get(state.actor) is not None:
        return scene
    for began in state.actions:
        if isinstance(began, ActionBegan) and began.action != "speak":
            scene = view.feed(scene, began, at)
    if state.seen is False:
        return _put(scene, Actor(id=state.actor, present=False))
    return scene if scene.actors.get(state.actor) is not None else _put(scene, Actor(id=state.actor))


def _put(scene: Scene, actor: Actor) -> Scene:
    return replace(scene, actors=scene.actors.put(actor.id, actor))
