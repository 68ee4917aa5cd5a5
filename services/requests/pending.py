"""A request on its way, as its caller sees it: two futures, of its acceptance and of its end."""

import asyncio
from collections.abc import Callable

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.requests import Accepted, Outcome, Request
from engage_hri.schemas.units import Seconds

News = Accepted | Outcome | EngageError | None
"""News of a request: its acceptance, None if that was lost and its end has come; its end."""


class Pending:
    """A request on its way. Both futures raise RequestRefused, or RunFailed if the server died or does not answer.

    Cancelling a future only stops waiting; `Requester.cancel` ends the request.
    """

    def __init__(self, key: str, request: Request, tell: Callable[[News], None] | None = None) -> None:
        """tell: called with the acceptance and with the end, each at once: in order with what else is heard."""
        loop = asyncio.get_running_loop()
        self._tell = tell or (lambda news: None)
        self.key = key
        self.request = request
        self.accepted: asyncio.Future[Accepted | None] = loop.create_future()
        self.outcome: asyncio.Future[Outcome] = loop.create_future()

    @property
    def server(self) -> str:
        return keys.server_of(self.key)

    @property
    def within(self) -> Seconds | None:
        """Time in which the server has promised to decide (see `Accepted`); None if it has promised none so far."""
        is_known = self.accepted.done() and not self.accepted.cancelled() and self.accepted.exception() is None
        answer = self.accepted.result() if is_known else None
        return answer.within if answer is not None else None

    def accept(self, answer: Accepted | None = None) -> None:
        """Note that the server has accepted the request. answer: None if that was lost, and its end has come."""
        if not self.accepted.done():
            self.accepted.set_result(answer)
            self._tell(answer)

    def end(self, end: Outcome | EngageError) -> None:
        if isinstance(end, Outcome):
            self.accept()
            if not self.outcome.done():
                self.outcome.set_result(end)
            self._tell(end)
            return
        for future in (self.accepted, self.outcome):
            if not future.done():
                future.set_exception(end)
                future.exception()  # marked as seen: a caller may await only one of the two
        self._tell(end)
