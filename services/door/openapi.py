"""Description of the door in the form of OpenAPI 3.1, made of the operations and of the structs of what travels."""

import inspect
from typing import Any, get_args

import msgspec
from msgspec import Struct, structs

from engage_hri.schemas.access import LARGEST_XML_SENT
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import MAJOR
from engage_hri.services.door.operations import OPERATIONS, TOPICS, Operation
from engage_hri.services.door.speaking import (
    AnyWritingOrder,
    TurnHeld,
    TurnOver,
    TurnResumed,
    TurnStarted,
    WordSounded,
)

SPEAKING = (*get_args(AnyWritingOrder), TurnStarted, WordSounded, TurnHeld, TurnResumed, TurnOver)
"""Structs that go over the link on which turns are written."""
REFUSALS = {
    400: "Something in it is wrong: nothing has moved.",
    401: "There is no token, or another one.",
    403: "The role of this token may not do that.",
    409: "What it names is not there yet, or not any more.",
    413: "The body is too large.",
    429: "So much is being asked already that there is no room.",
    502: "It began and failed, or its service has gone.",
    504: "Nobody has answered in time.",
}
"""What each status means that is no success."""


class DoorRefusal(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Answer to what did not succeed. fault: why. outcome: what was done of it, if it began."""

    fault: Fault
    outcome: msgspec.Raw | None = None


def document() -> dict[str, Any]:
    """Describe all operations, and in `components` every struct that is taken, given or told."""
    kinds = dict.fromkeys([DoorRefusal, *SPEAKING])
    kinds |= dict.fromkeys(kind for each in OPERATIONS for kind in (each.body, each.gives) if kind is not None)
    made, components = msgspec.json.schema_components(list(kinds), ref_template="#/components/schemas/{name}")
    for component in components.values():
        if "description" in component:
            component["description"] = inspect.cleandoc(component["description"])
    schemas = dict(zip(kinds, made, strict=True))
    paths: dict[str, dict[str, Any]] = {}
    for operation in OPERATIONS:
        paths.setdefault(operation.path, {})[operation.method.lower()] = _described(operation, schemas)
    paths["/v1/news"] = {"get": _news(schemas)}
    return {
        "openapi": "3.1.0",
        "info": {"title": "Engage: the door", "version": str(MAJOR), "description": inspect.cleandoc(_ABOUT)},
        "paths": paths,
        "security": [{"token": []}],
        "components": {
            "schemas": components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer", "description": "one for each role"}},
        },
    }


_ABOUT = """
Drives an engaged robot, and tells of it. Two WebSockets belong to it, which this form cannot describe:
`/v1/speak`, on which turns are written bit by bit (schemas BeginTurn, WriteText... and TurnStarted, WordSounded...,
TurnOver), and `/v1/news`, which tells the same as the operation of that path. Browsers give the token as `?token=`.
"""


def _described(operation: Operation, schemas: dict[type[Struct], Any]) -> dict[str, Any]:
    _, parts = msgspec.json.schema_components([operation.query], ref_template="{name}")
    fields = parts[operation.query.__name__]["properties"]
    described: dict[str, Any] = {
        "operationId": f"{operation.method.lower()}_{operation.path.removeprefix('/v1/').replace('/', '_')}",
        "summary": operation.title,
        "parameters": [
            {"name": each.name, "in": "query", "required": each.required, "schema": fields[each.name]}
            for each in structs.fields(operation.query)
        ],
        "responses": {
            "200": {"description": "done", **_json(schemas[operation.gives])},
            **{str(code): {"description": why, **_json(schemas[DoorRefusal])} for code, why in REFUSALS.items()},
        },
    }
    if operation.body is not None:
        content = _json(schemas[operation.body])["content"]
        if operation.is_document:
            content["application/xml"] = {"schema": {"type": "string", "maxLength": LARGEST_XML_SENT}}
        about = f"at most {operation.right.most} bytes"
        described["requestBody"] = {"required": True, "description": about, "content": content}
    return described


def _json(schema: Any) -> dict[str, Any]:
    return {"content": {"application/json": {"schema": schema}}}


def _news(schemas: dict[type[Struct], Any]) -> dict[str, Any]:
    only = {"type": "string", "description": f"with commas between: {', '.join(TOPICS)}; empty: all"}
    lines = {"application/x-ndjson": {"schema": {"type": "string"}}}
    return {
        "operationId": "get_news",
        "summary": "Tell news as they come: a line of JSON for each message, of the form that it has on the bus.",
        "parameters": [{"name": "only", "in": "query", "required": False, "schema": only}],
        "responses": {
            "200": {"description": "lines, without end; an empty one now and then says that it still stands",
                    "content": lines},
            **{str(code): {"description": REFUSALS[code], **_json(schemas[DoorRefusal])}
               for code in (400, 401, 403, 429)},
        },
    }  # fmt: skip
