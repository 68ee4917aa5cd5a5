"""What a window keeps of a page that goes, and for how long."""

import asyncio

import pytest

from engage_hri.services.console.web.frames import Viewer
from engage_hri.services.console.web.orders import Given
from engage_hri.services.console.web.sessions import GOING, KEPT, LEAVES, OVER, RELOADED, Sessions

BROKEN = 1006


class Seated:
    """A guest with a seat. left_at: the instant at which it was given up."""

    left_at: float | None = None

    def take(self, given: Given) -> None:
        raise NotImplementedError

    async def leave(self) -> None:
        self.left_at = asyncio.get_running_loop().time()

    def frame(self, viewer: Viewer) -> bytes | None:
        raise NotImplementedError


def sessions() -> Sessions:
    return Sessions(lambda receipts, trusted: Seated(), most=9)


@pytest.mark.parametrize(("code", "after"), [(OVER, 0.0), (LEAVES, RELOADED), (GOING, RELOADED), (BROKEN, KEPT)])
async def test_a_page_that_goes_keeps_its_seat_for_a_while_unless_it_is_over(code: int, after: float) -> None:
    known, began = sessions(), asyncio.get_running_loop().time()
    page = await known.enter("", trusted=True)
    assert page is not None

    await known.part(page, page.links, code)
    await asyncio.sleep(KEPT + 1.0)

    assert isinstance(page.guest, Seated)
    assert page.guest.left_at == pytest.approx(began + after)


async def test_a_page_that_is_loaded_anew_has_its_seat_again_and_nobody_else_has_it() -> None:
    known = sessions()
    page = await known.enter("", trusted=True)
    assert page is not None
    await known.part(page, page.links, LEAVES)
    await asyncio.sleep(RELOADED - 0.1)

    others = [await known.enter("", trusted=True), await known.enter("made-up", trusted=True)]
    others.append(await known.enter(page.receipts.session, trusted=False))
    again = await known.enter(page.receipts.session, trusted=True)
    await asyncio.sleep(KEPT)

    assert again is page
    assert page not in others
    assert isinstance(page.guest, Seated)
    assert page.guest.left_at is None
