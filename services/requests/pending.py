"""A request on its way, as its caller sees it: two futures, of its acceptance and of its end."""

import asyncio

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.requests import Outcome, Request


class Pending:
    """A request on its way. Both futures raise RequestRefused, or RunFailed if the server died or does not answer.

    Cancelling a future only stops waiting; `Requester.cancel` ends the request.
    """

    def __init__(self, key: str, request: Request) -> None:
        loop = asyncio.get_running_loop()
        self.key = key
        self.request = request
        self.accepted: asyncio.Future[None] = loop.create_future()
        self.outcome: asyncio.Future[Outcome] = loop.create_future()

    @property
    def server(self) -> str:
        return keys.server_of(self.key)

    def accept(self) -> None:
        if not self.accepted.done():
            self.accepted.set_result(None)

    def end(self, end: Outcome | EngageError) -> None:
        if isinstance(end, Outcome):
            self.accept()
            if not self.outcome.done():
                self.outcome.set_result(end)
            return
        for future in (self.accepted, self.outcome):
            if not future.done():
                future.set_exception(end)
                future.exception()  # marked as seen: a caller may await only one of the two
