"""`engage watch`: follow a running system, as text or as JSON lines."""

from schemas import lines
from schemas.attention import HeadOwner
from schemas.faults import Fault
from schemas.feedback import BlockProgress, SyncPointProgress, WarningFeedback
from schemas.messages import Message, encode_json
from schemas.recognition import ConnectionEvent
from schemas.units import Seconds
from services.commandline.outputs import Terminal
from services.commandline.process import DONE, run_until_signal
from services.commandline.run import Where, forever, unique
from services.config import Config
from services.console.follow import Sink, following
from services.console.live import Log

WATCHED = (ConnectionEvent, BlockProgress, SyncPointProgress, WarningFeedback, HeadOwner, Fault)


def main(where: Where, json: bool) -> int:
    config = where.load()
    run_until_signal(_watch(where, config, json))
    return DONE


async def _watch(where: Where, config: Config, json: bool) -> None:
    async with await where.open(config.robot) as hub:
        bus = hub.join(unique("watch"))
        sink: Sink = as_json if json else Log(Terminal(), config.robot, bus.now())
        async with following(bus, (sink,)):
            bus.declare_alive()
            await forever()


def as_json(message: Message, at: Seconds) -> None:
    """Print one of the messages that are public; others are not for `watch`."""
    if isinstance(message, WATCHED):
        print(lines.line(message) or encode_json(message).decode(), flush=True)
