"""Record of one request at its requester, and of one server. Pure."""

from engage_hri.schemas import keys
from engage_hri.schemas.requests import Cancel, Request, kind_of
from engage_hri.schemas.units import Seconds
from engage_hri.services.requests.asking_table import AskingState


class SentRequest:
    """One request. run: the life of the server that accepted it. sent_at: when it was sent last; None: never."""

    def __init__(self, expression: str, request: Request) -> None:
        self.expression = expression
        self.server = keys.server_of(expression)
        self.kind = kind_of(request)
        self.request = request
        self.cancel: Cancel | None = None
        self.state = AskingState.SENT
        self.run = ""
        self.sent_at: Seconds | None = None
        self.resend_after: Seconds = 0.0


class Server:
    """The requests that one server is asked to keep alive.

    period: seconds between two `KeepAlive`. soon: seconds until the one after the next.
    """

    def __init__(self, period: Seconds) -> None:
        self.kept: dict[str, SentRequest] = {}
        self.period = period
        self.soon = period
