"""Pairs of a gesture and a phrase, as far as posture does not matter: distractors, reliability, and what may win.

A reference is understood with reliability R(j, s) = 1 / (|D| + 1 / r), thesis 3.3.2: D are the other objects that it
may seem to mean, and r is the reliability of its channel, a gesture j with a phrase s.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property
from typing import get_args

import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from engage_hri.schemas.behaviors import Reference, SpeechOption
from engage_hri.schemas.body import Estimate, NoPointZone, Ray
from engage_hri.schemas.fragments import GestureChoice
from engage_hri.schemas.units import Meters, Probability, Radians, Seconds, Vector
from engage_hri.schemas.world import Entity, World, each_of
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import CURRENT_POSE, PARTS, Motions, Way

TOLERANCE = 1e-9
"""Slack of an angle or distance: an object exactly on the edge is inside, whatever the rounding."""


class Layout(Struct, frozen=True):
    """Objects as arrays, made once for all the rays they are tested against."""

    ids: tuple[str, ...]
    places: NDArray[np.float64]
    """Centres and footprint corners of all objects, (m, 3)."""
    owner: NDArray[np.intp]
    """Index of the object that each of the `places` belongs to, (m,)."""
    centres: NDArray[np.float64]
    """Centres of the objects, (n, 3)."""
    radii: NDArray[np.float64]
    """Radii of the objects, (n,)."""


def laid_out(objects: Sequence[Entity]) -> Layout:
    """Make the layout of these objects; a footprint is turned by the object's yaw."""
    places: list[Vector] = []
    owner: list[int] = []
    for index, entity in enumerate(objects):
        x, y, z = entity.position
        cos, sin = math.cos(entity.yaw), math.sin(entity.yaw)
        places.append(entity.position)
        places.extend((x + cos * u - sin * v, y + sin * u + cos * v, z) for u, v in entity.footprint)
        owner.extend([index] * (1 + len(entity.footprint)))
    return Layout(
        ids=tuple(entity.id for entity in objects),
        places=_vectors(places),
        owner=np.array(owner, dtype=np.intp),
        centres=_vectors([entity.position for entity in objects]),
        radii=np.array([entity.extent for entity in objects]),
    )


def in_gaze_cones(gazes: Sequence[Ray], half_angle: Radians, layout: Layout) -> list[frozenset[str]]:
    """Ids of the objects that have their centre or a corner of their footprint in the cone around each gaze axis.

    The angle between axis and eye-to-point decides: the same set as the ellipse the cone cuts from the table
    (decision B4). A gaze that is not known exactly has as much wider a cone.
    """
    reach = layout.places - _vectors([gaze.origin for gaze in gazes])[:, None]
    along = np.einsum("gpx,gx->gp", reach, _units(gazes))
    distance = np.sqrt(np.einsum("gpx,gpx->gp", reach, reach))
    angle_rad = np.arccos(np.clip(along / np.maximum(distance, TOLERANCE), -1.0, 1.0))
    errors = np.array([gaze.error for gaze in gazes])
    inside = (angle_rad <= half_angle + errors[:, None] + TOLERANCE) | (distance <= TOLERANCE)
    return [frozenset(layout.ids[index] for index in layout.owner[each].tolist()) for each in inside]


def in_pointing_cylinders(forearms: Sequence[Ray], radius: Meters, layout: Layout) -> list[frozenset[str]]:
    """Ids of the objects in the half-cylinder ahead of each hand, around the axis from elbow to hand (decision B5).

    An object of radius r counts when its centre is within `radius` + r of the axis. A forearm that is not known
    exactly has a cylinder that widens from the elbow on, by as much as it may be beside.
    """
    tips = [forearm.tip if forearm.tip is not None else forearm.origin for forearm in forearms]
    reach, axes = layout.centres - _vectors(tips)[:, None], _units(forearms)
    along = np.einsum("fox,fx->fo", reach, axes)
    off_axis = reach - along[..., None] * axes[:, None]
    off_axis = np.sqrt(np.einsum("fox,fox->fo", off_axis, off_axis))
    from_elbow = np.einsum("fox,fx->fo", layout.centres - _vectors([each.origin for each in forearms])[:, None], axes)
    wider = np.tan([forearm.error for forearm in forearms])[:, None] * from_elbow.clip(min=0.0)
    inside = (along >= -TOLERANCE) & (off_axis <= radius + wider + layout.radii + TOLERANCE)
    return [frozenset(layout.ids[index] for index in np.flatnonzero(each).tolist()) for each in inside]


def in_zone(place: Vector, zones: Iterable[NoPointZone]) -> bool:
    """True if the robot must not point at `place`."""
    return any(math.dist(place, zone.center) <= zone.radius for zone in zones)


def angle_off_axis(gaze: Ray, place: Vector) -> Radians:
    """Angle between the gaze axis and the direction from the eye to `place`."""
    reach = np.asarray(place) - np.asarray(gaze.origin)
    distance = float(np.linalg.norm(reach))
    if distance <= TOLERANCE:
        return 0.0
    return math.acos(max(-1.0, min(1.0, float(reach @ _units([gaze])[0]) / distance)))


def _vectors(vectors: Sequence[Vector]) -> NDArray[np.float64]:
    return np.array(vectors, dtype=np.float64).reshape(-1, 3)


def _units(rays: Sequence[Ray]) -> NDArray[np.float64]:
    axes = _vectors([ray.axis for ray in rays])
    return np.asarray(axes / np.sqrt(np.einsum("rx,rx->r", axes, axes))[:, None])


def reliability(distractors: int, channel: Probability) -> Probability:
    """Likelihood that the reference is understood: 1 / (|D| + 1/r). Thesis 3.3.2.

    distractors: |D(j, s)|, objects besides the target still possible, >= 0.
    channel: r(j, s) in [0, 1); with 0 (neither gesture nor phrase) the reliability is 0, too (decision B2).
    Raises ValueError outside.
    """
    if distractors < 0:
        raise ValueError(f"{distractors} distractors")
    if not 0 <= channel < 1:
        raise ValueError(f"channel reliability {channel} is not in [0, 1)")
    return 1 / (distractors + 1 / channel) if channel else 0.0


def channel_reliability(gesture: GestureChoice, phrase: str, config: GenerationConfig) -> Probability:
    """Channel r(j, s) of a gesture with a phrase (empty: none), as configured. Thesis 3.3.2, decision B1."""
    r_gesture = {
        "none": 0.0,
        "gaze": config.gaze_reliability,
        "directed_gaze": config.directed_gaze_reliability,
        "directed_gaze_with_pointing": config.pointing_reliability,
    }[gesture]
    r_phrase = config.phrase_reliability if phrase else 0.0
    if config.channel == "sum":
        return r_gesture + r_phrase
    return 1 - (1 - r_gesture) * (1 - r_phrase)


GESTURES: tuple[GestureChoice, ...] = get_args(GestureChoice)
"""All gestures, the set J of the thesis, from fewer movements to more."""
POINT: GestureChoice = "directed_gaze_with_pointing"
ROUNDING = 9
"""Decimals of costs and reliabilities that count: sums of the same numbers in another order are equal."""
_RANK = {gesture: number for number, gesture in enumerate(GESTURES)}


class ReferenceScene(Struct, frozen=True, kw_only=True, dict=True):
    """The objects and the limits of gestures. no_gaze, no_point: why the robot may not look or point; "": it may."""

    world: World
    half_angle: Radians
    pointing_radius: Meters
    zones: tuple[NoPointZone, ...] = ()
    no_gaze: str = ""
    no_point: str = ""

    @cached_property
    def layout(self) -> Layout:
        return laid_out(self.world.objects)

    @cached_property
    def universe(self) -> frozenset[str]:
        return frozenset(self.layout.ids)


class Pair(Struct, frozen=True, kw_only=True):
    """A gesture with a phrase, as far as posture does not matter.

    order: the place of the phrase among the reference's options. ruled_out: why it cannot be performed, or empty.
    by_look: ids of the objects that the words may mean, too, and that the look alone rules out.
    """

    gesture: GestureChoice
    order: int
    option: SpeechOption
    distractors: frozenset[str]
    by_look: frozenset[str] = frozenset()
    channel: Probability
    reliability: Probability
    ruled_out: str = ""
    is_short: bool = False
    """True if its reliability is below what is asked for."""

    @property
    def preference(self) -> tuple[bool, float, int, int]:
        """Sort key among pairs of equal cost: the least wins (decision B13)."""
        return (
            not (self.gesture == POINT and self.option.deictic), -round(self.reliability, ROUNDING),
            _RANK[self.gesture], self.order,
        )  # fmt: skip


class Shown(Struct, frozen=True):
    """Ids of the objects that a gaze, and a point, at a target may seem to mean; None: any."""

    gazed: frozenset[str] | None
    pointed: frozenset[str] | None


def shown(targets: Sequence[str], scene: ReferenceScene, motions: Motions) -> dict[str, Shown]:
    """Objects that gazes and points at the targets may seem to mean."""
    gazes, points = (
        {
            each: _widened(ray, each, scene)
            for each in targets
            if (ray := motions.known[Way(part, CURRENT_POSE, each)].ray)
        }
        for part in PARTS
    )
    cones = in_gaze_cones(list(gazes.values()), scene.half_angle, scene.layout)
    cylinders = in_pointing_cylinders(list(points.values()), scene.pointing_radius, scene.layout)
    gazed, pointed = dict(zip(gazes, cones, strict=True)), dict(zip(points, cylinders, strict=True))
    return {each: Shown(gazed.get(each), pointed.get(each)) for each in targets}


def _widened(ray: Ray, target: str, scene: ReferenceScene) -> Ray:
    """The ray of a gesture at several things, which may mean all that lies about their middle as far as they do."""
    group = scene.world.entity(target) if len(each_of(target)) > 1 else None
    if group is None:
        return ray
    return replace(ray, error=ray.error + math.atan2(group.extent, math.dist(ray.origin, group.position)))


def considered(
    reference: Reference, seems: Shown, scene: ReferenceScene, motions: Motions, config: GenerationConfig
) -> tuple[Pair, ...]:
    """The table of a reference: every pair of gesture and phrase (J x S) with its distractors and reliability.

    seems: what a gaze and a point at its target may seem to mean.
    """
    meant = {*each_of(reference.target)}
    universe = scene.universe - meant
    gazed = universe if seems.gazed is None else seems.gazed - meant
    pointed = universe if seems.pointed is None else seems.pointed - meant
    no_gaze, no_point = _obstacles(reference.target, scene, motions)
    said = [
        universe.intersection(option.distractors) if option.text and not option.deictic else universe
        for option in reference.options or ()
    ]
    minimum = minimum_of(reference, config)
    pairs = []
    for gesture in GESTURES:
        points = gesture == POINT
        obstacle = "" if gesture == "none" else no_gaze or (no_point if points else "")
        left = universe if gesture == "none" else gazed & pointed if points else gazed
        channels = {spoken: channel_reliability(gesture, spoken, config) for spoken in ("", "words")}
        for order, option in enumerate(reference.options or ()):
            channel = channels["words" if option.text else ""]
            distractors = left & said[order]
            value = reliability(len(distractors), channel)
            ruled_out = obstacle
            if option.deictic and not points:
                ruled_out = "a deictic phrase needs a point"
            elif channel == 0:
                ruled_out = "neither gesture nor phrase"
            pairs.append(
                Pair(
                    gesture=gesture,
                    order=order,
                    option=option,
                    distractors=distractors,
                    by_look=frozenset() if points or not option.text else said[order] - distractors,
                    channel=channel,
                    reliability=value,
                    ruled_out=ruled_out,
                    is_short=round(value - minimum, ROUNDING) < 0,
                )
            )
    return tuple(pairs)


class Table:
    """The pairs of a reference, and those that may win.

    minimum: the reliability that is asked for.
    """

    def __init__(self, reference: Reference, pairs: tuple[Pair, ...], config: GenerationConfig) -> None:
        self.reference = reference
        self.pairs = pairs
        self.minimum = minimum_of(reference, config)
        self._config = config
        self._left: Sequence[Pair] = [pair for pair in pairs if not pair.ruled_out]
        self._choices: list[Mapping[GestureChoice, Pair]] = []

    def candidates(self, level: int) -> Mapping[GestureChoice, Pair]:
        """The pair of each gesture that may win, whatever the posture; empty if there are none of this level.

        level: 0 for the best; each next one for what is left if the body can do none of those before it.
        """
        while level >= len(self._choices) and self._left:
            best = candidates(self._left, self._config)
            self._left = [pair for pair in self._left if pair.gesture not in best]
            self._choices.append(best)
        return self._choices[level] if level < len(self._choices) else {}


def candidates(possible: Sequence[Pair], config: GenerationConfig) -> Mapping[GestureChoice, Pair]:
    """The pair of each gesture that may win, whatever the posture: the one with the best phrase.

    Only pairs that are reliable enough count or, if there are none, the most reliable ones (decision B10). Of their
    phrases, one that leaves less to the look alone is better, whatever it costs (decision 0109).
    """
    good = [pair for pair in possible if not pair.is_short]
    if not good:
        most = max(round(pair.reliability, ROUNDING) for pair in possible)
        good = [pair for pair in possible if round(pair.reliability, ROUNDING) == most]
    best: dict[GestureChoice, Pair] = {}

    def rank(pair: Pair) -> tuple[int, Seconds, tuple[bool, float, int, int]]:
        return len(pair.by_look), round(speaking(pair, config), ROUNDING), pair.preference

    for pair in sorted(good, key=rank):
        best.setdefault(pair.gesture, pair)
    return best


def minimum_of(reference: Reference, config: GenerationConfig) -> Probability:
    """The reliability that is asked for."""
    given = reference.minimum_reliability
    return config.minimum_reliability if given is None else given


def speaking(pair: Pair, config: GenerationConfig) -> Seconds:
    """Cost of the words of a pair."""
    return config.seconds_per_word * pair.option.cost if pair.option.text else 0.0


def refusal(verb: str, motion: Estimate) -> str:
    """Reason why the body cannot make a motion; empty if it can."""
    if motion.feasible:
        return ""
    return f"cannot {verb}: {motion.fault.reason if motion.fault else 'the body refuses'}"


def deictic_warnings(references: Collection[Reference], scene: ReferenceScene) -> list[str]:
    """Warnings of deictic phrases with a list of distractors that are not all other objects (decision B8)."""
    return [
        f"{reference.id}: the distractors of the deictic {option.text!r} are everything else, not those listed"
        for reference in references
        for option in reference.options or ()
        if option.deictic
        and option.distractors
        and set(option.distractors).symmetric_difference(scene.universe) - {*each_of(reference.target)}
    ]


def _obstacles(target: str, scene: ReferenceScene, motions: Motions) -> tuple[str, str]:
    """Reasons why the robot cannot look, and cannot point, at `target`; each empty if it can (decision B9)."""
    gaze, point = motions.known[Way("head", CURRENT_POSE, target)], motions.known[Way("arm", CURRENT_POSE, target)]
    no_gaze = scene.no_gaze or refusal("look", gaze)
    no_point = scene.no_point or refusal("point", point)
    entity = scene.world.entity(target)
    if not no_point and entity is not None and in_zone(entity.position, scene.zones):
        no_point = "cannot point: in a no-point zone"
    return no_gaze, no_point
