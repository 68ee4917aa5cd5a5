"""Strongly connected components: nodes that wait for each other in a circle."""

from collections.abc import Mapping, Sequence

from engage_hri.services.runtime.steps import PORTION, Steps


def components(size: int, out: Mapping[int, Sequence[int]]) -> Steps[list[list[int]]]:
    """The strongly connected components of a graph of `size` nodes. Kosaraju, without recursion."""
    into: dict[int, list[int]] = {}
    for number, (source, targets) in enumerate(out.items()):
        for target in targets:
            into.setdefault(target, []).append(source)
        if not number % PORTION:
            yield PORTION // 2
    groups = []
    taken = bytearray(size)
    for number, root in enumerate(reversed((yield from _left(size, out)))):
        if not number % PORTION:
            yield PORTION // 2
        if taken[root]:
            continue
        taken[root] = 1
        group = [root]
        for here in group:  # which grows meanwhile
            for source in into.get(here, ()):
                if not taken[source]:
                    taken[source] = 1
                    group.append(source)
        groups.append(sorted(group))
    return groups


def _left(size: int, out: Mapping[int, Sequence[int]]) -> Steps[list[int]]:
    """Nodes in the order in which a depth-first search leaves them."""
    finished: list[int] = []
    seen = bytearray(size)
    for root in range(size):
        stack = [] if seen[root] else [(root, iter(out.get(root, ())))]
        seen[root] = 1
        while stack:
            here, rest = stack[-1]
            for step in rest:
                if not seen[step]:
                    seen[step] = 1
                    stack.append((step, iter(out.get(step, ()))))
                    break
            else:
                finished.append(here)
                stack.pop()
                if not len(finished) % PORTION:
                    yield PORTION // 2
    return finished
