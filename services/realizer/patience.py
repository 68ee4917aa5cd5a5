"""How long the realizer waits for the decision of a connection event, when it must help itself."""

from collections.abc import Mapping

from schemas.behaviors import Event, Speech
from schemas.blocks import Block
from schemas.syncref import SyncRef, canonical_sync
from schemas.units import Seconds
from services.realizer.config import RealizerConfig
from services.realizer.points import Point, type_of


def event_deadline(
    event: Event, block: Block, reached: Mapping[Point, Seconds], config: RealizerConfig, *, is_heard: bool
) -> Seconds:
    """When to give the event up as failed: its limit, from the latest of its start and the anchors realised by now.

    is_heard: recognition has the request; then it is given far more time, since deciding is its business.
    """
    limit = config.limit_of(event.kind) if event.limit is None else event.limit
    anchors = (reached.get(_point(text, block)) for text in event.anchors)
    since = max(time for time in (reached[Point(event.id, "start")], *anchors) if time is not None)
    return since + limit + (config.event_patience if is_heard else config.event_grace)


def _point(text: str, block: Block) -> Point:
    ref = SyncRef.parse(text)
    behavior = next((each for each in block.behaviors if each.id == ref.behavior), None)
    if isinstance(behavior, Speech):
        ref = SyncRef.parse(text, [mark.id for mark in behavior.marks])
    sync = canonical_sync(ref.sync, type_of(behavior) if behavior else "", block.dialect)
    return Point(ref.behavior, sync)
