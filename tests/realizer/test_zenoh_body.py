"""Figure 4.4 over real sockets, with a body that only speaks the messages."""

import pytest

from tests.bus.places import ZenohPlace
from tests.realizer.puppet import bml, puppet
from tests.realizer.test_bodies import FIGURE_4_4, SEVEN

pytestmark = pytest.mark.real_time


async def test_figure_4_4_over_zenoh() -> None:
    place = ZenohPlace()
    try:
        async with puppet(hub=await place.process()) as body:
            pending = body.ask(bml(FIGURE_4_4))
            await body.do("gaze-1", *SEVEN[:4])
            body.hold("gaze-1", "relax")
            await body.do("point-1", *SEVEN[:3])
            await body.do("speech-1", "start", "end")
            body.reach("point-1", *SEVEN[3:])
            body.end("point-1")
            await body.told("gaze-1", "end")
            body.leave("gaze-1", "relax", arrived=0.0)
            body.end("gaze-1")
            await pending.outcome
            await body.until(lambda: body.course()[-1][1] == "end")
    finally:
        await place.close()

    assert body.course() == [("b", "start", ""), ("b", "end", "done")]
    assert sorted(body.points()) == sorted(
        [*(f"{id}:{sync}" for id in ("gaze-1", "point-1") for sync in SEVEN), "speech-1:start", "speech-1:end"]
    )
    assert body.progress("point-1:stroke_start").skew + body.progress("speech-1:start").skew < 0.05
    assert body.warnings() == []
