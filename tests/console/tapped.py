"""What a page plays, taken where it goes to the loudspeaker: its samples, and when they are heard."""

import base64
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.console.browser import Page

TAP = """
(() => {
  const code = `registerProcessor("tap", class extends AudioWorkletProcessor {
    process(inputs) {
      const heard = inputs[0][0];
      if (heard) this.port.postMessage([currentFrame, heard.slice(0)]);
      return true;
    }
  })`;
  const module = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
  const connect = AudioNode.prototype.connect;
  window.tapped = { blocks: [], marks: [], rate: 0 };
  const Plain = AudioContext;
  window.AudioContext = class extends Plain {
    constructor(options) {
      super(options);
      if (options?.sinkId) return; // it plays nothing: that of a microphone
      this.early = [];
      window.tapped = { blocks: [], marks: [], rate: this.sampleRate };
      this.audioWorklet.addModule(module).then(() => {
        this.tap = new AudioWorkletNode(this, "tap");
        this.tap.port.onmessage = ({ data }) => window.tapped.blocks.push(data);
        connect.call(this.tap, this.destination);
        for (const each of this.early) connect.call(each, this.tap);
      });
      setInterval(() => {
        const { contextTime, performanceTime } = this.state === "running" ? this.getOutputTimestamp() : {};
        if (performanceTime) window.tapped.marks.push([contextTime, performanceTime]);
      }, 50);
    }
  };
  AudioNode.prototype.connect = function (to, ...more) {
    const { destination, tap, early } = this.context;
    if (to === destination) tap ? connect.call(this, tap) : early?.push(this);
    return connect.call(this, to, ...more);
  };
  window.tappedText = () => {
    const blocks = window.tapped.blocks;
    const all = new Float32Array(blocks.length * 128);
    blocks.forEach(([, heard], index) => all.set(heard, index * 128));
    const bytes = new Uint8Array(all.buffer);
    let text = "";
    for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
    const { marks, rate } = window.tapped;
    return { frames: blocks.map(([frame]) => frame), marks, rate, sound: btoa(text) };
  };
})();
"""
"""Script for a page before it loads anything."""


async def tap(page: Page) -> None:
    """Tap all that a page will play, from when it is loaded next."""
    await page.call("Page.setBypassCSP", enabled=True)
    await page.call("Page.addScriptToEvaluateOnNewDocument", source=TAP)


async def ahead(page: Page) -> float:
    """Seconds by which our clock (`time.monotonic`) is ahead of that of a page (`performance.now`)."""
    found = []
    for _ in range(20):
        asked = time.monotonic()
        there = await page.value("performance.now()") / 1000
        took = time.monotonic() - asked
        found.append((took, asked + took / 2 - there))
    return float(min(found)[1])


async def tapped(page: Page, until: float) -> tuple[float, NDArray[np.float32], int]:
    """What a page has played: the time of its clock (`time.monotonic`) at the first sample, samples, and their rate.

    The browser is asked where a sample of the context is heard, and by the clock of the machine: not the page.
    """
    told: dict[str, Any] = await page.value("tappedText()")
    rate = told["rate"]
    blocks = np.frombuffer(base64.b64decode(told["sound"]), "<f4").reshape(-1, 128)
    marks = np.array(told["marks"])
    behind = float(np.median(marks[:, 1] / 1000 - marks[:, 0])) + await ahead(page)
    frames = np.array(told["frames"], int)
    begin = int(frames[0])
    heard = np.zeros(max(int(frames[-1]) + 128 - begin, round((until - behind) * rate) - begin), np.float32)
    for frame, block in zip(frames, blocks, strict=True):
        heard[frame - begin : frame - begin + 128] = block
    return begin / rate + behind, heard, rate


async def press(page: Page, selector: str) -> None:
    """Press a button as a hand does: what a script presses may not begin to sound."""
    await page.value(f"document.querySelector({selector!r}).scrollIntoView({{ block: 'center' }})")
    x, y = await page.value(
        f"(({{ x, y, width, height }}) => [x + width / 2, y + height / 2])"
        f"(document.querySelector({selector!r}).getBoundingClientRect())"
    )
    for kind in ("mousePressed", "mouseReleased"):
        await page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
