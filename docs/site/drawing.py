"""A layered graph as SVG: each row of boxes below the former, arrows down, around the boxes between.

An arrow that passes rows goes through a place of its own in each, as if a narrow box stood there. Boxes are put in an
order in which few arrows cross (each at the mean of its neighbors, some rounds up and down), and then as near to the
boxes that they are joined with as the order allows.
"""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import pairwise

ROW, GAP, HEIGHT, NARROW, LETTER, WIDEST = 92.0, 22.0, 38.0, 8.0, 8.4, 5
"""CSS pixels at full size: from row to row, between boxes, of a box, of a passing arrow, of a letter.
WIDEST: boxes in a row; more are put into two."""

Box = str | tuple[str, str, int]
"""A unit by its name, or a place where an arrow passes a row."""


def svg(
    title: str,
    layers: Sequence[Sequence[str]],
    arrows: Mapping[str, Iterable[str]],
    links: Mapping[str, str] | None = None,
) -> str:
    """links: the page of a box. Arrows have to go down. Colors are those of the page around it."""
    rows = [list(part) for row in layers for part in _split(row)]
    rank = {name: number for number, row in enumerate(rows) for name in row}
    ends: dict[Box, list[Box]] = {name: [] for name in rank}
    paths = []
    grid: list[list[Box]] = [list(row) for row in rows]
    for start, targets in sorted(arrows.items()):
        for end in sorted(targets):
            passing: list[Box] = [(start, end, number) for number in range(rank[start] + 1, rank[end])]
            path = [start, *passing, end]
            for place, number in zip(passing, range(rank[start] + 1, rank[end]), strict=True):
                grid[number].append(place)
            for above, below in pairwise(path):
                ends.setdefault(above, []).append(below)
            paths.append(path)
    _order(grid, ends)
    middle = _places(grid, ends)
    return _written(title, grid, paths, middle, links or {})


def _split(row: Sequence[str]) -> list[Sequence[str]]:
    """Two rows where one would be too wide. Those of a layer do not import one another, so either may be above."""
    if len(row) <= WIDEST:
        return [row]
    half = (len(row) + 1) // 2
    return [row[:half], row[half:]]


def _joined(ends: Mapping[Box, Sequence[Box]]) -> tuple[dict[Box, list[Box]], dict[Box, list[Box]]]:
    """Of each box those below and those above."""
    above: dict[Box, list[Box]] = {}
    for start, targets in ends.items():
        for end in targets:
            above.setdefault(end, []).append(start)
    return {start: list(targets) for start, targets in ends.items()}, above


def _order(grid: list[list[Box]], ends: Mapping[Box, Sequence[Box]]) -> None:
    """Sort each row by the mean place of what its boxes are joined with; the best of some rounds stays."""
    below, above = _joined(ends)
    best, fewest = [list(row) for row in grid], _crossings(grid, below)
    for turn in range(24):
        order = range(1, len(grid)) if turn % 2 == 0 else range(len(grid) - 2, -1, -1)
        for number in order:
            other = grid[number - 1 if turn % 2 == 0 else number + 1]
            near = above if turn % 2 == 0 else below
            index = {box: place / max(1, len(other) - 1) for place, box in enumerate(other)}
            own = {box: place / max(1, len(grid[number]) - 1) for place, box in enumerate(grid[number])}

            def key(
                box: Box,
                index: Mapping[Box, float] = index,
                own: Mapping[Box, float] = own,
                near: Mapping[Box, Sequence[Box]] = near,
            ) -> float:
                found = [index[each] for each in near.get(box, ()) if each in index]
                return sum(found) / len(found) if found else own[box]

            grid[number].sort(key=key)
        if (count := _crossings(grid, below)) < fewest:
            best, fewest = [list(row) for row in grid], count
    grid[:] = best


def _crossings(grid: Sequence[Sequence[Box]], below: Mapping[Box, Sequence[Box]]) -> int:
    count = 0
    for upper, lower in pairwise(grid):
        index = {box: place for place, box in enumerate(lower)}
        lines = [(place, index[end]) for place, box in enumerate(upper) for end in below.get(box, ())]
        count += sum((a - c) * (b - d) < 0 for n, (a, b) in enumerate(lines) for c, d in lines[:n])
    return count


def _places(grid: Sequence[Sequence[Box]], ends: Mapping[Box, Sequence[Box]]) -> dict[Box, float]:
    """The middle of each box: as near to the mean of its neighbours as order and widths allow."""
    below, above = _joined(ends)
    middle = {box: _fitted(row, [0.0] * len(row))[place] for row in grid for place, box in enumerate(row)}
    for _ in range(40):
        for row in grid:
            wanted = []
            for box in row:
                near = [middle[each] for each in (*below.get(box, ()), *above.get(box, ()))]
                wanted.append(sum(near) / len(near) if near else middle[box])
            middle.update(zip(row, _fitted(row, wanted), strict=True))
    return middle


def _fitted(row: Sequence[Box], wanted: Sequence[float]) -> list[float]:
    """The places nearest to the wanted ones (least squares) with which the boxes keep their order and distance."""
    offsets = [0.0]
    for left, right in pairwise(row):
        offsets.append(offsets[-1] + (_width(left) + _width(right)) / 2 + GAP)
    groups: list[tuple[float, int]] = []
    for want, offset in zip(wanted, offsets, strict=True):
        groups.append((want - offset, 1))
        while len(groups) > 1 and groups[-2][0] > groups[-1][0]:
            (a, n), (b, m) = groups[-2:]
            groups[-2:] = [((a * n + b * m) / (n + m), n + m)]
    starts = [value for value, size in groups for _ in range(size)]
    return [start + offset for start, offset in zip(starts, offsets, strict=True)]


def _width(box: Box) -> float:
    return len(box) * LETTER + 28.0 if isinstance(box, str) else NARROW


def _written(
    title: str,
    grid: Sequence[Sequence[Box]],
    paths: Sequence[Sequence[Box]],
    middle: Mapping[Box, float],
    links: Mapping[str, str],
) -> str:
    left = min(middle[box] - _width(box) / 2 for row in grid for box in row) - 4
    width = max(middle[box] + _width(box) / 2 for row in grid for box in row) + 4 - left
    height = ROW * (len(grid) - 1) + HEIGHT + 8
    top = {box: 4 + ROW * number for number, row in enumerate(grid) for box in row}
    name = "-".join(title.lower().split()).replace("/", "-")
    lines = [
        f'<svg class="layers" role="img" viewBox="0 0 {width:.0f} {height:.0f}" style="max-width: {width:.0f}px">',
        f"<title>{escape(title)}</title>",
        f'<defs><marker id="{name}" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8"'
        ' orient="auto"><path d="M0 0 L8 4 L0 8 z"/></marker></defs>',
    ]
    for path in paths:
        places = [(middle[box] - left, top[box]) for box in path]
        lines.append(f'<path class="arrow" d="{_curve(places)}" marker-end="url(#{name})"/>')
    for box in (box for row in grid for box in row if isinstance(box, str)):
        x, y, wide = middle[box] - left, top[box], _width(box)
        shape = (
            f'<rect x="{x - wide / 2:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{HEIGHT:.0f}" rx="5"/>'
            f'<text x="{x:.1f}" y="{y + HEIGHT / 2 + 5:.1f}">{escape(box)}</text>'
        )
        lines.append(f'<a href="{escape(links[box])}">{shape}</a>' if box in links else f"<g>{shape}</g>")
    return "\n".join([*lines, "</svg>"])


def _curve(places: Sequence[tuple[float, float]]) -> str:
    """From the lower edge of the first box to the upper edge of the last; straight down past the rows between."""
    (x, y), *rest = places
    y += HEIGHT
    parts = [f"M{x:.1f} {y:.1f}"]
    for number, (end, top) in enumerate(rest, 1):
        bend = (top - y) / 2
        parts.append(f"C{x:.1f} {y + bend:.1f} {end:.1f} {top - bend:.1f} {end:.1f} {top:.1f}")
        x, y = end, top
        if number < len(rest):
            y += HEIGHT
            parts.append(f"V{y:.1f}")
    return " ".join(parts)
