"""What each type of behavior is: one row for each, from which everything is derived that depends on the type.

A new type is a struct in behaviors.py and a row here. Its sync points, where it can wait, which of its points are one
instant, who performs it, what it takes the place of, its XML namespace and its spelling in BML 1.0 follow from that;
so do the contract of bodies and the table in docs/control.md. Sources: BML 1.0, chapters 3 to 10; thesis 4.1.2.
"""

from collections.abc import Mapping
from functools import cache
from typing import Literal

from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.syncref import SYNC_POINTS
from engage_hri.schemas.units import Seconds

Performer = Literal["body", "recognition", "clock"]

_ENDS = ("start", "end")
_CAMEL = {"stroke_start": "strokeStart", "stroke_end": "strokeEnd"}


class BehaviorType(Struct, frozen=True, kw_only=True):
    """One type of behavior.

    kind: its struct. points: the sync points that a body reports, in order, but for the marks of speech. holds: those
    at which it can wait for as long as it must; `start` of everything can wait, too: it is not sent until then.
    one_instant: points that always coincide. spelled: what BML 1.0 calls the points that it has a name for.
    has_stroke: a movement with a meaningful middle. lasts: having arrived, it stays until something ends it.
    performer: who carries it out. family: types of one family take each other's place. takes_over: of a part that
    another behavior uses. turns_base: it turns what a gaze returns to. is_standard: an element of BML 1.0, in its
    namespace; else in ours. nominal: seconds of each phase where no body says better.
    """

    kind: type[of.Behavior]
    points: tuple[str, ...] = _ENDS
    holds: tuple[str, ...] = ()
    one_instant: tuple[tuple[str, ...], ...] = ()
    spelled: Mapping[str, str] = field(default_factory=lambda: {"start": "start", "end": "end"})
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
        """As an XML element, and as `type` of the JSON form: `gazeShift`."""
        return str(self.kind.__struct_config__.tag)


_STROKE = BehaviorType(
    kind=of.Gesture,
    points=SYNC_POINTS,
    holds=("stroke_start", "stroke_end"),
    spelled={sync: _CAMEL.get(sync, sync) for sync in SYNC_POINTS},
    has_stroke=True,
    is_standard=True,
    nominal=(0.5, 0.1, 0.3, 0.2, 0.1, 0.6),
)
"""What has a stroke: prepared, held back before and after it, retracted."""
_ARRIVAL = BehaviorType(
    kind=of.Posture,
    points=SYNC_POINTS,
    holds=("stroke", "relax"),
    one_instant=(("ready", "stroke_start", "stroke"), ("stroke_end", "relax")),
    spelled={"start": "start", "stroke": "ready", "relax": "relax", "end": "end"},
    lasts=True,
    is_standard=True,
    nominal=(0.4, 0.0, 0.0, 0.0, 0.0, 0.4),
)
"""What arrives somewhere and stays: on target at its stroke."""
_EXPRESSION = replace(
    _ARRIVAL, kind=of.Face, family="face",
    spelled={"start": "start", "ready": "attackPeak", "relax": "relax", "end": "end"},
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
    BehaviorType(is_standard=True, kind=of.Emit, performer="clock", takes_over=False, nominal=(0.0,)),
    replace(_OURS, kind=of.Event, performer="recognition", lasts=True),
    replace(_OURS, kind=of.TurnSignal, performer="recognition", lasts=True, nominal=(0.0,)),
    replace(_OURS, kind=of.Reference),
    replace(_OURS, kind=of.Unknown),
)  # fmt: skip
"""In the order in which they are told."""
TYPES: Mapping[str, BehaviorType] = {row.name: row for row in ROWS}


def named(**features: object) -> frozenset[str]:
    """The names of all types with these features: `named(has_stroke=True)`."""
    return frozenset(
        row.name for row in ROWS if all(getattr(row, feature) == value for feature, value in features.items())
    )


def sync_points(behavior: of.Behavior) -> tuple[str, ...]:
    """The sync points of a behavior, in their order and in the draft's spelling; the marks of speech among them."""
    if isinstance(behavior, of.Speech):
        return ("start", *(mark.id for mark in sorted(behavior.marks, key=lambda mark: mark.position)), "end")
    return TYPES[str(behavior.__struct_config__.tag)].points


# -- spelling in dialects ------------------------------------------------------------------------------------------

_FROM_CAMEL = {"strokeStart": "stroke_start", "strokeEnd": "stroke_end", "attackPeak": "ready"}


def canonical_sync(name: str, type: str = "", dialect: Literal["draft", "bml-1.0"] = "draft") -> str:
    """The system's own (draft, snake_case) spelling of a sync point; marks and unknown names stay as they are.

    type: the behavior's element name. It matters in BML 1.0, where `ready` of a gaze or posture is what the
    drafts call `stroke`, and in speech, whose marks are nobody's to rename.
    """
    if type == "speech":
        return name
    if dialect == "bml-1.0" and name in (known := _canonical(type)):
        return known[name]
    return _FROM_CAMEL.get(name, name)


@cache
def _canonical(type: str) -> Mapping[str, str]:
    return {theirs: ours for ours, theirs in TYPES[type].spelled.items()} if type in TYPES else {}


def dialect_sync(name: str, type: str = "", dialect: Literal["draft", "bml-1.0"] = "draft") -> str | None:
    """The spelling that feedback uses for canonical `name`; None where the dialect does not report the point.

    The drafts report all of `SYNC_POINTS`. BML 1.0 has four for gaze and posture (start ready relax end) and
    for faces (start attackPeak relax end); all seven, in camelCase, for what has a stroke.
    """
    if dialect == "draft" or name not in SYNC_POINTS or type == "speech":
        return name
    if not type:
        return _CAMEL.get(name, name)
    return (TYPES[type].spelled if type in TYPES else _OURS.spelled).get(name)


def same_instant(name: str, type: str) -> str:
    """A point of the drafts that BML 1.0 has no name for as the one of the same instant that it has."""
    row = TYPES.get(type)
    if row is None or name in row.spelled:
        return name
    together = next((group for group in row.one_instant if name in group), ())
    return next((sync for sync in together if sync in row.spelled), name)
