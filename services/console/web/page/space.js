// The scene in 3D. Drawn when a frame has changed it, or when somebody turns it: never for nothing.
import { CSS2DObject, CSS2DRenderer, OrbitControls, THREE } from "three";
import { isFine, keep, makePerson, makePiece, makeRobot, material, placeOf } from "./figures.js";
import { element, isDark } from "./look.js";
import { described, sceneInWords } from "./tell.js";

const VIEWS = {
  "from the side": [[1.9, 1.55, 1.8], [0.6, 0, 0.84]],
  "as the person sees it": [[1.55, 0, 1.38], [0.3, 0, 0.85]],
  "as the robot sees it": [[-0.55, 0.25, 1.75], [0.75, 0, 0.7]],
};
const UPRIGHT = 42; // degrees that the camera sees at least, upright
const ACROSS = 0.46; // tangent of half of what it sees at least from left to right: the floor is whole there
const FLOOR = 1.0; // metres from its middle to its edge: robot and people stand on it

export function space(panel, order) {
  const place = panel.querySelector(".space");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: isFine(), alpha: true });
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
    camera.fov = Math.max(UPRIGHT, (2 * Math.atan(ACROSS / camera.aspect) * 180) / Math.PI);
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
      keep(pieces, things, (thing) => makePiece(scene, thing, thing.kind === "object" ? tag(thing.label, "thing") : null), (made, thing) => made.put(thing, body));
      keep(people, state.scene.people.filter((each) => each.at && each.present), (person) => {
        const name = tag(person.id, "person");
        return Object.assign(makePerson(scene, person, { label: name }), { name });
      }, (made, person) => {
        made.put(person, placeOf(state.scene), things.filter((each) => each.owner === person.id).map((each) => each.at));
        const doing = [person.speaks ? "speaks" : "", person.nods ? `${person.nods}s` : ""].filter(Boolean).join(", ");
        const text = doing ? `${person.id} ${doing}` : person.id;
        if (made.name.element.textContent !== text) made.name.element.textContent = text;
      });
      robot.put(body, placeOf(state.scene));
      for (const each of [robot, ...pieces.values(), ...people.values()]) each.step(1);
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

function furniture(scene) {
  const sky = new THREE.HemisphereLight("#ffffff", "#8b8577", 2.1);
  const lamp = new THREE.DirectionalLight("#fff4e2", 1.6);
  lamp.position.set(1.2, 1.6, 3.2);
  const floor = new THREE.Mesh(new THREE.CircleGeometry(FLOOR, 64), material("#cfd6d8"));
  floor.position.x = 0.6; // below the table
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
