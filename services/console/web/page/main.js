// The page's state: sections as they come with frames, and a clock that runs between frames.
import { ENDED, follow } from "./link.js";
import { map } from "./map.js";
import { space } from "./space.js";
import { behaviorLanes, eventLanes, floorLanes } from "./lanes.js";
import { net } from "./net.js";
import { measures } from "./measures.js";
import { part } from "./part.js";
import { wizard } from "./wizard.js";
import { player } from "./player.js";
import { cameraPart, microphonePart, voicePart } from "./sound.js";
import { away, head, health, notes, references, switched, words } from "./lists.js";

const EACH = { "block/": "blocks", "net/": "layouts", "measures/": "measures" }; // sections that there are several of

// Where the state keeps a section that there are several of, and under which id.
function place(name) {
  const end = name.indexOf("/") + 1;
  return [EACH[name.slice(0, end)], name.slice(end)];
}

export function begin(root, robot) {
  const at = (id) => root.querySelector(`#${id}`);
  const state = { robot, blocks: new Map(), layouts: new Map(), measures: new Map(), now: () => 0, away: "" };
  const order = (what) => link.send(what);
  const drawn = [
    space(at("scene"), order), map(at("above"), order), part(at("part"), order), microphonePart(at("part"), () => link.session), cameraPart(at("part"), () => link.session), wizard(at("wizard"), order), words(at("said")), voicePart(at("said")), head(at("head")), floorLanes(at("floor")), eventLanes(at("events")),
    behaviorLanes(at("behaviors")), net(at("net")), measures(at("measures")), references(at("references")),
    health(at("health")), notes(at("notes")), switched(root.querySelector(".switched")),
    player(root.querySelector(".player"), order),
  ];
  const warning = away(root.querySelector(".away"));
  const clock = runningClock();
  state.now = clock.now;

  // isFirst: of a new link, whose window may be another one: nothing that was known before holds.
  function take(frame, isFirst) {
    clock.hear(frame.now, Boolean(frame.place));
    const changed = new Set();
    if (isFirst || (frame.place && frame.place.visit !== state.place?.visit)) {
      for (const kept of Object.values(EACH)) {
        state[kept].clear();
        changed.add(kept);
      }
    }
    if (frame.place) {
      state.place = frame.place;
      changed.add("place");
    }
    for (const [name, value] of Object.entries(frame.sections ?? {})) {
      const [kept, id] = place(name);
      if (kept) state[kept].set(id, value);
      else state[name] = value;
      changed.add(kept ?? name);
    }
    if (frame.you) {
      state.you = frame.you;
      changed.add("you");
    }
    if (frame.told?.length) {
      state.told = frame.told;
      changed.add("told");
    }
    for (const name of frame.gone ?? []) {
      const [kept, id] = place(name);
      state[kept].delete(id);
      changed.add(kept);
    }
    for (const part of [...drawn, warning]) alone(part, () => part.take(state, changed));
    root.dataset.frames = Number(root.dataset.frames ?? 0) + 1;
  }

  // A panel that fails does not stop the others, nor the frames that come after. Each says so once.
  const failed = new Set();
  function alone(part, draw) {
    try {
      draw();
    } catch (error) {
      if (!failed.has(part)) console.error(error);
      failed.add(part);
    }
  }

  function tick() {
    for (const part of drawn) alone(part, () => part.tick?.(state));
    requestAnimationFrame(tick);
  }
  requestAnimationFrame(tick);

  // Tell all panels something that no frame has.
  function news(what) {
    for (const part of drawn) alone(part, () => part.take(state, new Set([what])));
  }
  const waits = root.querySelector(".waits");
  const link = follow({
    take,
    tell(there, told = "") {
      const reason = told === ENDED ? "" : told; // there may be a window again: it is called, as one that is lost
      warning.link(there, reason);
      const away = there ? "" : reason || "the window does not answer";
      if (away === state.away) return;
      state.away = away;
      news("away");
    },
    report(told) {
      state.told = told;
      news("told");
    },
    wait(names) {
      waits.textContent = names.length ? `Without an answer from the window yet: ${names.join(", ")}.` : "";
      waits.hidden = !names.length;
    },
  });
  window.engage = { state, send: link.send, take, drawn }; // for who looks into the page with the browser's tools
}

// Seconds of the picture, between frames by the browser's own clock. Frames come late, never early.
function runningClock() {
  let behind = null;
  let still = null; // the last frame's time, where time is that of a recording, which goes as somebody wants
  const own = () => performance.now() / 1000;
  return {
    hear(now, isPlayed) {
      still = isPlayed ? now : null;
      const measured = own() - now;
      behind = behind === null || measured < behind || measured > behind + 1 ? measured : behind + (measured - behind) * 0.01;
    },
    now: () => still ?? (behind === null ? 0 : own() - behind),
  };
}
