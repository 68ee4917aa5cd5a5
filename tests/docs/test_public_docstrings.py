"""What the public names say of themselves: each parameter and field, units, and which errors come out of them."""

import ast
import builtins
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from msgspec import Struct

import engage_hri
from engage_hri.schemas import faults
from engage_hri.schemas.faults import EngageError
from engage_hri.services.client import feeds, inputs, orders, performing, robot
from engage_hri.services.control.contract import body

Function = ast.FunctionDef | ast.AsyncFunctionDef
BESIDE = (feeds.Feed, feeds.EventFeed, body.BodyState, body.Spoke, body.BodyFailed)
"""What public names return or expect, and who uses them has in the hand."""
THINGS = {each.__name__: each for each in (*(getattr(engage_hri, name) for name in engage_hri.__all__), *BESIDE)}
STRUCTS = {name: thing for name, thing in THINGS.items() if isinstance(thing, type) and issubclass(thing, Struct)}
UNIT = re.compile(r"\b(seconds|metres|meters|radians|degrees|m/s|loop times?|how many|words|count|characters|line)\b")
"""What says of a bare number what it counts or measures; so does a range, such as 0..1."""
RANGE = re.compile(r"\d\.\.\d|[([]\d, \d[)\]]|>= 0|from 1")
SENTENCE = re.compile(r"[A-Z]\w* .*\.", re.DOTALL)
RAISED = re.compile(r"^    (\w+): ", re.MULTILINE)
CALLS_INTO = (robot, performing, orders, inputs, feeds, body)
"""Files whose functions the public ones call."""


class Public(NamedTuple):
    """A function or method of the public names. owner: its class."""

    name: str
    node: Function
    owner: str

    @property
    def doc(self) -> str:
        """What it says of itself, or what it inherits from the method that it overrides."""
        method = getattr(THINGS[self.owner], self.node.name) if self.owner else None
        return ast.get_docstring(self.node) or (inspect.getdoc(method) if method is not None else "") or ""


def functions() -> Iterator[Public]:
    for name, thing in THINGS.items():
        (node,) = ast.parse(inspect.getsource(thing)).body
        if isinstance(node, Function):
            yield Public(name, node, "")
        else:
            assert isinstance(node, ast.ClassDef)
            for each in (*node.body, *_of_hidden(thing)):
                if isinstance(each, Function) and not each.name.startswith("_"):
                    yield Public(f"{name}.{each.name}", each, name)


def _of_hidden(thing: type) -> Iterator[ast.stmt]:
    """What a robot has of the base that performs, which is no public name."""
    if thing is robot.Robot:
        (node,) = ast.parse(inspect.getsource(performing.PerformingRobot)).body
        assert isinstance(node, ast.ClassDef)
        yield from node.body


PUBLIC = list(functions())


def parameters(node: Function) -> list[ast.arg]:
    own = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    return [each for each in (*own, *filter(None, [node.args.vararg])) if each.arg not in ("self", "cls")]


def told(doc: str, name: str) -> str:
    """What a docstring says of a parameter or field, on a line of its own or in a sentence after others."""
    found = re.search(rf"(?:^|[.?] )(?:\w+, )*{name}(?:, \w+)*: (.*?)(?=\n\n|\n\w+(?:, \w+)*: |\Z)", doc, re.M | re.S)
    return found[1] if found else ""


def raises(doc: str) -> set[str]:
    part = doc.partition("Raises:\n")[2].partition("\n\n")[0]
    return set(RAISED.findall(part))


def test_public_functions_begin_with_a_sentence() -> None:
    firsts = {public.name: public.doc.split("\n\n")[0] for public in PUBLIC}

    assert not {name: first for name, first in firsts.items() if not SENTENCE.fullmatch(first)}


def test_each_parameter_is_told_of() -> None:
    assert not [
        (public.name, each.arg)
        for public in PUBLIC
        for each in parameters(public.node)
        if not told(public.doc, each.arg)
    ]


def test_a_number_has_its_unit_in_words_or_in_its_type() -> None:
    assert not [
        (public.name, each.arg)
        for public in PUBLIC
        for each in parameters(public.node)
        if _is_number(each) and not UNIT.search(told(public.doc, each.arg))
    ]


def _is_number(parameter: ast.arg) -> bool:
    kinds = set(re.findall(r"\w+", ast.unparse(parameter.annotation))) if parameter.annotation else set()
    return bool(kinds & {"float", "int", "Seconds"})


def test_each_field_is_told_of_and_each_bare_number_has_a_unit() -> None:
    for name, struct in STRUCTS.items():
        said = dict(_fields(struct))

        assert set(said) == set(struct.__struct_fields__), name
        for field, (kind, text) in said.items():
            assert text, f"nothing is said of {name}.{field}"
            if re.findall(r"\b(?:float|int)\b", kind):
                assert UNIT.search(text) or RANGE.search(text), f"{name}.{field}: {text}"


def _fields(kind: type[Struct]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Type, and what docstrings and the strings below fields say, of the struct and of what it is made of."""
    for base in kind.__mro__:
        if not issubclass(base, Struct) or base is Struct:
            continue
        (node,) = ast.parse(inspect.getsource(base)).body
        assert isinstance(node, ast.ClassDef)
        for field, below in zip(node.body, [*node.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign) and not ast.unparse(field.annotation).startswith("ClassVar"):
                name = ast.unparse(field.target)
                is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
                text = str(below.value.value) if is_text else ""  # type: ignore[union-attr]
                yield name, (ast.unparse(field.annotation), text or told(ast.get_docstring(node) or "", name))


def test_what_a_function_raises_is_said() -> None:
    """As far as its own files go: what the bus raises when it is lost, the class says once for all."""
    for public in PUBLIC:
        coming = set(_coming(public.node, public.owner, set()))

        assert coming <= raises(public.doc) | _bases(raises(public.doc)), public.name


def test_what_is_said_to_be_raised_is_an_error() -> None:
    for public in PUBLIC:
        assert raises(public.doc) or "Raises:" not in public.doc, public.name
        for name in raises(public.doc):
            kind = _error(name)
            assert isinstance(kind, type), (public.name, name)
            assert issubclass(kind, Exception), (public.name, name)


def test_the_search_for_errors_finds_those_of_others() -> None:
    """What `perform` raises, it raises through five other functions, in three files."""
    (perform,) = (each for each in PUBLIC if each.name == "Robot.perform")

    assert set(_coming(perform.node, "Robot", set())) == {"InputRefused", "PerformFailed", "RunFailed"}


def _error(name: str) -> Any:
    return next((vars(place)[name] for place in (faults, performing, body, builtins) if name in vars(place)), None)


def _bases(names: set[str]) -> set[str]:
    """A function that says the general error need not name what is one of those."""
    kinds = [kind for name in names if isinstance(kind := _error(name), type)]
    return {kind.__name__ for kind in _all_errors() if any(issubclass(kind, general) for general in kinds)}


def _all_errors(general: type[Exception] = EngageError) -> Iterator[type[Exception]]:
    for kind in general.__subclasses__():
        yield kind
        yield from _all_errors(kind)


def _coming(node: ast.AST, owner: str, seen: set[str]) -> Iterator[str]:
    """Names of our errors that it raises and does not catch, itself or in what it calls in the same files."""
    for each in _uncaught(node):
        if isinstance(each, ast.Raise) and isinstance(each.exc, ast.Call):
            name = ast.unparse(each.exc.func)
            if isinstance(kind := _error(name), type) and issubclass(kind, EngageError | ValueError):
                yield name
        if isinstance(each, ast.Call):
            called = ast.unparse(each.func)
            if called not in seen and (found := _found(called, owner)) is not None:
                seen.add(called)
                yield from _coming(found, owner, seen)


def _uncaught(node: ast.AST) -> Iterator[ast.AST]:
    """The node and all in it, but for what stands under a `try` that takes all of our errors."""
    yield node
    for field, value in ast.iter_fields(node):
        if isinstance(node, ast.Try) and field == "body" and any(map(_takes_all, node.handlers)):
            continue
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, ast.AST):
                yield from _uncaught(each)


def _takes_all(handler: ast.ExceptHandler) -> bool:
    return handler.type is not None and "EngageError" in ast.unparse(handler.type)


@cache
def _found(called: str, owner: str) -> Function | None:
    """`self._ask` in the class or a base of it, `checked` in any of the files."""
    owners = [kind.__name__ for kind in THINGS[owner].__mro__] if owner else []
    for module in CALLS_INTO:
        for node in _tree(module).body:
            if isinstance(node, Function) and node.name == called:
                return node
            if isinstance(node, ast.ClassDef) and node.name in owners and called.startswith("self."):
                for each in node.body:
                    if isinstance(each, Function) and f"self.{each.name}" == called:
                        return each
    return None


@cache
def _tree(module: ModuleType) -> ast.Module:
    return ast.parse(_source(module))


def _source(module: ModuleType) -> str:
    return Path(str(module.__file__)).read_text(encoding="utf-8")
