// The scene in 3D. Drawn when a frame has changed it, or when somebody turns it: never for nothing.
import { CSS2DObject, CSS2DRenderer, OrbitControls, THREE } from "three";
import { element, isDark, pieceColor } from "./look.js";
import { described, sceneInWords } from "./tell.js";

const SHOULDERS = 0.2; // metres from the middle of the trunk
const VIEWS = {
  "from the side": [[1.9, 1.55, 1.8], [0.6, 0, 0.84]],
  "as the person sees it": [[1.55, 0, 1.38], [0.3, 0, 0.85]],
  "as the robot sees it": [[-0.55, 0.25, 1.75], [0.75, 0, 0.7]],
};

const vector = (at) => new THREE.Vector3(...at);
const material = (color, more = {}) => new THREE.MeshStandardMaterial({ color, roughness: 0.75, ...more });

export function space(panel, order) {
  const place = panel.querySelector(".space");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
  } catch {
    place.replaceChildren(element("p", { class: "none" }, "This browser shows no 3D (WebGL is off). The table from above has the same."));
    return { take() {} };
  }
  const labels = new CSS2DRenderer();
  renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
  labels.domElement.className = "tags";
  place.append(renderer.domElement, labels.domElement);
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(42, 1.6, 0.05, 20);
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, labels.domElement);
  const stage = furniture(scene);
  let stale = true;
  controls.addEventListener("change", () => (stale = true));
  new ResizeObserver(() => {
    const { clientWidth: width, clientHeight: height } = place;
    if (!width || !height) return;
    renderer.setSize(width, height);
    labels.setSize(width, height);
    camera.aspect = width / height;
    camera.fov = width / height < 1.2 ? 55 : 42;
    camera.updateProjectionMatrix();
    stale = true;
  }).observe(place);

  function view(name) {
    const [from, to] = VIEWS[name];
    camera.position.set(...from);
    controls.target.set(...to);
    controls.update();
    stale = true;
  }
  view("from the side");
  panel.querySelector(".views").append(...Object.keys(VIEWS).map((name) => {
    const button = element("button", { type: "button" }, name);
    button.addEventListener("click", () => view(name));
    return button;
  }));
  const names = element("button", { type: "button", "aria-pressed": "false" }, "names");
  names.addEventListener("click", () => {
    const named = labels.domElement.classList.toggle("named");
    document.querySelector(".map")?.classList.toggle("named", named);
    names.setAttribute("aria-pressed", String(named));
    stale = true;
  });
  panel.querySelector(".views").append(names);

  const pieces = new Map();
  const people = new Map();
  let robotId = "";
  let pressed = null;
  const eye = new THREE.Raycaster();
  labels.domElement.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY]));
  labels.domElement.addEventListener("pointerup", (event) => {
    const still = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 5;
    if (!still || !document.body.classList.contains("seated")) return;
    const box = place.getBoundingClientRect();
    eye.setFromCamera(new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2), camera);
    const targets = [[robotId, robot.solid], ...[...pieces, ...people].map(([id, made]) => [id, made.solid])].filter(([, solid]) => solid);
    const hit = eye.intersectObjects(targets.map(([, solid]) => solid), true)[0];
    if (!hit) return;
    const id = targets.find(([, solid]) => solid === hit.object || solid === hit.object.parent)?.[0];
    if (id) order({ do: event.shiftKey || document.body.classList.contains("pointing") ? "point" : "look", target: id });
  });
  const robot = makeRobot(scene);
  let dark = null;
  const describe = described(place, (state) => `The scene in 3D. ${sceneInWords(state)}`);
  return {
    take(state, changed) {
      if (!changed.has("scene")) return;
      describe(state);
      const { body, things } = state.scene;
      robotId = state.robot;
      keep(pieces, things, (thing) => makePiece(scene, thing), (made, thing) => made.put(thing, body));
      keep(people, state.scene.people.filter((each) => each.at && each.present), (person) => makePerson(scene, person),
        (made, person) => made.put(person, placeOf(state.scene),
          things.filter((each) => each.owner === person.id).map((each) => each.at)));
      robot.put(body, placeOf(state.scene));
      stale = true;
    },
    tick() {
      if (dark !== isDark()) {
        dark = isDark();
        stage.theme(dark);
        stale = true;
      }
      if (!stale || place.offsetParent === null) return;
      stale = false;
      renderer.render(scene, camera);
      labels.render(scene, camera);
    },
  };
}

function placeOf(section) {
  return (id) => {
    if (id === section.robot) return section.body?.eyes ?? null;
    return (section.things.find((each) => each.id === id) ?? section.people.find((each) => each.id === id))?.at ?? null;
  };
}

function keep(known, wanted, make, put) {
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

function furniture(scene) {
  const sky = new THREE.HemisphereLight("#ffffff", "#8b8577", 2.1);
  const lamp = new THREE.DirectionalLight("#fff4e2", 1.6);
  lamp.position.set(1.2, 1.6, 3.2);
  const floor = new THREE.Mesh(new THREE.CircleGeometry(2.6, 48), material("#cfd6d8"));
  scene.add(sky, lamp, floor);
  return {
    theme(dark) {
      floor.material.color.set(dark ? "#20272c" : "#dfe4e4");
      sky.intensity = dark ? 1.5 : 2.1;
    },
  };
}

function tag(text, kind) {
  return new CSS2DObject(element("span", { class: `tag ${kind}` }, text));
}

// A piece of the world: its outline as a slab, or a ball.
function makePiece(scene, thing) {
  const isTable = thing.kind === "surface";
  const color = thing.kind === "hand" ? "#d8a47c" : isTable ? "#a98560" : pieceColor(thing.color);
  const mesh = new THREE.Mesh(new THREE.BufferGeometry(), material(color));
  mesh.add(new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: "#1f2a30" })));
  const label = thing.kind === "object" ? tag(thing.label, "thing") : null;
  if (label) scene.add(label);
  scene.add(mesh);
  let drawnAs = "";
  return {
    solid: thing.kind === "object" ? mesh : null,
    put(now, body) {
      const height = isTable ? 0.03 : 0.014;
      const key = JSON.stringify([now.outline, now.at]);
      if (key !== drawnAs) {
        drawnAs = key;
        mesh.geometry.dispose();
        if (now.outline.length) {
          const shape = new THREE.Shape(now.outline.map(([x, y]) => new THREE.Vector2(x, y)));
          mesh.geometry = new THREE.ExtrudeGeometry(shape, { depth: height, bevelEnabled: false });
          mesh.position.z = now.at[2] - (isTable ? height : 0);
        } else {
          mesh.geometry = new THREE.SphereGeometry(thing.kind === "hand" ? 0.04 : Math.max(now.radius, 0.02), 16, 12);
          mesh.position.set(...now.at);
        }
        const [edges] = mesh.children;
        edges.geometry.dispose();
        edges.geometry = now.outline.length && !isTable ? new THREE.EdgesGeometry(mesh.geometry) : new THREE.BufferGeometry();
        label?.position.set(now.at[0], now.at[1], now.at[2] + 0.035);
      }
      const meant = body && (body.looks_at === now.id || body.points.includes(now.id));
      mesh.material.emissive.set(meant && thing.kind === "object" ? pieceColor(now.color) : "#000000");
      mesh.material.emissiveIntensity = meant ? 0.45 : 0;
      label?.element.classList.toggle("meant", Boolean(meant));
    },
    remove() {
      scene.remove(mesh);
      if (label) scene.remove(label);
    },
  };
}

const ALONG = new THREE.Vector3(0, 1, 0);
function limb(scene, radius, color, more) {
  const mesh = new THREE.Mesh(new THREE.CapsuleGeometry(radius, 1, 4, 10), material(color, more));
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

function ray(scene, color, dashed) {
  const options = { color, transparent: true, opacity: 0.95 };
  const made = new THREE.Line(new THREE.BufferGeometry(),
    dashed ? new THREE.LineDashedMaterial({ ...options, dashSize: 0.03, gapSize: 0.02 }) : new THREE.LineBasicMaterial(options));
  made.visible = false;
  scene.add(made);
  return {
    between(from, to) {
      made.visible = Boolean(from && to);
      if (!made.visible) return;
      made.geometry.setFromPoints([from, to]);
      made.computeLineDistances();
    },
    remove: () => scene.remove(made),
  };
}

// A head that faces along its own x axis.
function makeHead(scene, color) {
  const group = new THREE.Group();
  const skull = new THREE.Mesh(new THREE.SphereGeometry(0.095, 24, 18), material(color));
  skull.scale.set(0.95, 0.85, 1.15);
  skull.position.set(-0.06, 0, -0.015);
  group.add(skull);
  const lids = [];
  for (const side of [1, -1]) {
    const eye = new THREE.Mesh(new THREE.SphereGeometry(0.02, 14, 10), material("#ffffff", { roughness: 0.3 }));
    const pupil = new THREE.Mesh(new THREE.SphereGeometry(0.011, 12, 8), material("#14202a", { roughness: 0.2 }));
    eye.position.set(0.012, side * 0.034, 0.012);
    pupil.position.set(0.014, 0, 0);
    eye.add(pupil);
    group.add(eye);
    lids.push(eye);
  }
  const mouth = new THREE.Mesh(new THREE.SphereGeometry(0.022, 14, 8), material("#7d3b38"));
  mouth.position.set(0.016, 0, -0.055);
  mouth.scale.set(0.35, 1, 0.16);
  group.add(mouth);
  scene.add(group);
  return {
    group,
    put(at, towards) {
      group.position.copy(at);
      const turn = Math.atan2(towards.y, towards.x);
      const dip = Math.asin(THREE.MathUtils.clamp(towards.z / (towards.length() || 1), -1, 1));
      group.rotation.set(0, 0, 0);
      group.rotateZ(turn);
      group.rotateY(-dip);
    },
    mimic(joints, speaks) {
      const shut = (value) => Math.max(0.08, 1 - Math.max(0, value ?? 0));
      lids[0].scale.z = shut(joints.left_lid);
      lids[1].scale.z = shut(joints.right_lid);
      mouth.scale.z = 0.16 + 0.55 * Math.max(joints.jaw ?? 0, speaks ? 0.15 : 0);
    },
  };
}

function makeRobot(scene) {
  const color = "#c9d3d8";
  const trunk = limb(scene, 0.11, color);
  const base = limb(scene, 0.13, "#5d6a72");
  const neck = limb(scene, 0.035, "#5d6a72");
  const bar = limb(scene, 0.055, color);
  const head = makeHead(scene, color);
  const cone = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({
    color: "#e8a33d", transparent: true, opacity: 0.2, depthWrite: false, side: THREE.DoubleSide,
  }));
  scene.add(cone);
  const arms = new Map(["left", "right"].map((side) => [side, {
    upper: limb(scene, 0.042, color), fore: limb(scene, 0.036, color), hand: limb(scene, 0.03, "#5d6a72"),
    ray: ray(scene, "#d2483e", true),
  }]));
  const all = [trunk.mesh, base.mesh, neck.mesh, bar.mesh, head.group];
  return {
    solid: head.group,
    put(body, placeOf) {
      const eyes = body?.eyes ? vector(body.eyes) : null;
      for (const each of all) each.visible = Boolean(eyes);
      cone.visible = Boolean(eyes && body.gaze);
      const top = eyes ?? new THREE.Vector3(0, 0, 1.17);
      const shoulders = new THREE.Vector3(top.x - 0.05, top.y, top.z - 0.22);
      if (eyes) {
        const hip = new THREE.Vector3(0, 0, 0.55);
        base.between(new THREE.Vector3(0, 0, 0), hip);
        trunk.between(hip, shoulders.clone().setZ(shoulders.z - 0.03));
        bar.between(shoulders.clone().add({ x: 0, y: SHOULDERS, z: 0 }), shoulders.clone().add({ x: 0, y: -SHOULDERS, z: 0 }));
        neck.between(shoulders, top.clone().add({ x: -0.06, y: 0, z: -0.1 }));
        head.put(top, body.gaze ? vector(body.gaze) : new THREE.Vector3(1, 0, 0));
        head.mimic(body.joints, body.speaking);
      }
      if (cone.visible) {
        const target = placeOf(body.looks_at);
        const way = vector(body.gaze).normalize();
        const length = target ? vector(target).distanceTo(eyes) : 1.2;
        cone.geometry.dispose();
        cone.geometry = new THREE.ConeGeometry(length * Math.tan(body.spread), length, 28, 1, true);
        cone.position.copy(eyes).addScaledVector(way, length / 2);
        cone.quaternion.setFromUnitVectors(ALONG, way.clone().negate());
      }
      for (const [side, arm] of arms) {
        const shown = body?.arms.find((each) => each.side === side);
        for (const part of [arm.upper, arm.fore, arm.hand]) part.mesh.visible = Boolean(shown);
        if (!shown) {
          arm.ray.between(null, null);
          continue;
        }
        const [elbow, hand] = [vector(shown.elbow), vector(shown.hand)];
        const sign = side === "left" ? 1 : -1;
        arm.upper.between(shoulders.clone().add({ x: 0, y: sign * SHOULDERS, z: 0 }), elbow);
        const way = hand.clone().sub(elbow).normalize();
        arm.fore.between(elbow, hand.clone().addScaledVector(way, -0.07));
        arm.hand.between(hand.clone().addScaledVector(way, -0.05), hand);
        const aimed = body.points.map(placeOf).filter(Boolean).map(vector)
          .find((target) => target.clone().sub(hand).normalize().dot(way) > 0.9);
        arm.ray.between(aimed ? hand : null, aimed);
      }
    },
  };
}

function makePerson(scene, person) {
  const head = makeHead(scene, "#d8a47c");
  const trunk = limb(scene, 0.14, "#4d7f8f");
  const arms = [limb(scene, 0.04, "#4d7f8f"), limb(scene, 0.04, "#4d7f8f")];
  const gaze = ray(scene, "#2f7fb5", false);
  const pointing = ray(scene, "#2f7fb5", true);
  const name = tag(person.id, "person");
  scene.add(name);
  return {
    solid: head.group,
    put(now, placeOf, hands) {
      const at = vector(now.at);
      const target = now.looks?.length ? placeOf(now.looks[0]) : null;
      const towards = target ? vector(target).sub(at) : now.looks ? new THREE.Vector3(-0.3, 0.95, 0.1) : new THREE.Vector3(-1, 0, 0);
      head.put(at, towards.normalize());
      head.mimic({}, now.speaks);
      const below = new THREE.Vector3(at.x + 0.08, at.y, at.z - 0.3);
      trunk.between(below, below.clone().setZ(at.z - 0.62));
      arms.forEach((arm, index) => {
        const shoulder = below.clone().add({ x: 0, y: index ? 0.17 : -0.17, z: 0.02 });
        const rest = below.clone().add({ x: -0.1, y: index ? 0.19 : -0.19, z: -0.28 });
        const near = hands.map(vector).filter((hand) => (hand.y - at.y > 0) === Boolean(index));
        arm.between(shoulder, near[0] ?? (hands.length === 1 && index ? vector(hands[0]) : rest));
      });
      gaze.between(target ? at : null, target ? vector(target) : null);
      const pointed = now.points.map(placeOf).filter(Boolean)[0];
      pointing.between(pointed ? below : null, pointed ? vector(pointed) : null);
      name.position.set(at.x, at.y, at.z + 0.16);
      const doing = [now.speaks ? "speaks" : "", now.nods ? `${now.nods}s` : ""].filter(Boolean).join(", ");
      const text = doing ? `${now.id} ${doing}` : now.id;
      if (name.element.textContent !== text) name.element.textContent = text;
    },
    remove() {
      scene.remove(head.group, trunk.mesh, arms[0].mesh, arms[1].mesh, name);
      gaze.remove();
      pointing.remove();
    },
  };
}
