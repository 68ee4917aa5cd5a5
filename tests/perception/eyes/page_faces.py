"""Faces that the scripts of a page find in pictures, in Chromium: what a camera would give them is handed to them."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from aiohttp import web

from engage_hri.schemas.perception import FACE_POINTS
from engage_hri.services.perception.eyes.looking import Floats
from tests.console import browser
from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.fetched import MODELS

PAGE = Path(__file__).parents[3] / "services/console/web/page"
WORKER = """
onmessage = async ({ data: count }) => {
  importScripts("/eyes/litert_wasm_compat_internal.js");
  const [{ models }, { finder }] = await Promise.all(["models", "faces"].map((name) => import(`/page/${name}.js`)));
  const names = ["face_detection_short_range.tflite", "face_landmark.tflite"];
  const nets = await models(ModuleFactory, new URL("/eyes/", location.href), names);
  const all = [];
  for (let number = 0; number < count; number += 1) {
    const answer = await fetch(`/pictures/${number}`);
    const [width, height] = answer.headers.get("x-size").split(" ").map(Number);
    const found = finder(...nets, 4).find({ width, height, data: new Uint8Array(await answer.arrayBuffer()) });
    all.push(found.map(({ points, confidence }) => [confidence, ...points]));
  }
  postMessage(all);
};
"""
RUN = """
new Promise((done, failed) => {
  const worker = new Worker("/worker.js");
  worker.onmessage = ({ data }) => done(data);
  worker.onerror = (error) => failed(error.message);
  worker.postMessage(%d);
})
"""


async def found(pictures: Sequence[Picture], patience: float = 600.0) -> list[list[tuple[Floats, float]]]:
    """Points of all faces of each picture, and the confidence that it is one. Each picture is a first one."""

    async def picture(request: web.Request) -> web.Response:
        rows = pictures[int(request.match_info["number"])]
        height, width = rows.shape[:2]
        pixels = np.dstack([rows, np.full((height, width), 255, np.uint8)])
        return web.Response(body=pixels.tobytes(), headers={"x-size": f"{width} {height}"})

    async def worker(request: web.Request) -> web.Response:
        return web.Response(text=WORKER, content_type="text/javascript")

    async def blank(request: web.Request) -> web.Response:
        return web.Response(text="<p>", content_type="text/html")

    app = web.Application()
    app.router.add_static("/page", PAGE)
    app.router.add_static("/eyes", MODELS)
    app.add_routes([web.get("/", blank), web.get("/worker.js", worker), web.get("/pictures/{number}", picture)])
    runner = web.AppRunner(app)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    try:
        # Chromium may still write there when it has been told to end.
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, browser.running(Path(folder)) as port:
            async with browser.at_port(port) as running, running.page() as page:
                host, where = runner.addresses[0][:2]
                await page.go(f"http://{host}:{where}/")
                await page.until("location.host && document.body")
                told: list[list[list[float]]] = await page.value(RUN % len(pictures), patience)
    finally:
        await runner.cleanup()
    return [[(np.reshape(points, (FACE_POINTS, 3)), score) for score, *points in faces] for faces in told]
