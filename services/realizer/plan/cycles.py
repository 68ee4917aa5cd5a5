"""Strongly connected components: nodes that wait for each other in a circle."""

from collections.abc import Mapping, Sequence


def components(size: int, out: Mapping[int, Sequence[int]]) -> list[list[int]]:
    """The strongly connected components of a graph of `size` nodes. Kosaraju, without recursion."""
    into: dict[int, list[int]] = {}
    for source, targets in out.items():
        for target in targets:
            into.setdefault(target, []).append(source)
    groups = []
    taken = bytearray(size)
    for root in reversed(_left(size, out)):
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


def _left(size: int, out: Mapping[int, Sequence[int]]) -> list[int]:
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
    return finished
