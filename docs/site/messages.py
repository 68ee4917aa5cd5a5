"""The page of all messages with their fields, read from schemas/: types, defaults, and the strings beside them."""

import ast
import inspect
import re
from textwrap import dedent
from types import ModuleType

import msgspec

from engage_hri.schemas import (
    behaviors,
    blocks,
    body,
    body_faults,
    faults,
    fragments,
    participants,
    perception,
    recognition,
    requests,
    units,
    world,
)

MODULES: tuple[ModuleType, ...] = (
    fragments, blocks, behaviors, recognition, perception, world, body, body_faults, requests,
    faults, participants, units,
)  # fmt: skip

HEAD = """\
# Messages

Each struct that travels or stands in a file, made from the code. After the name of a message stands its `type`. How
messages travel, on which keys and in what form: [protocol.md](protocol.md). All of it as one JSON Schema:
`schemas/exported/engage.json`.

"""


def page() -> str:
    return HEAD + "\n".join(_module(module) for module in MODULES)


def _linked(kind: str, page: str) -> str:
    """A type, with a link where it names one struct."""
    names = [name for name in re.findall(r"\w+", kind) if _struct_of(name)]
    return f"[`{kind}`]({page}#{anchor(names[0])})" if len(names) == 1 else f"`{kind}`"


def _struct_of(name: str) -> type[msgspec.Struct] | None:
    found = [vars(module).get(name) for module in MODULES]
    return next((kind for kind in found if isinstance(kind, type) and issubclass(kind, msgspec.Struct)), None)


def anchor(name: str) -> str:
    """Of a struct's heading on the page."""
    kind = _struct_of(name)
    assert kind is not None, name
    return name.lower() + (f"--{tag}" if (tag := _tag(kind).lower()) else "")


def _tag(kind: type[msgspec.Struct]) -> str:
    """What `type` says of it; empty for one that is only the base of others."""
    tag = str(kind.__struct_config__.tag or "")
    return "" if tag == kind.__name__ else tag


def _module(module: ModuleType) -> str:
    tree = ast.parse(inspect.getsource(module))
    title = module.__name__.rpartition(".")[2]
    parts = [f"## {title}", "", inspect.cleandoc(module.__doc__ or ""), ""]
    parts += [part for node in tree.body if isinstance(node, ast.ClassDef) for part in _struct(module, node)]
    if aliases := [
        _alias(node, following) for node, following in zip(tree.body, [*tree.body[1:], None], strict=True)
    ]:
        parts += [line for line in aliases if line]
    return "\n".join(parts).rstrip() + "\n"


def _struct(module: ModuleType, node: ast.ClassDef) -> list[str]:
    kind = getattr(module, node.name)
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        return []
    tag = _tag(kind)
    parts = [f"### {node.name}" + (f" · `{tag}`" if tag else ""), ""]
    prose, meanings = meanings_of(ast.get_docstring(node) or "", kind.__struct_fields__)
    if prose:
        parts += [prose, ""]
    if rows := field_rows(kind, meanings):
        parts += ["| field | type | default | |", "|---|---|---|---|", *rows, ""]
    bases = [base.__name__ for base in kind.__bases__ if base is not msgspec.Struct and base.__struct_fields__]
    if bases:
        parts += [f"And the fields of [`{bases[0]}`](#{anchor(bases[0])}).", ""]
    return parts


def meanings_of(text: str, fields: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """A docstring apart: prose, and what it says about fields (`name: meaning`, beginning a line or sentence)."""
    if not fields:
        return text, {}
    names = "|".join(fields)
    heading = re.compile(rf"(?:^|(?<=\. ))((?:{names})(?:, (?:{names}))*): ", re.MULTILINE)
    pieces = heading.split(text)
    found: dict[str, str] = {}
    prose = pieces[0]
    for heads, meaning in zip(pieces[1::2], pieces[2::2], strict=True):
        said, _, after = meaning.partition("\n\n")
        found |= {name: " ".join(said.split()) for name in heads.split(", ")}
        prose += after and f"\n{after}"
    return prose.strip(), found


def field_rows(owner: type, meanings: dict[str, str], page: str = "") -> list[str]:
    """page: where the types are described, if elsewhere."""
    (node,) = ast.parse(dedent(inspect.getsource(owner))).body
    assert isinstance(node, ast.ClassDef)
    rows = []
    for field, following in zip(node.body, [*node.body[1:], None], strict=True):
        is_field = isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if not is_field or field.target.id not in owner.__struct_fields__:
            continue
        kind = ast.unparse(field.annotation).replace("|", "\\|")
        default = "" if field.value is None else f"`{ast.unparse(field.value)}`"
        name = field.target.id
        meaning = " ".join(filter(None, [meanings.get(name), _said(following)])).replace("|", "\\|")
        rows.append(f"| `{name}` | {_linked(kind, page)} | {default} | {meaning} |")
    return rows


def _said(node: ast.stmt | None) -> str:
    """The string that stands below a field."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return " ".join(node.value.value.split())
    return ""


def _alias(node: ast.stmt, following: ast.stmt | None) -> str:
    """A named type of the module: `Hand = Literal[...]`."""
    if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)):
        return ""
    said = _said(following)
    return f"- `{node.targets[0].id}` = `{' '.join(ast.unparse(node.value).split())}`" + (f": {said}" if said else "")
