"""Questions over Zenoh, at both ends: asked until somebody answers, and answered in the form that is asked for.

Zenoh ends a question when nobody serves its key, and when the link to who does breaks, and says the same of both.
So one that has no answer waits until Zenoh says that its key is served, and is asked again: answers change nothing.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import Any

import zenoh

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.messages import Message, decode, in_form
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Answer, Answering, Bus
from engage_hri.services.bus.zenoh.bridge import LoopBridge
from engage_hri.services.bus.zenoh.history import finish, form_asked, pack, refuse
from engage_hri.services.bus.zenoh.order import mark_of
from engage_hri.services.bus.zenoh.peers import Peers

ASK_AGAIN: Seconds = 0.5
"""Time without an answer after which a question is asked once more."""


class QuestionEnds:
    """Questions of one participant to others, and its answers to theirs."""

    def __init__(
        self,
        bus: Bus,
        session: zenoh.Session,
        bridge: LoopBridge,
        peers: Peers,
        server: Callable[[str], Answering | None],
    ) -> None:
        """server: finds the answers of who serves a key in this process."""
        self.here = Answering(bus)
        """The same answers, for those who ask in this process."""
        self._session = session
        self._bridge = bridge
        self._peers = peers
        self._server = server
        self._loop = asyncio.get_running_loop()
        self._declared: list[Any] = []

    def close(self) -> None:
        self.here.end()
        for declared in reversed(self._declared):
            declared.undeclare()

    # -- answering ----------------------------------------------------------------------------------------------

    def serve(self, key: str, answer: Answer, empty: Message | None) -> None:
        """See `Bus.answer`."""
        self.here.served[key] = answer
        mark = pack(mark_of(key))

        def asked(query: zenoh.Query) -> None:
            if query.attachment is not None and query.attachment.to_bytes() != mark:
                finish(query)  # it was asked on another key (`mark_of`), and will be asked again
                return
            form = "json"
            try:
                with self.here.refusing(key):
                    form = form_asked(query)
                    payload = query.payload.to_bytes() if query.payload else b""
                    is_empty = empty is not None and not payload
                    told = answer(empty if is_empty else decode(payload, str(query.encoding)))  # type: ignore[arg-type]
                    if isinstance(told, Coroutine):
                        task = self.here.begin(told, key)
                        task.add_done_callback(partial(self._answered, query, key, form))
                        return
            except InputRefused as error:
                refuse(query, error.fault, form)
                finish(query)
            else:
                self._reply(query, key, lambda: told, form)

        self._declared.append(self._session.declare_queryable(key, self._bridge.questions(asked)))

    def _answered(self, query: zenoh.Query, key: str, form: str, task: "asyncio.Task[Message]") -> None:
        if self.here.is_open:
            self._reply(query, key, task.result, form)
        else:
            finish(query)

    def _reply(self, query: zenoh.Query, key: str, told: Callable[[], Message], form: str) -> None:
        try:
            with self.here.refusing(key):
                payload, encoding = in_form(key, told(), form)
                query.reply(key, payload, encoding=encoding)
        except InputRefused as error:
            refuse(query, error.fault, form)
        finish(query)

    # -- asking -------------------------------------------------------------------------------------------------

    async def query(self, key: str, message: Message, deadline: Seconds) -> Message | None:
        """Ask the server of a key; see `Bus._query`."""
        payload, encoding = in_form(key, message, "msgpack")
        told = await self._try(key, message, payload, encoding, deadline)
        if told is None:
            # There is no server, or it died meanwhile.
            async with self._served(key) as came:
                while told is None and self._loop.time() < deadline:
                    await came(deadline, ASK_AGAIN)
                    told = await self._try(key, message, payload, encoding, deadline)
        return told

    async def _try(
        self, key: str, message: Message, payload: bytes, encoding: str, deadline: Seconds
    ) -> Message | None:
        """Ask the server of this process, or any other; None if none has answered. Raises InputRefused."""
        if (server := self._server(key)) is not None:
            return await server.ask(key, message, deadline, partial(_sendable, key))
        reply = await self._ask(key, payload, encoding, deadline)
        if reply is not None and reply.ok is not None:
            return decode(reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        if reply is not None and reply.err is not None:
            raise InputRefused(_fault(reply.err.payload.to_bytes(), str(reply.err.encoding)))
        return None

    async def _ask(self, key: str, payload: bytes, encoding: str, deadline: Seconds) -> zenoh.Reply | None:
        """Ask until the first answer; None once every try has ended without one.

        The question is repeated, as a cut may swallow it; answers change nothing, so a second one does no harm.
        """
        answered: asyncio.Future[zenoh.Reply | None] = self._loop.create_future()
        going = 0

        def settle(reply: zenoh.Reply | None) -> None:
            if not answered.done():
                answered.set_result(reply)

        def replied(reply: zenoh.Reply) -> None:
            # Errors of Zenoh itself, such as a timeout, are no answer of a server.
            if reply.ok is not None or (reply.err is not None and _is_ours(str(reply.err.encoding))):
                settle(reply)

        def ended(_: Any) -> None:
            nonlocal going
            going -= 1
            if not going:
                settle(None)

        while not answered.done():
            left = deadline - self._loop.time()
            going += 1
            self._peers.ask(key, payload, replied, ended, max(left, 0.01), encoding)
            await asyncio.wait([answered], timeout=min(max(left, 0.0) + 0.1, ASK_AGAIN))
        return answered.result()

    @asynccontextmanager
    async def _served(self, key: str) -> AsyncIterator[Callable[[Seconds, Seconds], Awaitable[None]]]:
        """Watch for servers of a key. Gives what waits for one: until a deadline, or for a pause if one is there."""
        came, is_there = asyncio.Event(), False

        def changed(status: zenoh.MatchingStatus) -> None:
            nonlocal is_there
            if is_there := bool(status.matching):
                came.set()

        async def wait(deadline: Seconds, pause: Seconds) -> None:
            with suppress(TimeoutError):
                async with asyncio.timeout_at(min(deadline, self._loop.time() + pause) if is_there else deadline):
                    await came.wait()
            came.clear()

        querier = self._session.declare_querier(key)
        listener: Any = querier.declare_matching_listener(self._bridge.on_loop(changed))
        try:
            yield wait
        finally:
            listener.undeclare()
            querier.undeclare()  # type: ignore[no-untyped-call]


def _sendable(key: str, message: Message) -> Message:
    """The message, which stays in this process. Raises InputRefused if it could not leave it."""
    in_form(key, message, "msgpack")
    return message


def _is_ours(encoding: str) -> bool:
    return encoding.startswith("application/")


def _fault(payload: bytes, encoding: str) -> Fault:
    try:
        fault = decode(payload, encoding)
    except EngageError as error:
        return error.fault
    return fault if isinstance(fault, Fault) else Fault(reason=f"answered with {type(fault).__name__}")
