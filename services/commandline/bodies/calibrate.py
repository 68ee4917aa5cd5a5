"""Command `engage calibrate`: measure where a body really looks and points, where a camera stands, or which colors
pieces have, and write what corrects it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.text import utf8
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.commandline.bodies.cameras import CameraOptions, calibrated_camera, learned_colors
from engage_hri.services.commandline.shell.process import DONE, run, typed
from engage_hri.services.commandline.shell.result_file import ResultFile
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.control.calibrating.fitting import Fit, Measurement, fit
from engage_hri.services.control.calibrating.measuring import OTHER_ROWS, Eyes, SimulatedEyes, marks, measured
from engage_hri.services.control.contract.body import Body, BodyState
from engage_hri.services.control.contract.calibration import PARTS, WIDEST, Calibration, written

FEWEST = 3
"""Measurements of a part below which nothing is fitted."""


@dataclass(frozen=True, kw_only=True)
class Options(CameraOptions):
    part: Annotated[
        list[str] | None,
        typer.Option(metavar="PART", help="head, left_arm or right_arm; may be repeated.", show_default="all it has"),
    ] = None
    ask: Annotated[bool, typer.Option("--ask", help="Ask on standard input where it really looks or points.")] = False
    measurements: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Measurements made before; nothing moves.", show_default=False)
    ] = None
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the measurements as JSON lines.", show_default=False)
    ] = None
    world: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON of what it looks and points at; without it marks on a table."),
    ] = None
    spread: Annotated[
        float, typer.Option(metavar="METRES", min=0.0, help="How well simulated eyes measure a place.")
    ] = 0.003


class AskedEyes:
    """Eyes of whoever sits at the terminal, and types a place."""

    def __init__(self) -> None:
        self._typed = b""

    async def place(self, part: str, mark: Entity, state: BodyState) -> Vector | None:
        """Ask until a place is typed, or nothing. Raises RunFailed at the end of the input."""
        meant = " ".join(f"{part:.3f}" for part in mark.position)
        while True:
            print(
                f"{part} is on {mark.id} ({meant}). Where really? x y z in metres, or nothing: ", end="", flush=True
            )
            line = await self._line()
            if not line.strip():
                return None
            try:
                x, y, z = (float(each) for each in line.replace(",", " ").split())
            except ValueError:
                print("three numbers, such as", meant)
                continue
            return (x, y, z)

    async def _line(self) -> str:
        while b"\n" not in self._typed:
            more = await typed()
            if not (more or self._typed):
                reason = "standard input has ended before all places were typed"
                raise RunFailed(Fault(reason=reason, where="--ask"))
            self._typed += more or b"\n"
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace")


def main(options: Options) -> int:
    if options.what != "body":
        made = learned_colors if options.what == "colors" else calibrated_camera
        return made(options)
    config = options.load()
    parts = tuple(options.part or PARTS)
    if unknown := [part for part in parts if part not in PARTS]:
        raise InputRefused(
            Fault(reason=f"no part {unknown[0]!r}", where="--part", advice=f"known: {', '.join(PARTS)}")
        )
    known = None if options.measurements is None else read_measurements(options.measurements)
    out, record = (
        ResultFile(options.out or Path("calibration.toml")),
        None if options.record is None else ResultFile(options.record),
    )
    run(_calibrate(options, config, parts, known, out, record), virtual_time=not options.ask)
    return DONE


async def _calibrate(
    options: Options,
    config: RobotConfig,
    parts: Sequence[str],
    known: Sequence[Measurement] | None,
    out: ResultFile,
    record: ResultFile | None,
) -> None:
    from engage_hri.services.control.bases.drivers import made
    from engage_hri.services.simulation.still import load_world

    body = made(config.control)
    parts = [part for part in parts if part in body.capabilities.parts]
    world = marks() if options.world is None else load_world(options.world)
    eyes = _eyes(options, body)
    if known is None:
        if eyes is None:
            advice = "--ask somebody who sees it, or give the --measurements"
            raise InputRefused(Fault(reason="nobody sees where this body points", where="calibrate", advice=advice))
        async with body.connected():
            found = await measured(body, world, parts, eyes, print)
            fits = _fits(body, parts, found)
            checked = await _checked(body, fits, options) if isinstance(eyes, SimulatedEyes) else {}
    else:
        found, checked = list(known), {}
        fits = _fits(body, parts, found)
    if record is not None:
        record.write(b"".join(msgspec.json.encode(each) + b"\n" for each in found))
    if not fits:
        raise RunFailed(
            Fault(
                reason=f"no part was measured {FEWEST} times or more",
                where=str(options.measurements or options.world or "marks"),
            )
        )
    offsets = {joint: offset for each in fits for joint, offset in each.offsets.items()}
    errors = {each.part: min(each.error, WIDEST) for each in fits}
    told = {each.part: [*said(each), *checked.get(each.part, ())] for each in fits}
    out.write(written(Calibration(offsets=offsets, errors=errors), body.capabilities.body, told).encode())
    for part, lines in told.items():
        print("\n    ".join((f"{part}: {lines[0]}", *lines[1:], f"within {errors[part]:.2f} degrees 19 times in 20")))
    print(f"written: {out.path}; it counts with control.calibration={out.path}")


def _eyes(options: Options, body: Body) -> Eyes | None:
    if options.ask:
        return AskedEyes()
    return SimulatedEyes(body, options.spread) if body.capabilities.faults else None


def _fits(body: Body, parts: Sequence[str], found: Sequence[Measurement]) -> list[Fit]:
    fits = []
    for part in parts:
        own = [each for each in found if each.part == part]
        joints = [limit.joint for limit in body.capabilities.joints if limit.part == part]
        if len(own) >= FEWEST:
            fits.append(fit(part, own, lambda pose, part=part: body.ray_at(part, pose), joints))  # type: ignore[misc]
    return fits


async def _checked(body: Body, fits: Sequence[Fit], options: Options) -> dict[str, list[str]]:
    """Correct the body, have it look and point at other marks, and say by part how far beside that is."""
    corrected = Calibration(offsets={joint: offset for each in fits for joint, offset in each.offsets.items()})
    body.calibrate(corrected.radians)
    parts = [each.part for each in fits]
    again = await measured(body, marks(OTHER_ROWS), parts, SimulatedEyes(body, options.spread, seed=1), print)
    told = {}
    for part in parts:
        own = [each for each in again if each.part == part]
        if own:
            root, most = fit(part, own, lambda pose: None, ()).before
            told[part] = [f"at {len(own)} other marks {root:.2f}, at most {most:.2f}"]
    return told


def said(fit: Fit) -> list[str]:
    """A fit in words: what is beside, and what remains with the offsets."""
    (root, most), (root_after, most_after) = fit.before, fit.after
    offsets = ", ".join(f"{joint} {offset:+.2f}" for joint, offset in fit.offsets.items())
    before = f"{fit.number} measurements, {root:.2f} degrees beside, at most {most:.2f}"
    return [before, f"with {offsets}: {root_after:.2f}, at most {most_after:.2f}"] if offsets else [before]


def read_measurements(path: Path) -> list[Measurement]:
    """Read measurements, a JSON object in each line. Raises InputRefused with the line."""
    try:
        text = utf8(path.read_bytes(), str(path))
    except OSError as error:
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(path))) from error
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            try:
                found.append(msgspec.json.decode(line, type=Measurement))
            except msgspec.DecodeError as error:
                raise InputRefused(Fault(reason=str(error), where=str(path), line=number)) from error
    return found
