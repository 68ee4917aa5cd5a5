"""Frames for browsers: the newest state of what has changed since the last one that was drawn."""

import json
from typing import Any

from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.frames import HEARTBEAT, Receipts, Viewer, You
from engage_hri.services.console.web.lanes import KEPT
from engage_hri.services.console.web.picture import BLOCK, SECTIONS, Picture
from tests.console.scenes import at
from tests.console.test_picture import RUN, picture


def frame(viewer: Viewer, made: Picture, now: Seconds, **more: Any) -> Any:
    told = viewer.frame(made, now, **more)
    return None if told is None else json.loads(told)


def test_the_first_frame_has_all_and_the_next_only_what_has_changed() -> None:
    made, viewer = picture(), Viewer()
    first = frame(viewer, made, 10.0)
    assert set(first["sections"]) == set(SECTIONS)
    assert frame(viewer, made, 10.1) is None

    made.feed(HeadOwner(owner=Claim(kind="none", priority=0), since=at(10.2)), 10.2, 10.2)

    second = frame(viewer, made, 10.2)
    assert (second["now"], set(second["sections"])) == (0.2, {"head"})


def test_a_browser_that_draws_slowly_gets_the_newest_and_nothing_in_between() -> None:
    made, quick, slow = picture(), Viewer(), Viewer()
    for viewer in (quick, slow):
        frame(viewer, made, 10.0)
    times = [10.0 + step / 50 for step in range(1, 101)]
    counts = 0
    for time in times:
        made.feed(HeadOwner(owner=Claim(kind="face", priority=6, reason=f"{time:.2f}"), since=at(time)), time, time)
        counts += frame(quick, made, time) is not None

    assert counts == 100
    late = frame(slow, made, 12.0)
    assert late["sections"]["head"]["owner"]["reason"] == "12.00"
    assert frame(slow, made, 12.0) is None


def test_a_block_that_is_forgotten_is_told_as_gone() -> None:
    made, viewer = picture(*RUN), Viewer()
    frame(viewer, made, 21.0)
    made.feed(BlockProgress(block="b", progress="end", status="done", at=at(23.0), time=3.0), 23.0, 23.0)
    made.advance(24.0 + KEPT)

    assert frame(viewer, made, 24.0 + KEPT)["gone"] == [f"{BLOCK}b"]


def test_a_heartbeat_comes_when_nothing_happens_and_news_for_the_visitor_at_once() -> None:
    made, viewer = picture(), Viewer()
    frame(viewer, made, 10.0)

    assert frame(viewer, made, 10.0 + HEARTBEAT) == {"now": HEARTBEAT}
    assert frame(viewer, made, 11.1, you=You(person="ann"))["you"]["person"] == "ann"
    receipts = Receipts("here")
    receipts.tell("part", "no")
    assert frame(viewer, made, 11.2, you=You(person="ann"), receipts=receipts) == {
        "now": 1.2, "session": "here", "taken": 0, "told": [{"number": 1, "panel": "part", "text": "no"}],
    }  # fmt: skip
    receipts.confirm()
    receipts.take(1)
    assert frame(viewer, made, 11.3, you=You(person="ann"), receipts=receipts) == {"now": 1.3, "taken": 1}
