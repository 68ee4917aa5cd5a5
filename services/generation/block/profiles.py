"""Timing of a chosen gesture and phrase: as in Appendix B (`check-back`), or as in Fig. 3.3 (`figure-3.3`)."""

from engage_hri.schemas.behaviors import After, Synchronize
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.block.parts import Parts
from engage_hri.services.generation.block.rewriting import Operator


def checking_back(parts: Parts, preceding: str, earlier: str, is_timed: bool, glance: str) -> list[Operator]:
    """Profile `check-back`: phrase, look and point begin together and last until the other has looked.

    preceding: the speech or phrase before this one. earlier: the last one of the turn's earlier fragments. is_timed:
    the author has said when the reference starts. glance: the last one before it. "": there is none.
    """
    gaze, point, phrase, event = parts.gaze, parts.point, parts.phrase, parts.event
    operators: list[Operator] = []
    if phrase and preceding:
        operators.append(after(f"{preceding}:end", f"{phrase}:start"))
    if gaze:
        # What the author has said of its start replaces this, but nothing begins before the fragment does.
        if words := earlier if is_timed else preceding:
            operators.append(after(f"{words}:end", f"{gaze}:start"))
        if glance:
            operators.append(after(f"{glance}:stroke", f"{gaze}:start"))
        if phrase:
            operators.append(after(f"{phrase}:end", f"{gaze}:relax"))
    if gaze and phrase and not point:
        operators.append(after(f"{gaze}:stroke", f"{phrase}:start"))
    if point:
        operators.append(after(f"{gaze}:start", f"{point}:start"))
        operators.append(after(f"{gaze}:stroke", f"{point}:stroke_start"))
        if phrase:
            operators.append(same(f"{point}:stroke_start", f"{phrase}:start"))
            operators.append(after(f"{phrase}:end", f"{point}:stroke_end"))
        operators.append(after(f"{event}:end", f"{point}:stroke_end"))
    return operators


def from_there(earlier: str, leaves: str, later: str, stays: bool) -> Operator:
    """Order that says where a look or point begins: on the target of the `earlier` one, or at home (decision 0024).

    leaves: the sync point at which the earlier leaves its target. stays: it does so no sooner than the later begins.
    """
    return same(f"{earlier}:{leaves}", f"{later}:start") if stays else after(f"{earlier}:end", f"{later}:start")


def as_in_the_figure(parts: Parts, preceding: str, earlier: str, is_timed: bool, lead: Seconds) -> list[Operator]:
    """Profile `figure-3.3`: the gaze leads by a phrase, and the point is over when the phrase begins.

    lead: seconds from the gaze on target to the stroke of the point. The other parameters: see `checking_back`.
    """
    gaze, point, phrase = parts.gaze, parts.point, parts.phrase
    operators: list[Operator] = []
    if gaze and preceding and (phrase or not is_timed):
        # An earlier fragment's words may have begun by now: the gaze is on target with them, or as soon as it can.
        follows = preceding == earlier
        relate = after if follows else same
        operators.append(relate(f"{preceding}:start", f"{gaze}:stroke"))
        if point and follows:
            operators.append(after(f"{gaze}:start", f"{point}:start"))
    if point:
        operators.append(same(f"{gaze}:stroke+{lead:g}", f"{point}:stroke_start"))
        if phrase:
            operators.append(same(f"{point}:stroke_end", f"{phrase}:start"))
    if phrase and preceding:
        operators.append(after(f"{preceding}:end", f"{phrase}:start"))
    return operators


def after(reference: str, sync: str) -> After:
    return After(ref=reference, syncs=(sync,))


def same(reference: str, sync: str) -> Synchronize:
    return Synchronize(ref=reference, syncs=(sync,))
