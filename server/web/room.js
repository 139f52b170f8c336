// room.js -- a job's room in three dimensions: any of its textures on it, its segments named, picked, hidden and corrected.

import * as THREE from "./three.module.js";
import { ask, get, load, post } from "./api.js";
import { element, showEach, showFigures } from "./dom.js";
import { readPly } from "./ply.js";
import { RoomMesh } from "./room_mesh.js";
import { Walk } from "./walk.js";

const TEXTURES = [
  ["preview/base_color.png", "base colour"], ["preview/radiance.png", "measured light"], ["preview/roughness.png", "roughness"],
  ["preview/specular.png", "specular"], ["preview/emission.png", "emission"], ["preview/confidence.png", "confidence"],
];
const WIDTH = 1280;     // pixels of a render from here
const CLICK_PIXELS = 5; // a press that moves less picks
const rounded = (list) => list.map((x) => Number(x.toPrecision(3))).join(" ");

export class Room {
  // root: the element with the parts of #job-template; whenStarted is told of a job that corrections have started.
  constructor(root, whenStarted) {
    this.root = root;
    this.whenStarted = whenStarted;
    this.at = (name) => root.querySelector(`.room-${name}`);
    this.marks = new Map(); // "on" or "off" by segment
    this.image = new Image();
    this.picked = -1;
    this.at("texture").addEventListener("change", () => this.texture());
    this.at("open").addEventListener("change", () => { this.mesh?.setOpen(this.at("open").checked); this.draw(); });
    this.at("walk").addEventListener("change", () => this.walk?.setWalking(this.at("walk").checked));
    this.at("segment").addEventListener("change", () => this.pick(Number(this.at("segment").value)));
    this.at("hide").addEventListener("click", () => this.hide());
    this.at("show").addEventListener("click", () => this.showAll());
    this.at("lamp").addEventListener("click", () => this.mark("on"));
    this.at("no-lamp").addEventListener("click", () => this.mark("off"));
    this.at("correct").addEventListener("click", () => this.correct());
  }

  // outputs and segments (of report.json; [] while not known) of the job, whenever they change.
  async show(job, outputs, segments) {
    Object.assign(this, { job, outputs, segments });
    const ply = outputs.find((o) => o.name === "scene.ply");
    this.root.hidden = !ply;
    if (!ply || this.isBroken) return;
    const there = TEXTURES.filter(([name]) => outputs.some((o) => o.name === name));
    showEach(this.at("texture"), [["", "none"], ...there], ([name]) => name, () => element("option", null), (option, [name, title]) => {
      option.value = name;
      option.textContent = title;
    });
    if (!this.hasChosen && there.length > 0) {
      this.at("texture").value = there[0][0];
    }
    if (this.plyVersion !== ply.sha256 + ply.bytes) {
      this.plyVersion = ply.sha256 + ply.bytes;
      await this.open(ply).catch((problem) => {
        this.isBroken = true;
        this.at("note").textContent = `The room cannot be shown: ${problem.message}.`;
      });
    }
    if (this.mesh) {
      this.texture(false);
      this.names();
      this.values();
    }
  }

  async open(ply) {
    const mesh = new RoomMesh(readPly(await (await ask(ply.href.slice(1))).arrayBuffer()));
    if (!this.renderer) this.begin();
    if (this.mesh) {
      this.scene.remove(this.mesh.object);
      this.mesh.dispose();
    }
    this.mesh = mesh;
    this.textureVersion = null;
    mesh.setOpen(this.at("open").checked);
    this.scene.add(mesh.object);
    const { center, radius } = mesh.object.geometry.boundingSphere;
    this.camera.near = radius / 500;
    this.camera.far = radius * 12;
    const { clientWidth, clientHeight } = this.at("canvas");
    if (!this.walk.centre) this.walk.frame(center, radius * Math.max(1, clientHeight / clientWidth));
    for (const [segment, word] of this.marks) mesh.set(segment, 2, word === "on" ? 255 : 128);
    this.draw();
  }

  begin() {
    const canvas = this.at("canvas");
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.setClearColor(0x202428);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(60, 4 / 3, 0.01, 100);
    const up = new THREE.Vector3(...(this.up ?? [0, 1, 0])).normalize();
    this.walk = new Walk(canvas, this.camera, up, () => this.draw());
    let start = null;
    canvas.addEventListener("pointerdown", (event) => { start = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (start && Math.hypot(event.clientX - start[0], event.clientY - start[1]) < CLICK_PIXELS) this.pickAt(event);
    });
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  draw() {
    if (!this.mesh || this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      const { clientWidth, clientHeight } = this.at("canvas");
      if (!clientWidth) return;
      this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
      this.renderer.setSize(clientWidth, clientHeight, false);
      this.camera.aspect = clientWidth / clientHeight;
      this.camera.updateProjectionMatrix();
      this.renderer.render(this.scene, this.camera);
      this.frames = (this.frames ?? 0) + 1;
    });
  }

  async texture(isChosen = true) {
    this.hasChosen ||= isChosen;
    const name = this.at("texture").value, output = this.outputs.find((o) => o.name === name);
    const version = output ? name + output.sha256 : "";
    if (this.textureVersion === version) return;
    this.textureVersion = version;
    if (output) await load(this.image, output.href.slice(1));
    if (this.textureVersion !== version) return; // another was chosen meanwhile
    this.mesh.setTexture(output ? this.image : null);
    this.draw();
  }

  // The camera as transforms.json has it, of a picture WIDTH pixels wide.
  frame() {
    this.camera.updateMatrixWorld(); // it is drawn later
    const { camera } = this, h = Math.round(WIDTH / camera.aspect), e = camera.matrixWorld.elements;
    const focal = 0.5 * h / Math.tan(camera.fov * Math.PI / 360);
    return { file_path: "room", camera_model: "PINHOLE", w: WIDTH, h, fl_x: focal, fl_y: focal, cx: WIDTH / 2, cy: h / 2,
      transform_matrix: [0, 1, 2, 3].map((row) => [e[row], e[row + 4], e[row + 8], e[row + 12]]) };
  }

  // A render shows no more than is shown: no backs of surfaces.
  look() { return this.at("open").checked ? { look_in: true } : {}; }

  get isOutside() { return !this.walk.isWalking; }

  hidden() { return [...Array(this.mesh.segmentCount).keys()].filter((segment) => this.mesh.get(segment, 0) !== 0); }

  // --- segments -------------------------------------------------------------------------------

  about(segment) { return this.segments.find((s) => s.segment === segment); }

  title(segment) {
    const about = this.about(segment);
    return [about?.name ?? `segment ${about?.id ?? segment}`, about?.emitter ? "(lamp)" : ""].filter(Boolean).join(" ");
  }

  names() {
    const all = [...Array(this.mesh.segmentCount).keys()];
    showEach(this.at("segment"), [-1, ...all], (s) => s, () => element("option", null), (option, s) => {
      option.value = s;
      option.textContent = s < 0 ? "none" : this.title(s);
    });
    this.at("segment").value = this.picked;
  }

  pickAt(event) {
    const box = this.at("canvas").getBoundingClientRect(), raycaster = new THREE.Raycaster();
    raycaster.setFromCamera({ x: 2 * (event.clientX - box.left) / box.width - 1, y: 1 - 2 * (event.clientY - box.top) / box.height },
      this.camera);
    this.pick(this.mesh.pick(raycaster));
  }

  pick(segment) {
    if (this.picked >= 0) this.mesh.set(this.picked, 1, 0);
    this.picked = segment;
    if (segment >= 0) this.mesh.set(segment, 1, 255);
    this.at("segment").value = segment;
    this.values();
    this.draw();
  }

  values() {
    const about = this.picked >= 0 ? this.about(this.picked) : null, mark = this.marks.get(this.picked);
    for (const name of ["hide", "lamp", "no-lamp"]) this.at(name).disabled = this.picked < 0;
    this.at("correct").hidden = this.marks.size === 0;
    this.at("correct").textContent = `Reconstruct anew with ${this.marks.size} correction${this.marks.size > 1 ? "s" : ""}`;
    showFigures(this.at("values"), this.picked < 0 ? [] : [
      ["object", this.title(this.picked)],
      ["base colour", about && rounded(about.mean_base_color)],
      ["roughness", about && about.roughness.toFixed(2)],
      ["specular", about && about.specular.toFixed(2)],
      ["area", about && `${about.area_m2.toPrecision(3)} m²`],
      ["radiance", about?.emitter ? rounded(about.emission) : null],
      ["correction", mark && (mark === "on" ? "this is a lamp" : "is no lamp")],
    ]);
  }

  hide() {
    this.mesh.set(this.picked, 0, 255);
    this.pick(-1);
  }

  showAll() {
    for (let s = 0; s < (this.mesh?.segmentCount ?? 0); s++) this.mesh.set(s, 0, 0);
    this.draw();
  }

  // A second press takes it back.
  mark(word) {
    if (this.marks.get(this.picked) === word) this.marks.delete(this.picked);
    else this.marks.set(this.picked, word);
    this.mesh.set(this.picked, 2, { on: 255, off: 128 }[this.marks.get(this.picked)] ?? 0);
    this.values();
    this.draw();
  }

  // The same room with the same settings, and what was said of its segments.
  async correct() {
    const settings = { ...(await get(`v1/jobs/${this.job.id}`)).settings };
    for (const [segment, word] of this.marks) settings[`emitters.${segment}`] = word;
    try {
      const reply = await post("v1/jobs", { scene: this.job.scene, name: this.job.name.slice(0, 180) + ", corrected", settings });
      this.marks.clear();
      this.whenStarted(await reply.json());
    } catch (problem) {
      this.at("note").textContent = problem.message;
    }
  }
}
