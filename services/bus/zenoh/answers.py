"""The answering end of questions over Zenoh: decodes them, has the server answer, and replies or refuses."""

import asyncio
from collections.abc import Coroutine
from typing import Any

import zenoh

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.messages import Message, decode, in_form
from engage_hri.services.bus.answering import MOST, Answering
from engage_hri.services.bus.interface import Answer, Bus, is_asked_to_stop
from engage_hri.services.bus.zenoh.history import finish, form_asked, pack, refuse
from engage_hri.services.bus.zenoh.order import mark_of
from engage_hri.services.bus.zenoh.session import LoopBridge


class Answers:
    """All that one participant answers."""

    def __init__(self, bus: Bus, session: zenoh.Session, bridge: LoopBridge) -> None:
        self._bus = bus
        self._session = session
        self._bridge = bridge
        self._declared: list[Any] = []
        self.here = Answering(bus)
        """The same answers, for those who ask in this process."""

    def serve(self, key: str, answer: Answer, empty: Message | None) -> None:
        """See `Bus.answer`."""
        self.here.served[key] = answer
        mark = pack(mark_of(key))

        def reply(query: zenoh.Query) -> None:
            if query.attachment is not None and query.attachment.to_bytes() != mark:
                finish(query)  # it was asked on another key (`mark_of`), and will be asked again
                return
            form = "json"
            try:
                form = form_asked(query)
                asked = query.payload.to_bytes() if query.payload else b""
                question = empty if empty is not None and not asked else decode(asked, str(query.encoding))
                told = answer(question)
                if not isinstance(told, Coroutine):
                    self._reply(query, key, told, form)
                elif self.here.is_full:
                    told.close()
                    reason = f"{MOST} questions are being answered"
                    raise InputRefused(Fault(reason=reason, where=key, advice="wait for answers before you ask more"))
                else:
                    self.here.begin(self._later(query, key, told, form), key)
                    return
            except EngageError as error:
                refuse(query, error.fault, form)
            except (Exception, asyncio.CancelledError) as error:
                refuse(query, self._bus.failed(error, f"a question on {key}"), form)
            finish(query)

        self._declared.append(self._session.declare_queryable(key, self._bridge.questions(reply)))

    async def _later(self, query: zenoh.Query, key: str, told: Coroutine[Any, Any, Message], form: str) -> None:
        try:
            self._reply(query, key, await told, form)
        except EngageError as error:
            refuse(query, error.fault, form)
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop():
                raise
            refuse(query, self._bus.failed(error, f"a question on {key}"), form)
        finally:
            finish(query)

    def _reply(self, query: zenoh.Query, key: str, message: Message, form: str) -> None:
        payload, encoding = in_form(key, message, form)
        query.reply(key, payload, encoding=encoding)

    def close(self) -> None:
        self.here.end()
        for declared in reversed(self._declared):
            declared.undeclare()
