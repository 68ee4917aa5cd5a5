"""What a mutant is: one small change of the code that a test should notice. Pure: text in, changes out.

Kinds: `compare` (`<` becomes `<=`, `==` becomes `!=` ...), `negate` (a condition), `join` (`and`, `or`),
`arithmetic`, `constant` (a number or a truth value), `swap` (the first two arguments of a call), `remove` (a call or
an assignment that stands alone). Left alone is what no run can notice: annotations, logging, and texts for people.
"""

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

COMPARISONS = {
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="), ast.In: ("in", "not in"), ast.NotIn: ("not in", "in"), ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}  # fmt: skip
ARITHMETIC = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*")}
JOINS = {ast.And: ("and", "or"), ast.Or: ("or", "and")}
ORDERLESS = {"isinstance", "issubclass", "min", "max", "zip", "cast", "NewType", "TypeVar", "getattr", "hasattr"}
"""Calls of which two arguments that change places give the same, or nothing that runs."""


class Change(NamedTuple):
    """Bytes start to end of a file become `new`. line: of the place, from 1. statement: first line of its statement.

    alone: outside of any function, where a line runs once for all tests, when its module is imported.
    """

    kind: str
    line: int
    statement: int
    start: int
    end: int
    new: str
    alone: bool

    def applied(self, source: bytes) -> bytes:
        return source[: self.start] + self.new.encode() + source[self.end :]


def changes(source: bytes) -> list[Change]:
    """Each change of one file, in the order of the file. A swap may be no Python: `compiles` says so."""
    return sorted(_Finder(source).found(), key=lambda change: (change.start, change.end, change.kind))


def compiles(source: bytes) -> bool:
    try:
        compile(source, "mutant", "exec", dont_inherit=True)
    except SyntaxError:
        return False
    return True


class _Finder:
    def __init__(self, source: bytes) -> None:
        self._source = source
        self._starts = [0]
        for line in source.split(b"\n"):
            self._starts.append(self._starts[-1] + len(line) + 1)

    def found(self) -> Iterator[Change]:
        return self._within(ast.parse(self._source), statement=1, alone=True)

    def _within(self, node: ast.AST, *, statement: int, alone: bool) -> Iterator[Change]:
        for child in _what_runs(node):
            first = child.lineno if isinstance(child, ast.stmt) else statement
            inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and isinstance(child, ast.stmt)
            outside = alone and not inside and not isinstance(child, ast.Lambda)
            if isinstance(child, ast.expr | ast.stmt) and not self._is_for_people(child):
                for kind, start, end, new in self._of(child, alone=outside):
                    yield Change(kind, child.lineno, first, start, end, new, outside)
                yield from self._within(child, statement=first, alone=outside)
            elif not isinstance(child, ast.expr | ast.stmt):
                yield from self._within(child, statement=first, alone=outside)

    def _of(self, node: ast.AST, *, alone: bool) -> Iterator[tuple[str, int, int, str]]:
        match node:
            case ast.Compare(left, [operator], [right]):
                yield from self._between("compare", left, right, *COMPARISONS[type(operator)])
            case ast.BoolOp(operator, [left, right, *_]):
                yield from self._between("join", left, right, *JOINS[type(operator)])
            case ast.BinOp(left, operator, right) if type(operator) in ARITHMETIC:
                yield from self._between("arithmetic", left, right, *ARITHMETIC[type(operator)])
            case ast.Constant(bool(value)) if not alone:
                yield "constant", *self._span(node), str(not value)
            case ast.Constant(int(value)) if not isinstance(value, bool):
                yield "constant", *self._span(node), str(value + 1)
            case ast.Constant(float(value)):
                yield "constant", *self._span(node), repr(value * 1.3 if value else 0.5)
            case ast.Call(function, [first, second, *_]) if self._text(function).split(".")[-1] not in ORDERLESS:
                if not any(isinstance(each, ast.Starred) for each in (first, second)):
                    (start, one), (two, end) = self._span(first), self._span(second)
                    if self._text(first) != self._text(second):
                        between = self._source[one:two].decode()
                        yield "swap", start, end, self._text(second) + between + self._text(first)
        if isinstance(node, ast.If | ast.While | ast.IfExp) and not isinstance(node.test, ast.Constant):
            yield "negate", *self._span(node.test), f"(not ({self._text(node.test)}))"
        alone_standing = isinstance(node, ast.AugAssign) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call | ast.Await)
        )
        kept = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Attribute | ast.Subscript)
        if not alone and (alone_standing or kept):
            yield "remove", *self._span(node), "pass"

    def _between(
        self, kind: str, left: ast.expr, right: ast.expr, word: str, other: str
    ) -> Iterator[tuple[str, int, int, str]]:
        start, end = self._span(left)[1], self._span(right)[0]
        text = self._source[start:end].decode()
        pattern = rf"\b{word}\b".replace(" ", r"\s+") if word[0].isalpha() else re.escape(word)
        new, count = re.subn(pattern, other, text, count=1)
        if count and "#" not in text:
            yield kind, start, end, new

    def _is_for_people(self, node: ast.AST) -> bool:
        """Logging, texts put together for people, and what only a type checker reads."""
        match node:
            case ast.JoinedStr():
                return True
            case ast.Expr(ast.Call(function)):
                return bool(re.match(r"(_?log|logger|logging)\.", self._text(function)))
            case ast.If(test):
                return "TYPE_CHECKING" in self._text(test)
            case ast.Subscript(ast.Name(name)):
                return name[0].isupper()  # a type
            case ast.BinOp(ast.Constant(str()), _, _) | ast.BinOp(_, _, ast.Constant(str())):
                return True
        return False

    def _span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return (
            self._starts[node.lineno - 1] + node.col_offset,
            self._starts[node.end_lineno - 1] + node.end_col_offset,
        )

    def _text(self, node: ast.expr) -> str:
        return self._source[slice(*self._span(node))].decode()


def _what_runs(node: ast.AST) -> Iterator[ast.AST]:
    """The parts of a node without its annotations and decorators."""
    left_out = {"annotation", "returns", "decorator_list", "type_params", "bases"}
    for name, value in ast.iter_fields(node):
        if name not in left_out:
            yield from (each for each in (value if isinstance(value, list) else [value]) if isinstance(each, ast.AST))
