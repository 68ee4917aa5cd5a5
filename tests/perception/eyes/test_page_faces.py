"""The page's own finding of faces, in Chromium, beside that of `litert.py`: the same faces, with the same heads."""

import numpy as np
import pytest

from engage_hri.services.perception.eyes.head_pose import head
from engage_hri.services.perception.eyes.looking import Floats
from tests.console import browser
from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.fetched import MODELS, needs_eyes

needs_eyes()

from engage_hri.services.perception.eyes.sources.litert import FaceFinder  # noqa: E402
from tests.perception.eyes import page_faces  # noqa: E402
from tests.perception.eyes.cases import cases  # noqa: E402
from tests.perception.eyes.people import JUDGED, Person, Pose, drawn  # noqa: E402

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]


def ahead(points: Floats) -> Floats:
    found = head(points, 640, 480, 640.0)
    assert found is not None
    return found.ahead


def pictures() -> list[Picture]:
    """People in all poses and lights, two at once, one far away, a picture of another form, and nobody."""
    alone = [next(cases(looks, 500 + number, 0, 1)).picture for number, looks in enumerate(JUDGED[:6])]
    two = drawn([(Person(JUDGED[0]), Pose((-0.2, 0.0, 0.9), 20)), (Person(JUDGED[3]), Pose((0.2, 0.0, 1.0), -10))])
    far = drawn([(Person(JUDGED[4]), Pose((0.3, 0.0, 2.2), 10, 5))])
    tall = np.ascontiguousarray(alone[0][:, 140:471])
    return [*alone, two, far, tall, np.full((480, 640, 3), 90, np.uint8)]


async def test_the_page_finds_the_faces_that_litert_finds():
    shown = pictures()
    by_page = await page_faces.found(shown)
    by_litert = [FaceFinder(MODELS, 4).find(picture) for picture in shown]

    assert [len(each) for each in by_page] == [len(each) for each in by_litert]
    assert sum(len(each) for each in by_page) >= 8
    assert (len(by_page[-4]), len(by_page[-1])) == (2, 0)
    apart = []
    for page, litert in zip(by_page, by_litert, strict=True):
        for (points, sure), (others, as_sure) in zip(page, litert, strict=True):
            apart.append(np.degrees(np.arccos(np.clip(ahead(points) @ ahead(others), -1.0, 1.0))))
            assert np.abs(points - others)[:, :2].max() < 0.5
            assert abs(sure - as_sure) < 0.02
    print("degrees apart: mean", np.mean(apart).round(4), "most", np.max(apart).round(4))
    assert np.mean(apart) < 0.1
    assert np.max(apart) < 0.5
