"""A source in a process of its own, by what that process answers: a film goes by the clock, a camera as it comes."""

import asyncio
from collections.abc import Callable, Sequence

import pytest

from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Stamp
from engage_hri.services.perception.child import packed_message
from engage_hri.services.perception.eyes import watching
from engage_hri.services.perception.eyes.watching import OutsideWatching, SourceEnded, SourceOpened, SourceOrder

PICTURES = [FaceLandmarks(at=Stamp("source", at), width=640, height=480) for at in (0.5, 1.25)]


@pytest.mark.parametrize(("is_live", "after"), [(False, [0.0, 0.5, 1.25]), (True, [0.0, 0.0, 0.0])])
async def test_a_film_is_told_in_its_time_and_a_camera_at_once(
    monkeypatch: pytest.MonkeyPatch, is_live: bool, after: list[float]
) -> None:
    class Child:
        def __init__(self, command: Sequence[str], take: Callable[[bytes], None], end: object) -> None:
            answers = (SourceOpened(is_live), *PICTURES, SourceEnded())
            asyncio.get_running_loop().call_soon(take, b"".join(map(packed_message, answers)))

        def write(self, data: bytes) -> None: ...

        def close(self) -> None: ...

    monkeypatch.setattr(watching, "PipedProcess", Child)
    loop = asyncio.get_running_loop()
    began = loop.time()
    told = [(loop.time() - began, each) async for each in OutsideWatching(SourceOrder("camera", None)).watch()]

    assert [at for at, _ in told] == pytest.approx(after)
    opened, *pictures = (each for _, each in told)
    assert opened is None
    ats = [each.at.seconds - (0.0 if is_live else began) for each in pictures]
    assert ats == pytest.approx([each.at.seconds for each in PICTURES])
