// The scene in 3D, as large as the page: figures that move smoothly, light, shadows, and the looks that pass between them.
import { THREE } from "three";
import { CALM, isFine, keep, makePerson, makePiece, makeRobot, makeStool, placeOf, vector } from "../page/figures.js";

const SMOOTH = 0.09; // seconds in which a figure comes two thirds nearer to where it is to be
const SLOW = 45; // ms of a picture above which it gives up shadows and fine dots: without a graphics card
const OFTEN = 4; // pictures in a row that are slow: the first one or two are slow everywhere
const COARSE = [1, 0.7, 0.5]; // dots of a picture for one of the page, one after the other, until it is not slow any more
const LEANS = 0.15; // metres by which a head moves while the robot stays where it is
const ROOM = 0.1; // metres around a thing that are in view
const WIDE = 34; // degrees that the camera sees, upright
const FROM = { // where the camera stands, from the middle: of somebody at the table, and of who looks on
  wide: { seat: [1, 0, 0.5], side: [0.5, 1, 0.4] },
  tall: { seat: [1, 0, 0.78], side: [0.95, 0.62, 0.42] },
};
const SEAT = [1.25, 0, 0]; // where somebody would sit
const FEET = { robot: 0.21, table: 0.21, stool: 0.19, seat: 0.53 }; // metres: how far figures reach on the floor, and how high the seat is
const LIGHTS = {
  light: { sky: "#ffffff", ground: "#d8c7b0", ambient: 2.0, lamp: "#fff1dc", strength: 2.0, shadow: 0.2, cone: 0.34 },
  dark: { sky: "#8fa6d8", ground: "#241c2b", ambient: 1.1, lamp: "#ffdca8", strength: 2.4, shadow: 0.45, cone: 0.5 },
};

export function scene(place, insets) {
  const fine = isFine();
  const renderer = new THREE.WebGLRenderer({ antialias: fine, alpha: true, powerPreference: "low-power" });
  renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
  renderer.shadowMap.enabled = fine;
  renderer.shadowMap.type = THREE.PCFSoftShadowMap;
  renderer.toneMapping = THREE.ACESFilmicToneMapping;
  place.append(renderer.domElement);
  const world = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(WIDE, 1, 0.05, 30);
  camera.up.set(0, 0, 1);
  const light = lights(world);
  const robot = makeRobot(world);
  const stool = makeStool(world, SEAT);
  const pieces = new Map();
  const people = new Map();
  const looks = makeLooks(world);

  let told = null;
  let you = "";
  let isStale = true;
  let isStill = false;
  let last = 0;
  let cost = 0; // ms of a picture of late
  let slow = 0; // pictures in a row that took too long
  let coarse = -1; // which of COARSE it has come to
  let drawn = 0; // when the last picture was begun, if the browser has not come back since
  const eye = { from: new THREE.Vector3(...FROM.wide.side), at: new THREE.Vector3(0.5, 0, 0.85), far: 4 };

  const size = () => {
    const { clientWidth: width, clientHeight: height } = place;
    if (!width || !height) return;
    renderer.setSize(width, height);
    camera.aspect = width / height;
    last = 0; // it is at once where it is to be: a window that changes is no journey
    isStale = true;
  };
  new ResizeObserver(size).observe(place);

  // A picture is drawn after it was asked for, by another process or a card: until it is, the browser does not come back.
  function weigh(now) {
    if (!drawn || CALM.matches) return;
    const took = Math.min(now - drawn, 250); // a page that was hidden comes back late, too
    drawn = 0;
    cost += (took - cost) * 0.1;
    slow = took > SLOW ? slow + 1 : 0;
    if (slow < OFTEN || coarse === COARSE.length - 1) return;
    slow = 0;
    coarse += 1;
    renderer.shadowMap.enabled = false;
    renderer.setPixelRatio(COARSE[coarse]);
    world.traverse((each) => each.material && (each.material.needsUpdate = true));
  }

  let top = [0, 0, 1.17]; // where its eyes are, but for what they do as it nods and leans: that does not move the camera
  const company = () => Boolean(told?.people.some((each) => each.at && each.present));
  // Everything that has to be in view: the table, the robot, and who is there; with a seat that is free all of it, from the floor on.
  function inView() {
    const body = told?.body;
    const eyes = body?.eyes ?? [0, 0, 1.17];
    if (top.some((each, index) => Math.abs(each - eyes[index]) > LEANS)) top = eyes;
    const found = [[top[0] - 0.1, top[1], top[2] + 0.15], [0, -0.3, top[2] - 0.25], [0, 0.3, top[2] - 0.25]];
    const square = ([x, y], far, z) => found.push(...[-far, far].flatMap((a) => [-far, far].map((b) => [x + a, y + b, z])));
    for (const thing of told?.things ?? []) {
      if (thing.kind === "surface") found.push(...thing.outline.map(([x, y]) => [x, y, thing.at[2]]));
      if (thing.kind === "surface" && !you) square(thing.at, FEET.table, 0);
      if (thing.kind === "object") square(thing.at, ROOM, thing.at[2]);
    }
    if (!you) square([0, 0], FEET.robot, 0);
    if (!you && !company()) for (const z of [0, FEET.seat]) square(SEAT, FEET.stool, z);
    for (const person of told?.people ?? []) {
      if (!person.present || !person.at || person.id === you) continue;
      const [x, y, z] = person.at;
      found.push([x + 0.1, y, z + 0.2], [x + 0.1, y - 0.22, z - 0.4], [x + 0.1, y + 0.22, z - 0.4]);
    }
    return found.map(vector);
  }

  // Aim the camera so that all of this is seen between the bars: the middle and the distance, from a direction.
  const goal = { at: eye.at.clone(), far: eye.far };
  function aim(points, direction) {
    const { top, bottom, left: before, right: behind } = insets();
    const { clientWidth: width, clientHeight: height } = place;
    const box = { left: -1 + (2 * before) / width, right: 1 - (2 * behind) / width, top: 1 - (2 * top) / height, bottom: -1 + (2 * bottom) / height };
    const probe = camera.clone();
    const middle = points.reduce((sum, each) => sum.add(each), new THREE.Vector3()).divideScalar(points.length);
    let far = 4;
    for (let round = 0; round < 12; round += 1) {
      probe.position.copy(middle).addScaledVector(direction, far);
      probe.lookAt(middle);
      probe.updateProjectionMatrix();
      probe.updateMatrixWorld();
      const seen = points.map((each) => each.clone().project(probe));
      const [left, right] = [Math.min(...seen.map(({ x }) => x)), Math.max(...seen.map(({ x }) => x))];
      const [low, high] = [Math.min(...seen.map(({ y }) => y)), Math.max(...seen.map(({ y }) => y))];
      const grown = Math.max((right - left) / (box.right - box.left), (high - low) / (box.top - box.bottom));
      far = Math.max(0.9, far * (0.35 + 0.65 * grown));
      const tall = Math.tan(THREE.MathUtils.degToRad(WIDE / 2)) * far;
      const [across, up] = [new THREE.Vector3(), new THREE.Vector3()];
      probe.matrixWorld.extractBasis(across, up, new THREE.Vector3());
      middle.addScaledVector(across, ((left + right - box.left - box.right) / 2) * tall * probe.aspect * 0.8);
      middle.addScaledVector(up, ((low + high - box.top - box.bottom) / 2) * tall * 0.8);
    }
    goal.at.copy(middle);
    goal.far = far;
  }

  // The direction from the middle of the table to where the camera is, for who sits there: behind their own place.
  function fromSeat() {
    const [x, y] = told?.people.find((each) => each.id === you)?.at ?? SEAT;
    const [across, along] = told?.things.find(({ kind }) => kind === "surface")?.at ?? [0, 0];
    return Math.atan2(y - along, x - across);
  }

  // Returns how far the camera still is from there.
  function look(part, now, isCalm) {
    const direction = new THREE.Vector3(...FROM[camera.aspect > 1 ? "wide" : "tall"][you ? "seat" : "side"]).normalize();
    if (you) direction.applyAxisAngle(camera.up, fromSeat());
    else if (!isCalm) direction.applyAxisAngle(camera.up, 0.16 * Math.sin(now / 9)); // it goes to and fro, slowly
    aim(inView(), direction);
    const swing = part === 1 ? 1 : part * 0.45;
    eye.from.lerp(direction, swing).normalize();
    eye.at.lerp(goal.at, swing);
    eye.far += (goal.far - eye.far) * swing;
    camera.fov = WIDE;
    camera.position.copy(eye.at).addScaledVector(eye.from, eye.far);
    camera.lookAt(eye.at);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    return eye.from.distanceToSquared(direction) + eye.at.distanceToSquared(goal.at) + (eye.far - goal.far) ** 2;
  }

  const own = {
    take(section, person) {
      told = section;
      if (you !== person) renderer.shadowMap.needsUpdate = true;
      you = person;
      const where = placeOf(section);
      keep(pieces, section.things, (thing) => makePiece(world, thing), (made, thing) => made.put(thing, section.body));
      keep(people, section.people.filter((each) => each.at && each.present), (each) => makePerson(world, each, { lines: false }), (made, each) => {
        made.put(each, where, section.things.filter((thing) => thing.owner === each.id).map((thing) => thing.at));
        made.show(each.id !== you);
      });
      stool.show(!company());
      const acts = section.people.find((each) => each.id === you)?.acts.length;
      for (const thing of section.things) if (thing.kind === "hand") pieces.get(thing.id).mesh.visible = thing.owner !== you || Boolean(acts);
      robot.put(section.body, where);
      if (you && section.body?.looks_at === you) robot.cone.visible = false; // one sees its eyes
      isStale = true;
    },
    // bonds: looks that are shared shine. Returns whether something was drawn.
    draw(now, bonds, dark) {
      weigh(performance.now());
      const passed = Math.min(0.25, now - last);
      const part = last === 0 || CALM.matches ? 1 : 1 - Math.exp(-passed / SMOOTH);
      const isCalm = CALM.matches || cost > SLOW; // nothing moves but what moves out there
      const isDrifting = !you && !isCalm;
      if (!isStale && !isDrifting) return false;
      if (passed < (cost > SLOW ? 0.15 : 0.015)) return false;
      last = now;
      drawn = performance.now();
      const moves = [robot, ...pieces.values(), ...people.values()].map((each) => each.step(part)).some(Boolean);
      const turns = look(part, now, isCalm);
      const lives = looks.draw(told, you, bonds, now, isCalm);
      light.theme(dark ? LIGHTS.dark : LIGHTS.light, robot.cone);
      isStill = turns < 1e-4;
      isStale = moves || turns > 1e-6 || lives;
      renderer.render(world, camera);
      return true;
    },
    // Where a place of the world is on the page, in CSS pixels.
    onPage(at) {
      const seen = vector(at).project(camera);
      return { x: ((seen.x + 1) / 2) * place.clientWidth, y: ((1 - seen.y) / 2) * place.clientHeight, ahead: seen.z < 1 };
    },
    // What is touched at a place of the page: the id of the nearest thing or head within `room` pixels; null: nothing.
    touched(x, y, room) {
      const heads = told?.people.filter((each) => each.at && each.present && each.id !== you).map(({ id, at }) => [id, at, room * 1.6]) ?? [];
      if (told?.body?.eyes) heads.push([told.robot, told.body.eyes, room * 2]);
      const things = told?.things.filter(({ kind }) => kind === "object").map(({ id, at }) => [id, at, room]) ?? [];
      const found = [...heads, ...things].map(([id, at, most]) => {
        const { x: left, y: top } = own.onPage(at);
        return { id, far: Math.hypot(left - x, top - y), most };
      }).filter(({ far, most }) => far <= most);
      return found.sort((a, b) => a.far - b.far)[0]?.id ?? null;
    },
    // The place at a height of the world that lies under a place of the page.
    onTable(x, y, height) {
      const to = new THREE.Vector3((x / place.clientWidth) * 2 - 1, 1 - (y / place.clientHeight) * 2, 0.5).unproject(camera);
      const way = to.sub(camera.position);
      if (way.z >= 0) return null;
      return camera.position.clone().addScaledVector(way, (height - camera.position.z) / way.z).toArray();
    },
    // Show a piece where somebody drags it, before it is there.
    drag(id, at) {
      pieces.get(id)?.put({ ...told.things.find((each) => each.id === id), at, outline: moved(told.things.find((each) => each.id === id), at) }, told.body);
      isStale = true;
    },
    // The camera is where it is to be.
    get isStill() {
      return isStill;
    },
  };
  return own;
}

function moved(thing, at) {
  return thing.outline.map(([x, y]) => [x - thing.at[0] + at[0], y - thing.at[1] + at[1]]);
}

function lights(world) {
  const sky = new THREE.HemisphereLight();
  sky.position.set(0, 0, 1);
  const lamp = new THREE.DirectionalLight();
  lamp.position.set(1.3, 1.1, 3.2);
  lamp.target.position.set(0.5, 0, 0.6);
  lamp.castShadow = true;
  lamp.shadow.mapSize.set(1024, 1024);
  lamp.shadow.radius = 6;
  lamp.shadow.bias = -0.0006;
  lamp.shadow.normalBias = 0.02;
  Object.assign(lamp.shadow.camera, { left: -1.6, right: 1.6, top: 1.6, bottom: -1.6, near: 0.5, far: 6 });
  const back = new THREE.DirectionalLight("#9fc4ff", 0.9);
  back.position.set(-1.4, -1.2, 1.8);
  const ground = new THREE.Mesh(new THREE.CircleGeometry(4, 64), new THREE.ShadowMaterial());
  ground.receiveShadow = true;
  world.add(sky, lamp, lamp.target, back, ground);
  return {
    theme(now, cone) {
      sky.color.set(now.sky);
      sky.groundColor.set(now.ground);
      sky.intensity = now.ambient;
      lamp.color.set(now.lamp);
      lamp.intensity = now.strength;
      ground.material.opacity = now.shadow;
      cone.material.opacity = now.cone;
    },
  };
}

// Looks one can see: a row of lights from the eyes of each person to what they look at, and a ring around that.
const BEADS = 14;
function makeLooks(world) {
  const known = new Map();
  const bead = new THREE.SphereGeometry(0.008, 10, 8);
  const ringShape = new THREE.TorusGeometry(0.05, 0.005, 10, 44);
  const make = (id) => {
    const own = new THREE.MeshBasicMaterial({ color: id === "robot" ? "#ff9d2e" : "#2f9be0", transparent: true });
    const beads = new THREE.InstancedMesh(bead, own, BEADS);
    const ring = new THREE.Mesh(ringShape, own);
    beads.frustumCulled = false;
    world.add(beads, ring);
    return { beads, ring, own, on: 0 };
  };
  const at = new THREE.Matrix4();
  return {
    // Returns whether it goes on to move.
    draw(told, you, bonds, now, still) {
      if (!told) return false;
      const where = placeOf(told);
      const rows = told.people.filter((each) => each.present && each.at).map(({ id, at: from, looks }) => [id, from, looks?.[0] ?? "", false]);
      if (told.body?.eyes) rows.push(["robot", told.body.eyes, told.body.looks_at, true]);
      const ids = new Set(rows.map(([id]) => id));
      for (const [id, { beads, ring }] of known) {
        if (ids.has(id)) continue;
        world.remove(beads, ring);
        known.delete(id);
      }
      let lives = false;
      for (const [id, from, target, isRobot] of rows) {
        if (!known.has(id)) known.set(id, make(id));
        const { beads, ring, own } = known.get(id);
        const to = target ? where(target) : null;
        beads.visible = Boolean(to) && !isRobot && id !== you; // the robot's look is its light; one does not see one's own
        const thing = told.things.find((each) => each.id === target && each.kind === "object");
        ring.visible = Boolean(thing);
        const shared = bonds.some(({ kind, met, by, to: other, about }) => met && [by, other].includes(isRobot ? told.robot : id) && (kind === "mutual_facial_gaze" ? !thing : kind === "directed_gaze" && about.includes(target)));
        own.color.set(shared ? "#22b573" : isRobot ? "#ff9d2e" : "#2f9be0");
        if (beads.visible) {
          const [a, b] = [vector(from), vector(to)];
          const drift = still ? 0 : (now * (shared ? 0.9 : 0.5)) % 1;
          for (let index = 0; index < BEADS; index += 1) {
            const along = 0.08 + 0.88 * ((index + drift) / BEADS);
            at.makeScale(...Array(3).fill((shared ? 1.5 : 1) * Math.sin(Math.PI * Math.min(1, along * 1.05)) + 0.15));
            at.setPosition(a.clone().lerp(b, along));
            beads.setMatrixAt(index, at);
          }
          beads.instanceMatrix.needsUpdate = true;
          lives = !still;
        }
        if (ring.visible) {
          const wide = Math.max(0.035, ...thing.outline.map(([x, y]) => Math.hypot(x - thing.at[0], y - thing.at[1])));
          const pulse = still ? 1 : 1 + 0.06 * Math.sin(now * 4);
          ring.scale.setScalar((wide / 0.05) * (isRobot ? 1.18 : 1.02) * pulse);
          ring.position.set(thing.at[0], thing.at[1], thing.at[2] + 0.017);
          lives = lives || !still;
        }
      }
      return lives;
    },
  };
}
