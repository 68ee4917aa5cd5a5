"""Pictures of a model in MuJoCo, without a screen: EGL, or OSMesa with `MUJOCO_GL=osmesa`.

What people read from a body is drawn with it: the cone of its gaze, the ray of its pointing.
"""

import math
import os
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import Ray
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.units import Degrees, Meters, Radians, Vector

Picture = NDArray[np.uint8]
"""Array of height x width x 3: red, green, blue."""
DISCS = 28
"""Of which a cone is made."""
GAZE_COLOR = (0.25, 0.75, 1.0)
POINTING_COLOR = (1.0, 0.35, 0.15)


class View(Struct, frozen=True, kw_only=True):
    """Place of a camera. azimuth: 180 looks at the robot from across the table."""

    at: Vector = (0.50, 0.0, 0.86)
    distance: Meters = 2.0
    azimuth: Degrees = 236.0
    elevation: Degrees = -16.0


FROM_THE_SIDE = View()
OVER_THE_SHOULDER = View(at=(0.40, 0.0, 0.86), distance=1.75, azimuth=160.0, elevation=-24.0)
FROM_ABOVE = View(at=(0.5, 0.0, 0.72), distance=1.7, azimuth=180.0, elevation=-70.0)


class Cone(Struct, frozen=True):
    """A gaze: from the eyes, so long, with this half-angle."""

    ray: Ray
    length: Meters
    half_angle: Radians = 0.1


class Beam(Struct, frozen=True):
    """A pointing: from the tip of the hand on, so long."""

    ray: Ray
    length: Meters


class Camera:
    """Takes pictures of one model. Raises RunFailed: this machine cannot draw."""

    def __init__(self, model: mujoco.MjModel, width: int = 960, height: int = 720) -> None:
        self._model = model
        self._width, self._height = width, height
        self._gl = _context(width, height)
        self._gl.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=4000)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = (1, 1, 1, 0, 0, 0)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)

    def picture(self, data: mujoco.MjData, drawn: Sequence[Cone | Beam] = (), view: View = FROM_THE_SIDE) -> Picture:
        """Take a picture of the state `data`. drawn: what is drawn over it."""
        self._gl.make_current()
        camera = mujoco.MjvCamera()
        camera.lookat[:] = view.at
        camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, data, self._options, None, camera, everything, self._scene)
        for each in drawn:
            self._draw(each)
        rect = mujoco.MjrRect(0, 0, self._width, self._height)
        mujoco.mjr_render(rect, self._scene, self._context)
        pixels = np.empty((self._height, self._width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, rect, self._context)
        return np.flipud(pixels)

    def close(self) -> None:
        """Give back what the graphics hold."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def _draw(self, what: Cone | Beam) -> None:
        axis = np.asarray(what.ray.axis)
        match what:
            case Cone(ray=ray, length=length, half_angle=half):
                for number in range(1, DISCS + 1):
                    along = length * number / DISCS
                    place = np.asarray(ray.origin) + along * axis
                    radius = max(0.004, along * math.tan(half))
                    self._disc(place, axis, radius, (*GAZE_COLOR, 0.075))
                self._rod(np.asarray(ray.origin), axis, length, 0.0025, (*GAZE_COLOR, 0.9))
            case Beam(ray=ray, length=length):
                start = np.asarray(ray.tip if ray.tip is not None else ray.origin)
                self._rod(start, axis, length, 0.0045, (*POINTING_COLOR, 0.85))
                self._disc(start + length * axis, axis, 0.02, (*POINTING_COLOR, 0.6))

    def _disc(self, place: Any, axis: Any, radius: Meters, color: tuple[float, ...]) -> None:
        frame = np.zeros(9)
        quat = np.zeros(4)
        mujoco.mju_quatZ2Vec(quat, axis)
        mujoco.mju_quat2Mat(frame, quat)
        self._add(mujoco.mjtGeom.mjGEOM_CYLINDER, np.array([radius, radius, 0.001]), np.asarray(place), frame, color)

    def _rod(self, start: Any, axis: Any, length: Meters, radius: Meters, color: tuple[float, ...]) -> None:
        geom = self._add(mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), color)
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE.value, radius, start, start + length * axis)

    def _add(self, kind: Any, size: Any, place: Any, frame: Any, color: tuple[float, ...]) -> Any:
        geom = self._scene.geoms[self._scene.ngeom]
        mujoco.mjv_initGeom(geom, kind.value, size, place, frame, np.array(color, dtype=np.float32))
        geom.emission = 0.6
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR.value
        self._scene.ngeom += 1
        return geom


def _context(width: int, height: int) -> Any:
    """A place to draw without a screen. Raises RunFailed."""
    asked = os.environ.get("MUJOCO_GL", "").lower()
    try:
        if asked == "osmesa":
            from mujoco.osmesa import GLContext
        elif asked in ("", "egl"):
            from mujoco.egl import GLContext
        else:
            from mujoco import GLContext
        return GLContext(width, height)
    except Exception as error:  # whatever a graphics library raises where it finds nothing
        advice = "install EGL (Debian: libegl1 and libgl1-mesa-dri), or OSMesa (libosmesa6) and set MUJOCO_GL=osmesa"
        reason = f"this machine cannot draw: {error or type(error).__name__}"
        raise RunFailed(Fault(reason=reason, where=f"MUJOCO_GL={asked}", advice=advice, service="control")) from error
