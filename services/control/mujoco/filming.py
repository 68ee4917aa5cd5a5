"""Contents of a film of a body: its model, and the looks, points and words that people read from it. Pure."""

import math
from collections.abc import Mapping
from pathlib import Path

import mujoco

from engage_hri.schemas.body import Ray
from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import BodyState
from engage_hri.services.control.mujoco.film import Film, Frame, check
from engage_hri.services.control.mujoco.pictures import FROM_ABOVE, FROM_THE_SIDE, OVER_THE_SHOULDER, Beam, Cone
from engage_hri.services.control.mujoco.settings import MujocoSettings

VIEWS = {"side": FROM_THE_SIDE, "shoulder": OVER_THE_SHOULDER, "above": FROM_ABOVE}
FARTHEST: Meters = 1.3
"""Length of a gaze that ends nowhere."""
TABLE_TOP: Meters = 0.72


def film_of(model: mujoco.MjModel, settings: MujocoSettings) -> Film | None:
    """A film as the settings ask for one; None: they do not. Raises InputRefused: none of this name can be made."""
    if not settings.film:
        return None
    check(Path(settings.film))
    return Film(model, settings.rate)


def finish(film: Film, settings: MujocoSettings) -> None:
    """Draw a film into its file. Raises RunFailed: this machine cannot draw."""
    film.write(Path(settings.film), view=VIEWS[settings.view], size=settings.size)


def framed(
    at: Seconds, data: mujoco.MjData, state: BodyState, said: str, world: World, targets: Mapping[str, str],
    pose: Mapping[str, float] | None = None,
) -> Frame:  # fmt: skip
    """A frame of a body. said: by others. targets: what an arm points at now, by the part. pose: of its face."""
    drawn: list[Cone | Beam] = []
    if state.gaze is not None:
        drawn.append(Cone(state.gaze, _length(state.gaze, _place(world, state.looking_at))))
    for part, ray in (("left_arm", state.left_arm), ("right_arm", state.right_arm)):
        if part in targets and ray is not None and ray.tip is not None:
            tip = Ray(origin=ray.tip, axis=ray.axis, tip=ray.tip)
            drawn.append(Beam(tip, _length(tip, _place(world, targets[part]))))
    return Frame(
        at=at, qpos=data.qpos.copy(), mocap=data.mocap_pos.copy(), pose=pose or {}, drawn=tuple(drawn),
        caption=state.speaking or said,
    )  # fmt: skip


def _place(world: World, entity: str) -> Vector | None:
    found = world.entity(entity) if entity else None
    return None if found is None else found.position


def _length(ray: Ray, target: Vector | None) -> Meters:
    """Length of a ray: to its target, or to the table."""
    if target is not None:
        return math.dist(ray.origin, target)
    down = -ray.axis[2]
    return min(FARTHEST, (ray.origin[2] - TABLE_TOP) / down) if down > 1e-3 else FARTHEST
