"""Drawn talk, judged: what is told of its events, its floor and its interjections, beside what coders write down."""

from tests.recognition import floor_coder, interjection_coder
from tests.recognition.addressee_coder import addressed
from tests.recognition.coder import Coder, as_told, only_one_has, rounded
from tests.recognition.company_drawing import CompanyDrawing, JoinDrawing
from tests.recognition.drawing import Drawing
from tests.recognition.timeline import Timeline


def differences(seed: int) -> tuple[int, list[str]]:
    """Number of events of a drawn timeline, and what only one of recognition and the coders has."""
    return judged(Drawing(seed).timeline)


def in_company(seed: int) -> tuple[int, list[str]]:
    """Number of events of drawn company, and what only one of recognition and the coders has."""
    return judged(addressed(CompanyDrawing(seed).timeline))


def with_joins(seed: int) -> tuple[int, list[str]]:
    """Number of events of drawn company whose ids change, and what only one of recognition and the coders has."""
    return judged(addressed(JoinDrawing(seed).timeline))


def judged(timeline: Timeline) -> tuple[int, list[str]]:
    """Number of events of a timeline, and what only one of recognition and the coders has."""
    log = timeline.told()
    coded = Coder(timeline).events()
    count, differing = only_one_has(rounded(as_told(log.events)), rounded(coded))
    differing += floor_coder.judged(timeline, log.floors)
    differing += log.misnamed()
    return count, [*differing, *interjection_coder.judged(timeline, log.interjections, coded)]
