"""Records to work with, without playing anything."""

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.recognition import KindStatistics, WindowStatistics
from engage_hri.services.study.records import EyeContact, SessionRecord


def kind(
    name: EventKind, succeeded: int, failed: int = 0, delay: float | None = None, failed_delay: float | None = None
) -> KindStatistics:
    """All delays alike."""
    return KindStatistics(
        kind=name, count=succeeded + failed, succeeded=succeeded, failed=failed,
        delay_min=delay, delay_mean=delay, delay_max=delay,
        failed_delay_min=failed_delay, failed_delay_mean=failed_delay, failed_delay_max=failed_delay,
    )  # fmt: skip


def session(
    condition: str,
    number: int,
    *kinds: KindStatistics,
    completion: float | None = None,
    pairs: float | None = None,
    face: tuple[float, float, float] | None = None,
    mtbce: float | None = None,
    reason: str = "",
) -> SessionRecord:
    eyes = None if face is None else EyeContact(first=face[0], second=face[1], last=face[2])
    return SessionRecord(
        session=number, condition=condition, seed=100 + number, finished=not reason, reason=reason, duration=160.0,
        completion_time=completion, adjacency_pairs_every=pairs, eye_contact=eyes,
        statistics=WindowStatistics(kinds=kinds, events=sum(one.count for one in kinds), mtbce=mtbce),
    )  # fmt: skip
