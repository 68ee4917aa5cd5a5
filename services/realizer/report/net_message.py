"""Net of a block as the message that tells watchers of it."""

from collections.abc import Mapping

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.nets import Fired, NetPlace, NetPlanned, NetPoint, NetSpeech, NetTransition
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.realizer.net.petri_net import Marking
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import FINISH, Point, as_told


def described(
    plan: Plan, began: Stamp, marking: Marking, fired: Mapping[int, Seconds], spelling: Spelling
) -> NetPlanned:
    """The net of a plan with its tokens. began: when the block started. fired: transitions, seconds after that.

    Points that have one name in the block's dialect are told once: in BML 1.0 a gaze's `stroke_start` is its `start`.
    """
    transitions = [
        NetTransition(
            points=tuple(dict.fromkeys(_point(point, spelling) for point in each.points or (FINISH,))),
            time=time,
        )
        for each, time in zip(plan.net.transitions, plan.schedule, strict=True)
    ]
    places = [
        NetPlace(kind=each.kind, source=each.source, target=each.target, lag=each.lag, behavior=each.behavior)
        for each in plan.net.places
    ]
    return NetPlanned(
        block=plan.block.id,
        at=began,
        transitions=tuple(transitions),
        places=tuple(places),
        marked=tokens(marking),
        fired=firings(fired),
        speeches=tuple(
            NetSpeech(behavior=as_told(each.id), text=each.text)
            for each in plan.block.behaviors
            if isinstance(each, Speech)
        ),
    )


def _point(point: Point, spelling: Spelling) -> NetPoint:
    return NetPoint(behavior=as_told(point.behavior), sync=spelling.sync(point))


def tokens(marking: Marking) -> tuple[int, ...]:
    """Numbers of the places that hold a token."""
    return tuple(number for number, content in enumerate(marking) if content)


def firings(fired: Mapping[int, Seconds]) -> tuple[Fired, ...]:
    """Transitions with their times, in the order in which they fired."""
    return tuple(Fired(transition=transition, time=time) for transition, time in fired.items())
