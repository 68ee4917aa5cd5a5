"""Commands that a server does not take: they came on the wrong key, or from the wrong process. Pure."""

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import COMMANDS
from engage_hri.schemas.requests import Cancel, Request, is_life_of
from engage_hri.services.bus.interface import Received


def borrowed(life: str, received: Received, server: str) -> Fault | None:
    """A fault if a command names a life that is that of another process than its own; None otherwise."""
    if is_life_of(life, received.life):
        return None
    where = f"{received.key} from {received.source or 'a stranger'}"
    return Fault(reason=f"{life!r} is the life of another process; ignored", where=where, service=server)


def misplaced(request: Request, key: str) -> Fault | None:
    """A fault if this request must not be sent on this key, or has no id; None otherwise."""
    expression = keys.expression_of(key)
    expected = COMMANDS.get(expression, ())
    if request.id and (isinstance(request, expected) or (expression and isinstance(request, Cancel))):
        return None
    server, name = keys.server_of(key), type(request).__name__
    if not request.id:
        return Fault(reason=f"{name} without an id", where=key, service=server, advice="make one up: `id`")
    home = next((known for known, kinds in COMMANDS.items() if isinstance(request, kinds)), keys.cancel(server))
    takes = f"takes {' and '.join(kind.__name__ for kind in expected)}" if expected else "is no command"
    sender = key.split("/")[4:6] if expression else ["<role>", "<requester>"]
    advice = f"send it on {home.replace('*/*', '/'.join(sender))}" if home else ""
    return Fault(reason=f"{name} came on {key}, which {takes}", where=request.id, service=server, advice=advice)
