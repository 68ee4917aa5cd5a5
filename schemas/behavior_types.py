"""A table of the behavior types, one row for each; everything that depends on the type is derived from it.

A new type is a struct in behaviors.py and a row here. Its sync points, where it can wait, which of its points are one
instant, who performs it, what it takes the place of, its XML namespace and its spelling in BML 1.0 follow from that;
so do the contract of bodies and, by `make generate`, the table in docs/control.md.
Sources: BML 1.0, chapters 3 to 10; thesis 4.1.2.
"""

from collections.abc import Mapping
from functools import cache
from typing import Literal

from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.units import Seconds

SYNC_POINTS = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
"""Sync points of every behavior but speech, in order, in the drafts' spelling, which all code uses."""
Performer = Literal["body", "recognition", "clock"]

_ENDS = ("start", "end")
_CAMEL = {"stroke_start": "strokeStart", "stroke_end": "strokeEnd"}


class BehaviorType(Struct, frozen=True, kw_only=True):
    """One type of behavior.

    kind: the struct. points: the sync points that a body reports, in order, without the marks of speech.
    holds: the points at which a body can wait as long as it must (`start` can always wait: the body is not asked
    before). one_instant: groups of points that always coincide. bml_1_0_names: BML 1.0's names of the points that it
    knows. has_stroke: a movement with a meaningful middle. lasts: once on target it stays until something ends it.
    performer: what carries it out. family: a behavior replaces another of its family. takes_over: it gets a body part
    that another behavior uses. turns_base: it turns the direction to which a gaze returns. is_standard: its element
    is in BML's namespace; otherwise in ours. nominal: seconds of each phase, for a body that gives no estimate.
    """

    kind: type[of.Behavior]
    points: tuple[str, ...] = _ENDS
    holds: tuple[str, ...] = ()
    one_instant: tuple[tuple[str, ...], ...] = ()
    bml_1_0_names: Mapping[str, str] = field(default_factory=lambda: {"start": "start", "end": "end"})
    has_stroke: bool = False
    lasts: bool = False
    performer: Performer = "body"
    family: str = ""
    takes_over: bool = True
    turns_base: bool = False
    is_standard: bool = False
    nominal: tuple[Seconds, ...] = (0.5,)

    @property
    def name(self) -> str:
        """Name of the XML element, and `type` of the JSON form: `gazeShift`."""
        return str(self.kind.__struct_config__.tag)

    @property
    def series(self) -> str:
        """Name that is common to the types of one series: untimed behaviors of these come one after the other.

        All elements for a face are one series, for in the drafts they are one element. A shift lies beneath.
        """
        return self.family if self.family and self.lasts else self.name


_STROKE = BehaviorType(
    kind=of.Gesture,
    points=SYNC_POINTS,
    holds=("stroke_start", "stroke_end"),
    bml_1_0_names={sync: _CAMEL.get(sync, sync) for sync in SYNC_POINTS},
    has_stroke=True,
    is_standard=True,
    nominal=(0.5, 0.1, 0.3, 0.2, 0.1, 0.6),
)
"""Template of the types with a stroke: prepared, held before and after the stroke, retracted."""
_ARRIVAL = BehaviorType(
    kind=of.Posture,
    points=SYNC_POINTS,
    holds=("stroke", "relax"),
    one_instant=(("ready", "stroke_start", "stroke"), ("stroke_end", "relax")),
    bml_1_0_names={"start": "start", "stroke": "ready", "relax": "relax", "end": "end"},
    lasts=True,
    is_standard=True,
    nominal=(0.4, 0.0, 0.0, 0.0, 0.0, 0.4),
)
"""Template of the types that arrive somewhere and stay: on target at `stroke`."""
_EXPRESSION = replace(
    _ARRIVAL, kind=of.Face, family="face",
    bml_1_0_names={"start": "start", "ready": "attackPeak", "relax": "relax", "end": "end"},
)  # fmt: skip
_OURS = BehaviorType(kind=of.Unknown, performer="clock", takes_over=False)

ROWS = (
    replace(
        _ARRIVAL, kind=of.Gaze, family="gaze", nominal=(0.0, 0.0, 0.4, 0.0, 0.0, 0.4),
        one_instant=(("start", "ready", "stroke_start"), ("stroke_end", "relax")),
    ),
    BehaviorType(is_standard=True, kind=of.GazeShift, family="gaze", turns_base=True),
    BehaviorType(is_standard=True, kind=of.HeadDirectionShift, family="gaze", turns_base=True),
    replace(_STROKE, kind=of.Pointing),
    _STROKE,
    replace(_STROKE, kind=of.Head),
    _EXPRESSION,
    replace(_EXPRESSION, kind=of.FaceLexeme),
    replace(_EXPRESSION, kind=of.FaceFacs),
    BehaviorType(is_standard=True, kind=of.FaceShift, family="face"),
    replace(_ARRIVAL, family="posture"),
    BehaviorType(is_standard=True, kind=of.PostureShift, family="posture"),
    BehaviorType(is_standard=True, kind=of.Pose, family="posture"),
    BehaviorType(is_standard=True, kind=of.Locomotion, takes_over=False),
    BehaviorType(is_standard=True, kind=of.Speech),
    BehaviorType(is_standard=True, kind=of.Wait, holds=("end",), performer="clock", takes_over=False),
    BehaviorType(
        is_standard=True, kind=of.Emit, holds=("end",), performer="clock", takes_over=False, nominal=(0.0,),
    ),
    replace(_OURS, kind=of.Event, performer="recognition", lasts=True),
    replace(_OURS, kind=of.TurnSignal, performer="recognition", lasts=True, nominal=(0.0,)),
    replace(_OURS, kind=of.Reference),
    replace(_OURS, kind=of.Unknown),
)  # fmt: skip
"""All types, in the order of the table in docs/control.md."""
TYPES: Mapping[str, BehaviorType] = {row.name: row for row in ROWS}
SERIES: Mapping[str, str] = {row.name: row.series for row in ROWS}
"""Name of the series of each type: untimed behaviors of one come one after the other."""


def types_with(**features: object) -> frozenset[str]:
    """Names of all types with these features: `types_with(has_stroke=True)`."""
    return frozenset(
        row.name for row in ROWS if all(getattr(row, feature) == value for feature, value in features.items())
    )


def sync_points(behavior: of.Behavior) -> tuple[str, ...]:
    """List the sync points of a behavior in order, in the drafts' spelling, with the marks of speech."""
    if isinstance(behavior, of.Speech):
        return ("start", *(mark.id for mark in sorted(behavior.marks, key=lambda mark: mark.position)), "end")
    return TYPES[str(behavior.__struct_config__.tag)].points


# -- spelling in dialects ------------------------------------------------------------------------------------------

_PEAK = "attackPeak"
_FROM_CAMEL = {"strokeStart": "stroke_start", "strokeEnd": "stroke_end", _PEAK: "ready"}


def canonical_sync(name: str, type: str = "", dialect: Literal["draft", "bml-1.0"] = "draft") -> str:
    """Translate the name of a sync point to the drafts' spelling, used by all code: `strokeStart` -> `stroke_start`.

    Marks and unknown names stay as they are. type: the behavior's element name. In BML 1.0 `ready` of a gaze or a
    posture is what the drafts call `stroke`; all names of a speech but `start` and `end` are marks.
    """
    if type == "speech":
        return name
    if dialect == "bml-1.0" and name in (known := _from_bml_1_0(type)):
        return known[name]
    if name == _PEAK and type in TYPES and name not in TYPES[type].bml_1_0_names.values():
        return name  # A gesture has none.
    return _FROM_CAMEL.get(name, name)


@cache
def _from_bml_1_0(type: str) -> Mapping[str, str]:
    return {theirs: ours for ours, theirs in TYPES[type].bml_1_0_names.items()} if type in TYPES else {}


def dialect_sync(name: str, type: str = "", dialect: Literal["draft", "bml-1.0"] = "draft") -> str | None:
    """Translate a sync point from the drafts' spelling to that of a dialect; None if the dialect lacks the point.

    The drafts have all of `SYNC_POINTS`. BML 1.0 has four for gaze and posture (start ready relax end) and for faces
    (start attackPeak relax end), and all seven, in camelCase, for types with a stroke.
    """
    if dialect == "draft" or name not in SYNC_POINTS or type == "speech":
        return name
    if not type:
        return _CAMEL.get(name, name)
    return TYPES.get(type, _OURS).bml_1_0_names.get(name)


def same_instant(name: str, type: str) -> str:
    """Find a point with a name in BML 1.0 that always coincides with `name`: `stroke_start` of a gaze is its `start`.

    `name` itself if it has a name there, or no such point exists.
    """
    row = TYPES.get(type)
    if row is None or name in row.bml_1_0_names:
        return name
    together = next((group for group in row.one_instant if name in group), ())
    return next((sync for sync in together if sync in row.bml_1_0_names), name)
