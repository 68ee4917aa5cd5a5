// Figures in 3D that the workshop and the stage share: robot, people, table and pieces. Each is put where it is to be, and steps there.
import { THREE } from "three";
import { pieceColor } from "./look.js";

const SHOULDERS = 0.2; // metres from the middle of the trunk
const SHELL = "#eef1f3";
const JOINTS = "#64737f";
const COATS = ["#3f7f8c", "#b5654a", "#6d5aa8", "#4f7a4a", "#a8527c", "#8a6d3b"];
const HAIR = ["#3a2a22", "#6b4a2f", "#1f1d22", "#8c6a44", "#4a3f3a"];
const SKIN = ["#e0ac82", "#c68a5e", "#f0c8a4", "#9a6a48"];

// Where there is no graphics card the processor draws, under one of these names: smooth edges and shadows take most of its time.
const BY_PROCESSOR = /swiftshader|llvmpipe|softpipe|basic render/i;
function hasCard() {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  return !BY_PROCESSOR.test(context?.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : context.RENDERER));
}

// Whether pictures are drawn finely. Who wants no motion has few of them: they may take their time.
export const CALM = matchMedia("(prefers-reduced-motion: reduce)");
export const isFine = () => CALM.matches || hasCard();

export const vector = (at) => new THREE.Vector3(...at);
export const material = (color, more = {}) => new THREE.MeshStandardMaterial({ color, roughness: 0.55, ...more });
const choice = (list, id) => list[[...id].reduce((sum, sign) => (sum * 31 + sign.charCodeAt(0)) >>> 0, 7) % list.length];

function cast(mesh, receives = true) {
  mesh.castShadow = true;
  mesh.receiveShadow = receives;
  return mesh;
}

// Keep one figure for each of the wanted, by id.
export function keep(known, wanted, make, put) {
  const ids = new Set(wanted.map((each) => each.id));
  for (const [id, made] of known) {
    if (!ids.has(id)) {
      made.remove();
      known.delete(id);
    }
  }
  for (const each of wanted) {
    if (!known.has(each.id)) known.set(each.id, make(each));
    put(known.get(each.id), each);
  }
}

// Where something is, by its id; null: nobody knows.
export function placeOf(section) {
  return (id) => {
    if (id === section.robot) return section.body?.eyes ?? null;
    return (section.things.find((each) => each.id === id) ?? section.people.find((each) => each.id === id))?.at ?? null;
  };
}

// A place that follows where it is to be. step: part of the way, 0 to 1; returns whether it still moves.
function follower() {
  const now = new THREE.Vector3();
  let goal = null;
  return {
    now,
    to(at) {
      if (goal === null) now.copy(at);
      goal = at.clone();
    },
    step(part) {
      if (goal === null) return false;
      now.lerp(goal, part);
      const isThere = now.distanceToSquared(goal) < 1e-7;
      if (isThere) now.copy(goal);
      return !isThere;
    },
  };
}

const ALONG = new THREE.Vector3(0, 1, 0);
function limb(scene, radius, color, more) {
  const mesh = cast(new THREE.Mesh(new THREE.CapsuleGeometry(radius, 1, 6, 14), material(color, more)));
  scene.add(mesh);
  return {
    mesh,
    between(from, to) {
      const way = to.clone().sub(from);
      mesh.position.copy(from).addScaledVector(way, 0.5);
      mesh.quaternion.setFromUnitVectors(ALONG, way.clone().normalize());
      mesh.scale.set(1, Math.max(way.length(), 0.01), 1);
    },
  };
}

function ball(scene, radius, color) {
  const mesh = cast(new THREE.Mesh(new THREE.SphereGeometry(radius, 20, 14), material(color)));
  scene.add(mesh);
  return mesh;
}

// Something to sit on, for somebody who is not there yet.
export function makeStool(scene, at) {
  const parts = [
    turned(scene, [[0, 0], [0.17, 0], [0.17, 0.02], [0.05, 0.04], [0.028, 0.1], [0.028, 0.46]], JOINTS),
    turned(scene, [[0, 0.45], [0.17, 0.45], [0.185, 0.47], [0.185, 0.5], [0.16, 0.525], [0, 0.53]], "#c46a4a"),
  ];
  for (const each of parts) each.position.set(...at);
  return { show: (on) => parts.forEach((each) => (each.visible = on)) };
}

// A body that is turned about its upright axis. profile: pairs of radius and height.
function turned(scene, profile, color, flat = 1) {
  const mesh = cast(new THREE.Mesh(new THREE.LatheGeometry(profile.map(([radius, height]) => new THREE.Vector2(radius, height)), 36), material(color)));
  mesh.geometry.rotateX(Math.PI / 2);
  mesh.scale.set(flat, 1, 1);
  scene.add(mesh);
  return mesh;
}

export function ray(scene, color, dashed) {
  const options = { color, transparent: true, opacity: 0.95 };
  const made = new THREE.Line(new THREE.BufferGeometry(),
    dashed ? new THREE.LineDashedMaterial({ ...options, dashSize: 0.03, gapSize: 0.02 }) : new THREE.LineBasicMaterial(options));
  made.visible = false;
  scene.add(made);
  return {
    between(from, to) {
      made.visible = Boolean(from && to);
      if (!made.visible) return;
      made.geometry.dispose();
      made.geometry = new THREE.BufferGeometry().setFromPoints([from, to]);
      made.computeLineDistances();
    },
    remove: () => scene.remove(made),
  };
}

// Table: an outline with rounded edges, on a foot.
function makeTable(scene) {
  const mesh = cast(new THREE.Mesh(new THREE.BufferGeometry(), material("#c79a6b", { roughness: 0.7, map: wood() })));
  scene.add(mesh);
  return { mesh, foot: turned(scene, [[0, 0], [0.21, 0], [0.21, 0.02], [0.06, 0.045], [0.032, 0.1], [0.032, 1]], JOINTS) };
}

function wood() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const context = canvas.getContext("2d");
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, 256, 256);
  for (let line = 0; line < 150; line += 1) {
    const wave = (line * 7919) % 97 / 97; // the same grain each time
    context.strokeStyle = `rgb(90 50 20 / ${0.03 + 0.07 * wave})`;
    context.lineWidth = 0.6 + 1.6 * wave;
    const y = (line * 61) % 256;
    context.beginPath();
    context.moveTo(0, y);
    context.bezierCurveTo(80, y + 5 * wave, 170, y - 6 * wave, 256, y);
    context.stroke();
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.set(1.6, 2.2);
  texture.rotation = Math.PI / 2;
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}

// A thing of the world: its outline as a slab, or a ball. label: an object of the scene that stands above it.
export function makePiece(scene, thing, label = null) {
  const isTable = thing.kind === "surface";
  const table = isTable ? makeTable(scene) : null;
  const color = thing.kind === "hand" ? choice(SKIN, thing.owner) : pieceColor(thing.color);
  const mesh = table?.mesh ?? cast(new THREE.Mesh(new THREE.BufferGeometry(), material(color, { roughness: 0.38 })));
  if (label) scene.add(label);
  if (!table) scene.add(mesh);
  const place = follower();
  let drawnAs = "";
  return {
    mesh,
    solid: thing.kind === "object" ? mesh : null,
    put(now, body) {
      const height = isTable ? 0.03 : 0.014;
      const [x, y] = now.at;
      const outline = now.outline.map(([a, b]) => [a - x, b - y]);
      const key = JSON.stringify(outline.map((each) => each.map((value) => value.toFixed(3))));
      if (key !== drawnAs) {
        drawnAs = key;
        mesh.geometry.dispose();
        if (outline.length) {
          const shape = new THREE.Shape(outline.map(([a, b]) => new THREE.Vector2(a, b)));
          const bevel = isTable ? 0.008 : 0.0022;
          mesh.geometry = new THREE.ExtrudeGeometry(shape, {
            depth: height - 2 * bevel, bevelThickness: bevel, bevelSize: bevel, bevelOffset: -bevel, bevelSegments: 3,
          });
          mesh.geometry.translate(0, 0, bevel - (isTable ? height : 0));
        } else {
          mesh.geometry = new THREE.SphereGeometry(thing.kind === "hand" ? 0.036 : Math.max(now.radius, 0.02), 20, 14);
        }
      }
      place.to(vector(now.at));
      const meant = body && (body.looks_at === now.id || body.points.includes(now.id));
      mesh.material.emissive.set(meant && thing.kind === "object" ? pieceColor(now.color) : "#000000");
      mesh.material.emissiveIntensity = meant ? 0.5 : 0;
      label?.element.classList.toggle("meant", Boolean(meant));
    },
    step(part) {
      const moves = place.step(part);
      mesh.position.copy(place.now);
      label?.position.copy(place.now).setZ(place.now.z + 0.035);
      if (table) {
        table.foot.position.copy(place.now).setZ(0);
        table.foot.scale.z = Math.max(place.now.z - 0.03, 0.01);
      }
      return moves;
    },
    remove() {
      scene.remove(mesh);
      if (label) scene.remove(label);
      if (table) scene.remove(table.foot);
    },
  };
}

// A face drawn on dark glass. joints: shares of their way, as the body tells them.
function face() {
  const canvas = document.createElement("canvas");
  canvas.width = 320;
  canvas.height = 224;
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  let drawnAs = "";
  return {
    texture,
    draw(joints, speaks) {
      const of = (name) => joints[name] ?? 0;
      const key = [...Object.values(joints).map((each) => each.toFixed(2)), speaks].join();
      if (key === drawnAs) return;
      drawnAs = key;
      const context = canvas.getContext("2d");
      context.fillStyle = "#10171f";
      context.fillRect(0, 0, 320, 224);
      context.fillStyle = context.strokeStyle = "#8feaff";
      context.shadowColor = "#39c8f0";
      context.shadowBlur = 16;
      context.lineCap = "round";
      for (const [side, x] of [["right", 92], ["left", 228]]) { // as one sees it from the front
        const open = Math.max(0.06, Math.min(1.2, 1 - Math.max(0, of(`${side}_lid`))));
        context.beginPath();
        context.ellipse(x, 92, 25, 36 * open, 0, 0, 2 * Math.PI);
        context.fill();
        const lift = of(`${side}_brow`) * 14;
        const slant = of("brow_slant") * (side === "left" ? 8 : -8);
        if (Math.abs(lift) > 3 || Math.abs(slant) > 2) {
          context.lineWidth = 7;
          context.beginPath();
          context.moveTo(x - 22, 40 - lift - slant);
          context.lineTo(x + 22, 40 - lift + slant);
          context.stroke();
        }
      }
      const open = 6 + 30 * Math.max(of("jaw"), of("lips") * 0.6, speaks ? 0.12 : 0);
      const smile = 10 + 12 * ((of("left_mouth_corner") + of("right_mouth_corner")) / 2);
      context.lineWidth = 7;
      context.beginPath();
      context.moveTo(126, 166 - smile / 2);
      context.quadraticCurveTo(160, 166 + smile, 194, 166 - smile / 2);
      context.quadraticCurveTo(160, 166 + smile + 2 * (open - 6), 126, 166 - smile / 2);
      open > 9 ? context.fill() : context.stroke();
      texture.needsUpdate = true;
    },
  };
}

// A head that faces along its own x axis; where its eyes are is its origin.
function robotHead(scene) {
  const group = new THREE.Group();
  const skull = cast(new THREE.Mesh(new THREE.SphereGeometry(0.112, 40, 28), material(SHELL, { roughness: 0.32 })));
  const drawn = face();
  const glass = new THREE.Mesh(
    new THREE.SphereGeometry(0.1135, 36, 24, Math.PI - 0.98, 1.96, Math.PI / 2 - 0.66, 1.3),
    new THREE.MeshStandardMaterial({ color: "#202a33", roughness: 0.16, emissive: "#ffffff", emissiveMap: drawn.texture }));
  for (const part of [skull, glass]) {
    part.geometry.rotateX(Math.PI / 2);
    part.scale.set(0.9, 0.96, 0.98);
    part.position.set(-0.085, 0, 0);
    group.add(part);
  }
  for (const side of [1, -1]) {
    const ear = cast(new THREE.Mesh(new THREE.CylinderGeometry(0.034, 0.04, 0.024, 28), material(JOINTS)));
    ear.position.set(-0.095, side * 0.108, 0);
    group.add(ear);
  }
  scene.add(group);
  return { group, mimic: drawn.draw };
}

function personHead(scene, id) {
  const group = new THREE.Group();
  const skin = choice(SKIN, id);
  const skull = cast(new THREE.Mesh(new THREE.SphereGeometry(0.095, 32, 24), material(skin, { roughness: 0.7 })));
  skull.scale.set(0.93, 0.84, 1.14);
  skull.position.set(-0.07, 0, -0.015);
  const hair = cast(new THREE.Mesh(new THREE.SphereGeometry(0.1, 32, 20, 0, 2 * Math.PI, 0, Math.PI * 0.52), material(choice(HAIR, id), { roughness: 0.9 })));
  hair.geometry.rotateX(Math.PI / 2);
  hair.scale.set(0.98, 0.9, 1.12);
  hair.rotation.y = -0.42;
  hair.position.set(-0.078, 0, 0.004);
  group.add(skull, hair);
  const lids = [1, -1].map((side) => {
    const eye = new THREE.Mesh(new THREE.SphereGeometry(0.0135, 16, 12), material("#1c2329", { roughness: 0.2 }));
    eye.position.set(0.01, side * 0.033, 0.008);
    group.add(eye);
    return eye;
  });
  const mouth = new THREE.Mesh(new THREE.SphereGeometry(0.022, 16, 10), material("#8c3f3a"));
  mouth.position.set(0.006, 0, -0.055);
  group.add(mouth);
  scene.add(group);
  return {
    group,
    mimic(joints, speaks) {
      for (const lid of lids) lid.scale.set(0.6, 0.85, 1);
      mouth.scale.set(0.3, 1, speaks ? 0.55 : 0.16);
    },
  };
}

// Turn a head: where its eyes are, and where they look.
function turn(group, at, towards) {
  group.position.copy(at);
  group.rotation.set(0, 0, 0);
  group.rotateZ(Math.atan2(towards.y, towards.x));
  group.rotateY(-Math.asin(THREE.MathUtils.clamp(towards.z / (towards.length() || 1), -1, 1)));
}

// The light in which a gaze lies: bright at the eyes, and gone at its end.
function gazeLight(scene, color) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1, 64];
  const context = canvas.getContext("2d");
  const fade = context.createLinearGradient(0, 0, 0, 64);
  fade.addColorStop(0, "#ffffff");
  fade.addColorStop(1, "#202020");
  context.fillStyle = fade;
  context.fillRect(0, 0, 1, 64);
  const geometry = new THREE.ConeGeometry(1, 1, 36, 1, true);
  geometry.translate(0, -0.5, 0); // the tip is its origin
  const cone = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({
    color, transparent: true, opacity: 0.3, depthWrite: false, side: THREE.DoubleSide, alphaMap: new THREE.CanvasTexture(canvas),
  }));
  scene.add(cone);
  return cone;
}

export function makeRobot(scene) {
  const base = turned(scene, [[0, 0], [0.2, 0], [0.205, 0.02], [0.16, 0.06], [0.07, 0.14], [0.055, 0.4], [0.07, 0.52], [0, 0.53]], JOINTS);
  const trunk = turned(scene, [[0, -0.4], [0.07, -0.4], [0.105, -0.36], [0.135, -0.2], [0.15, -0.04], [0.13, 0.03], [0.075, 0.07], [0, 0.078]], SHELL, 0.82);
  const neck = limb(scene, 0.036, JOINTS);
  const head = robotHead(scene);
  const cone = gazeLight(scene, "#ffb547");
  const arms = new Map(["left", "right"].map((side) => [side, {
    sign: side === "left" ? 1 : -1, shoulder: ball(scene, 0.058, JOINTS), elbow: ball(scene, 0.04, JOINTS),
    upper: limb(scene, 0.038, SHELL), fore: limb(scene, 0.034, SHELL), hand: ball(scene, 0.038, JOINTS), finger: limb(scene, 0.011, JOINTS),
    ray: ray(scene, "#e0533f", true), from: follower(), to: follower(),
  }]));
  const [eyes, gaze, front] = [follower(), follower(), follower()];
  const heads = [trunk, base, neck.mesh, head.group];
  let [told, find] = [null, () => null];
  return {
    solid: head.group,
    cone,
    put(body, where) {
      [told, find] = [body, where];
      const shows = Boolean(body?.eyes);
      for (const each of heads) each.visible = shows;
      cone.visible = Boolean(shows && body.gaze);
      if (shows) {
        eyes.to(vector(body.eyes));
        gaze.to(body.gaze ? vector(body.gaze).normalize() : new THREE.Vector3(1, 0, 0));
        head.mimic(body.joints, body.speaking);
      }
      const yaw = body?.joints?.torso_turn ?? body?.joints?.body_yaw ?? 0;
      front.to(new THREE.Vector3(Math.cos(yaw), Math.sin(yaw), 0));
      for (const [side, arm] of arms) {
        const shown = body?.arms.find((each) => each.side === side);
        for (const part of [arm.shoulder, arm.elbow, arm.upper.mesh, arm.fore.mesh, arm.hand, arm.finger.mesh]) part.visible = Boolean(shown);
        if (!shown) continue;
        arm.from.to(vector(shown.elbow));
        arm.to.to(vector(shown.hand));
      }
    },
    step(part) {
      const moves = [eyes, gaze, front, ...[...arms.values()].flatMap((arm) => [arm.from, arm.to])].map((each) => each.step(part)).some(Boolean);
      const top = eyes.now;
      const shoulders = new THREE.Vector3(top.x - 0.05, top.y, top.z - 0.22);
      trunk.position.set(shoulders.x, shoulders.y, shoulders.z - 0.02);
      trunk.rotation.z = Math.atan2(front.now.y, front.now.x);
      const left = new THREE.Vector3(-front.now.y, front.now.x, 0).multiplyScalar(SHOULDERS - 0.03);
      base.position.set(0, 0, 0);
      base.scale.z = Math.max((shoulders.z - 0.4) / 0.53, 0.01);
      neck.between(shoulders, new THREE.Vector3(top.x - 0.08, top.y, top.z - 0.08));
      turn(head.group, top, gaze.now);
      if (cone.visible) {
        const target = find(told.looks_at);
        const length = target ? vector(target).distanceTo(top) : 1.2;
        const wide = length * Math.tan(told.spread);
        cone.scale.set(wide, length, wide);
        cone.position.copy(top);
        cone.quaternion.setFromUnitVectors(ALONG, gaze.now.clone().normalize().negate());
      }
      for (const arm of arms.values()) {
        const elbow = arm.from.now;
        if (!arm.hand.visible) {
          arm.ray.between(null, null);
          continue;
        }
        const way = arm.to.now.clone().sub(elbow).normalize();
        const wrist = arm.to.now.clone().addScaledVector(way, -0.06);
        arm.shoulder.position.copy(shoulders).addScaledVector(left, arm.sign);
        arm.elbow.position.copy(elbow);
        arm.upper.between(arm.shoulder.position, elbow);
        arm.fore.between(elbow, wrist.clone().addScaledVector(way, -0.02));
        arm.hand.position.copy(wrist);
        const aimed = (told?.points ?? []).map(find).filter(Boolean).map(vector)
          .find((target) => target.clone().sub(arm.to.now).normalize().dot(way) > 0.9);
        arm.finger.mesh.visible = Boolean(aimed);
        arm.finger.between(wrist, arm.to.now);
        arm.ray.between(aimed ? arm.to.now : null, aimed);
      }
      return moves;
    },
  };
}

// label: an object of the scene that stands above the head. lines: show what they look at as a line.
export function makePerson(scene, person, { label = null, lines = true } = {}) {
  const coat = choice(COATS, person.id);
  const head = personHead(scene, person.id);
  const trunk = turned(scene, [[0, -0.66], [0.15, -0.66], [0.165, -0.5], [0.16, -0.3], [0.185, -0.14], [0.165, -0.07], [0.07, -0.015], [0.05, 0.06], [0, 0.07]], coat, 0.66);
  const arms = [1, -1].map((sign) => ({ sign, upper: limb(scene, 0.045, coat), fore: limb(scene, 0.04, coat), hand: follower() }));
  const gaze = ray(scene, "#2f7fb5", false);
  const pointing = ray(scene, "#2f7fb5", true);
  if (label) scene.add(label);
  const parts = [head.group, trunk, ...arms.flatMap(({ upper, fore }) => [upper.mesh, fore.mesh])];
  const [at, looks] = [follower(), follower()];
  let [told, find] = [person, () => null];
  return {
    solid: head.group,
    show(on) {
      for (const each of parts) each.visible = on;
      if (label) label.visible = on;
    },
    put(now, where, hands) {
      [told, find] = [now, where];
      const place = vector(now.at);
      const target = now.looks?.length ? where(now.looks[0]) : null;
      at.to(place);
      looks.to((target ? vector(target).sub(place) : now.looks ? new THREE.Vector3(-0.3, 0.95, 0.1) : new THREE.Vector3(-1, 0, 0)).normalize());
      head.mimic({}, now.speaks);
      for (const [index, { sign, hand }] of arms.entries()) {
        const near = hands.map(vector).filter((each) => (each.y - now.at[1] > 0) === sign > 0);
        hand.to(near[0] ?? (hands.length === 1 && index ? vector(hands[0]) : new THREE.Vector3(place.x - 0.16, place.y + sign * 0.2, place.z - 0.5)));
      }
    },
    step(part) {
      const moves = [at, looks, ...arms.map(({ hand }) => hand)].map((each) => each.step(part)).some(Boolean);
      turn(head.group, at.now, looks.now);
      trunk.position.set(at.now.x + 0.09, at.now.y, at.now.z - 0.13);
      for (const { sign, upper, fore, hand } of arms) {
        const shoulder = trunk.position.clone().add({ x: 0, y: sign * 0.165, z: -0.13 });
        const elbow = shoulder.clone().lerp(hand.now, 0.5).add({ x: 0.03, y: sign * 0.05, z: -0.09 });
        upper.between(shoulder, elbow);
        fore.between(elbow, hand.now);
      }
      const target = told.looks?.length ? find(told.looks[0]) : null;
      gaze.between(lines && target ? at.now : null, target ? vector(target) : null);
      const pointed = told.points.map(find).filter(Boolean)[0];
      pointing.between(pointed ? arms[0].hand.now : null, pointed ? vector(pointed) : null);
      label?.position.copy(at.now).setZ(at.now.z + 0.16);
      return moves;
    },
    remove() {
      scene.remove(...parts);
      if (label) scene.remove(label);
      gaze.remove();
      pointing.remove();
    },
  };
}
