"""Parts of a body besides its contract: faults that it plays, where it really points, and a correction of that."""

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import ClassVar

from msgspec import Struct

from engage_hri.schemas.body import BodyPose, Capabilities, Ray
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Radians, Seconds

GIVES_WAY: Seconds = 0.2
COMES_BACK: Seconds = 1.5
"""Seconds in which idle motion stops for a behavior, and in which it comes back."""


class Seen(Struct, frozen=True, kw_only=True):
    """Rays as in `BodyState`, as people and cameras see them."""

    gaze: Ray | None = None
    left_arm: Ray | None = None
    right_arm: Ray | None = None


class Idle(Struct, frozen=True, kw_only=True):
    """Motion that belongs to no behavior: breath, blinks, lips with the voice.

    added: what it adds to the angles of joints that `Body.state` tells. quick_at: loop time from which on it changes
    quickly; earlier than now: it does; inf: not in sight.
    """

    added: Mapping[str, Radians] = {}
    quick_at: Seconds = inf


class Extras:
    """The part of `Body` that no body needs to have.

    carries: the parts that stand on another one and move with it, by that part. All of them are of one driver, or the
    carrier is of none: nobody tells a driver how parts of another move.
    others_say: tells what the voices of other drivers say now; empty: nothing. Who composes the body replaces it.
    """

    capabilities: Capabilities
    carries: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    others_say: Callable[[], str] = staticmethod(lambda: "")

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        """Faults that it plays now; a real body plays none."""
        return ()

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        """Play exactly these faults from now on, in what is under way, too. By default it can play none.

        faults: each of a kind in `capabilities.faults`, with what `schemas.body_faults.KINDS` lets it have.

        Raises:
            InputRefused: it cannot play one of them, or not now. Nothing has changed.
        """
        if faults:
            reason, advice = f"this body cannot play {faults[0].kind!r}", "only simulated bodies play faults"
            raise InputRefused(Fault(reason=reason, where=faults[0].kind, advice=advice, service="control"))

    def seen(self) -> Seen | None:
        """Tell where a simulated body really looks and points, if that is not where it measures.

        None: it is as it measures; and a real body, which everybody sees.
        """
        return None

    def idle(self) -> Idle:
        """Tell what it adds by itself to the posture of `state` now. None of it is in `state`, or in an estimate."""
        return Idle()

    def ray_at(self, part: str, pose: BodyPose) -> Ray | None:
        """Tell where the gaze (`head`) or a forearm is with the joints so; None: it does not know.

        part: `head`, `left_arm` or `right_arm`. pose: angles of all its joints, radians.
        """
        return None

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        """Correct the angles of joints from now on: as told, asked for and estimated they are the true ones.

        offsets: to be added to what a joint measures, by joint.

        Raises:
            InputRefused: it corrects none, or has no such joint. By default it corrects none.
        """
        if offsets:
            reason = f"the body {self.capabilities.body} does not correct the angle of {', '.join(offsets)}"
            advice = "leave [offsets] out of the calibration; its [errors] count all the same"
            raise InputRefused(Fault(reason=reason, where="control.calibration", advice=advice, service="control"))


class Gate:
    """Share of the idle motion that is let through: it goes to 0 when something begins, and comes back after it."""

    def __init__(self, *, is_open: bool = True) -> None:
        self._since: Seconds = -inf
        self._from = float(is_open)
        self._is_open = is_open

    def share(self, t: Seconds, *, is_open: bool) -> float:
        """The share at t, of a gate that is open or closed from now on."""
        if is_open != self._is_open:
            self._from, self._since, self._is_open = self._at(t), t, is_open
        return self._at(t)

    def _at(self, t: Seconds) -> float:
        seconds = COMES_BACK if self._is_open else GIVES_WAY
        return self._from + (float(self._is_open) - self._from) * smooth((t - self._since) / seconds)


def smooth(done: float) -> float:
    """Way of a movement of least jerk, 0 to 1, when this share of its time is over."""
    x = min(max(done, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))
