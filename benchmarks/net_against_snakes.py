"""Planning and firing the same nets, against SNAKES, at 100, 1000 and 10000 transitions: times and ratios.

Both end with the same outcome, which is checked: every transition fires once, at the same second, and the initial
marking is back. For SNAKES the tokens carry the seconds, as timed nets are written there: an arc into a place adds
the place's lag to the latest input. Black tokens, which know no time, are shown too.

build: from the same list of arcs to a net that can fire, like with like. plan: ours goes all the way from the block:
references, classes, places, order, schedule. SNAKES has nothing of the kind: what it needs to know the same is to
build its net and to fire it, so that is its plan; with black tokens there is no schedule and thus no plan.

    python benchmarks/net_against_snakes.py [--laps N] [--json]        needs: pip install -e .[bench]
"""

import argparse
import gc
import json
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import TypeVar, TypeVarTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # it imports `imp`
    import snakes.nets as snakes

from benchmarks.running_net import references
from engage_hri.services.realizer.net.petri_net import PetriNet, Place, Transition, fire_once_each
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block

Given = TypeVarTuple("Given")
Made = TypeVar("Made")
SIZES = (100, 1000, 10000)


def build(net: PetriNet) -> PetriNet:
    """Our net, from its arcs to where it can fire."""
    transitions = [Transition(transition.name, transition.points) for transition in net.transitions]
    places = [Place(each.kind, each.source, each.target, each.lag) for each in net.places]
    built = PetriNet(tuple(transitions), tuple(places))
    assert built.initial is not None  # they are made
    assert len(built.inputs) == len(built.outputs)  # when asked for
    return built


class Timed:
    """SNAKES with seconds for tokens."""

    name = "SNAKES, timed tokens"

    def build(self, net: PetriNet) -> snakes.PetriNet:
        built = snakes.PetriNet("block")
        for number in range(len(net.transitions)):
            built.add_transition(snakes.Transition(f"t{number}"))
        for number, place in enumerate(net.places):
            built.add_place(snakes.Place(f"p{number}", [0.0] if net.initial[number] else []))
            built.add_input(f"p{number}", f"t{place.target}", snakes.Variable(f"x{number}"))
        for number, place in enumerate(net.places):
            latest = ", ".join(f"x{each}" for each in net.inputs[place.source])
            lag = repr(place.lag)
            text = f"max({latest}) + {lag}" if len(net.inputs[place.source]) > 1 else f"{latest} + {lag}"
            built.add_output(f"p{number}", f"t{place.source}", snakes.Expression(text))
        return built

    def run(self, net: PetriNet, built: snakes.PetriNet) -> dict[int, float]:
        """Fire each transition once; when each does."""
        seconds: dict[int, float] = {}
        todo = [0]
        while todo:
            number = todo.pop()
            if number in seconds:
                continue
            # Its own search for a binding (`modes`) is recursive and ends at a thousand inputs; ours is direct.
            tokens = {f"x{place}": built.place(f"p{place}").tokens for place in net.inputs[number]}
            if all(tokens.values()):
                binding = snakes.Substitution({name: next(iter(those)) for name, those in tokens.items()})
                seconds[number] = max(binding[name] for name in tokens)
                built.transition(f"t{number}").fire(binding)
                todo += [net.places[place].target for place in net.outputs[number]]
        return seconds


class Black:
    """SNAKES with tokens that know no time."""

    name = "SNAKES, black tokens"

    def build(self, net: PetriNet) -> snakes.PetriNet:
        built = snakes.PetriNet("block")
        token = snakes.Value(snakes.dot)
        for number in range(len(net.transitions)):
            built.add_transition(snakes.Transition(f"t{number}"))
        for number, place in enumerate(net.places):
            built.add_place(snakes.Place(f"p{number}", [snakes.dot] if net.initial[number] else []))
            built.add_output(f"p{number}", f"t{place.source}", token)
            built.add_input(f"p{number}", f"t{place.target}", token)
        return built

    def run(self, net: PetriNet, built: snakes.PetriNet) -> dict[int, float]:
        fired: dict[int, float] = {}
        todo, nothing = [0], snakes.Substitution()
        while todo:
            number = todo.pop()
            if number in fired:
                continue
            transition = built.transition(f"t{number}")
            if transition.enabled(nothing):
                transition.fire(nothing)
                fired[number] = 0.0
                todo += [net.places[place].target for place in net.outputs[number]]
        return fired


def measure(size: int, laps: int) -> dict[str, dict[str, float]]:
    """Median seconds of building, planning and firing, by contender."""
    block = references(size)
    taken: dict[str, dict[str, list[float]]] = {}

    def clock(name: str, what: str, act: Callable[[*Given], Made], *given: *Given) -> Made:
        gc.collect()
        began = time.perf_counter()
        result = act(*given)
        taken.setdefault(name, {}).setdefault(what, []).append(time.perf_counter() - began)
        return result

    for _ in range(laps):
        plan = clock("Engage", "plan", plan_block, block)
        assert isinstance(plan, Plan)
        net = clock("Engage", "build", build, plan.net)
        run = clock("Engage", "fire", fire_once_each, net, net.initial)
        assert run.marking == net.initial
        everything = set(range(len(net.transitions)))
        assert set(run.fired) == everything
        for contender in (Timed(), Black()):
            built = clock(contender.name, "build", contender.build, net)
            seconds = clock(contender.name, "fire", contender.run, net, built)
            assert set(seconds) == everything
            assert {place.name for place in built.place() if place.tokens} == {
                f"p{number}" for number, tokens in enumerate(net.initial) if tokens
            }
            if isinstance(contender, Timed):
                each = taken[contender.name]
                each.setdefault("plan", []).append(each["build"][-1] + each["fire"][-1])
                late = {each: at for each, at in seconds.items() if abs(at - plan.schedule[each]) > 1e-6}
                assert not late, late
    return {name: {what: median(those) for what, those in each.items()} for name, each in taken.items()}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--laps", type=int, default=3)
    options.add_argument("--json", action="store_true")
    chosen = options.parse_args()
    rows = []
    for size in SIZES:
        results = measure(size, chosen.laps)
        ours = results["Engage"]
        for name, seconds in results.items():
            row: dict[str, object] = {"transitions": size, "name": name}
            for what in ("build", "plan", "fire"):
                if what in seconds:
                    row[f"{what}_us"] = round(1e6 * seconds[what] / size, 2)
                    row[f"{what}_ratio"] = round(seconds[what] / ours[what], 2)
            rows.append(row)
    if chosen.json:
        print(json.dumps(rows))
        return
    columns = ("build_us", "build_ratio", "plan_us", "plan_ratio", "fire_us", "fire_ratio")
    heads = ("build", "ratio", "plan", "ratio", "fire", "ratio")
    print("microseconds per transition")
    print(f"{'transitions':>11}  {'':28}" + "".join(f"{head:>9}" for head in heads))
    for row in rows:
        cells = "".join(f"{row.get(column, '')!s:>9}" for column in columns)
        print(f"{row['transitions']:>11}  {row['name']!s:28}{cells}")


if __name__ == "__main__":
    main()
