"""Services of one group share a process: how groups are named, what `up` makes of them, and their death."""

import asyncio
import os
import random
import signal
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.shell.roster import NAMES, groups
from tests.bus.places import free_endpoint
from tests.cli.command import GOOD_BLOCK, closed, start
from tests.cli.test_processes import PATIENCE, children, line, stopped
from tests.rigs.kills.trial import Verdict, trial


@given(st.lists(st.integers(0, 3), min_size=len(NAMES), max_size=len(NAMES)), st.randoms())
def test_each_service_is_in_one_process_with_its_group_and_nobody_else(
    homes: list[int], chance: random.Random
) -> None:
    names = list(NAMES)
    chance.shuffle(names)
    wanted = [{name for name, home in zip(names, homes, strict=True) if home == each} for each in (1, 2, 3)]
    together = [", ".join(sorted(each, key=names.index)) for each in wanted if each]

    found = groups(NAMES, together)

    assert Counter(name for each in found for name in each) == Counter(NAMES)
    alone = [{name} for name, home in zip(names, homes, strict=True) if home == 0]
    assert sorted(map(sorted, found)) == sorted(sorted(each) for each in (*wanted, *alone) if each)


@pytest.mark.parametrize(
    ("together", "reason"),
    [
        (["realizer,contrl"], "'contrl' is not one of the services"),
        (["realizer,realizer"], "realizer is there twice"),
        (["realizer,"], "'' is not one of the services"),
        (["collaboration,control"], "collaboration does not run here"),
        (["realizer,control", "control,generation"], "control is in two groups"),
    ],
)
def test_a_group_that_cannot_be_is_refused_by_name(together: list[str], reason: str) -> None:
    with pytest.raises(InputRefused) as refused:
        groups(NAMES[:5], together)

    assert reason in str(refused.value)


def services_of(pid: int) -> str:
    """What `engage run` runs in this process."""
    arguments = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    return arguments[arguments.index("run") + 1]


@pytest.mark.real_time
async def test_a_group_is_one_process_that_dies_and_comes_back_as_one_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)
    endpoint = free_endpoint()
    where = ("--robot", "pair", "--connect", endpoint)
    up = await start("up", "--together", "realizer,control", "--robot", "pair", "--listen", endpoint)

    async def play() -> str:
        process = await start("play", *where, tmp_path / "block.xml")
        async with asyncio.timeout(PATIENCE):
            out, err = await process.communicate()
        return out.decode() + err.decode()

    try:
        await line(up, "all services are up", log=False)
        assert "block hello: done" in await play()
        pids = {services_of(pid): pid for pid in children(up.pid)}
        assert sorted(pids) == ["generation", "realizer,control", "recognition", "simulation"]

        os.kill(pids["realizer,control"], signal.SIGKILL)

        await line(up, "realizer,control │ ended with signal 9; starting it again", log=False)
        for name in ("realizer", "control"):
            await line(up, f"{name} is ready", log=False)
        assert "block hello: done" in await play()
    finally:
        code = await stopped(up)

    assert code == 0


@pytest.mark.real_time
async def test_with_keys_each_service_of_a_group_has_its_own(tmp_path: Path) -> None:
    router, services, alice = await closed(tmp_path)
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)
    pair = await start("run", "control,realizer", *services)
    others = await start("run", "generation,simulation", *services)
    try:
        await line(pair, "realizer is ready")
        await line(others, "simulation is ready")
        play = await start("play", *alice, tmp_path / "block.xml")
        async with asyncio.timeout(PATIENCE):
            out, _ = await play.communicate()

        assert b"block hello: done" in out
    finally:
        codes = [await stopped(each) for each in (others, pair, router)]

    assert codes == [0, 0, 0]


@pytest.mark.real_time
async def test_what_is_asked_of_a_pair_that_is_killed_ends_once_and_nothing_is_said_twice() -> None:
    verdict = await trial("realizer,control", 3, random.Random(7))

    assert verdict.mistakes == {}
    assert verdict.kills == 3
    assert verdict.ends["done"] > 0


def test_the_judge_of_kills_sees_what_hangs_is_lost_and_comes_twice() -> None:
    begun = Counter({("a", "s0"): 1, ("a", "s1"): 1, ("a", "s2"): 1, ("b", "s0"): 2, ("c", "s0"): 1, ("c", "s1"): 1})
    verdict = Verdict(statuses={"a": "done", "b": "RunFailed", "c": "done", "d": "hung"}, begun=begun)

    assert verdict.mistakes == {"hung": ["d"], "lost": ["c:s2"], "doubled": ["b:s0"]}
