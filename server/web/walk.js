// walk.js -- a camera that turns around the room, or walks through it, by mouse, touch and keys.
//
//   turn: the camera looks at a point and circles it; a drag turns, the wheel or two fingers come nearer
//   walk: the camera stands in the room; a drag looks around, W A S D and the arrow keys walk, Q and E sink and rise

import * as THREE from "./three.module.js";

const TURN_PER_PIXEL = 0.006, STEEPEST = 1.55; // radians
const STEP_SHARE = 0.02;                        // of the room's size, for a press of a key

export class Walk {
  // up: a unit THREE.Vector3; whenMoved is called after each movement.
  constructor(canvas, camera, up, whenMoved) {
    Object.assign(this, { canvas, camera, up, whenMoved, isWalking: false, yaw: 0.6, pitch: 0.5, distance: 1, size: 1 });
    this.target = new THREE.Vector3();
    const side = Math.abs(up.x) > 0.9 ? new THREE.Vector3(0, 1, 0) : new THREE.Vector3(1, 0, 0);
    this.east = side.clone().sub(up.clone().multiplyScalar(side.dot(up))).normalize();
    this.north = new THREE.Vector3().crossVectors(up, this.east);
    this.fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const type of ["pointerup", "pointercancel"])
      canvas.addEventListener(type, (event) => this.fingers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.nearer(Math.exp(-event.deltaY * 0.001));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  // The whole of it is seen; walking starts in its middle.
  frame(centre, size) {
    this.target.copy(centre);
    this.centre = centre.clone();
    this.size = size;
    this.distance = 1.1 * size;
    this.update();
  }

  setWalking(isWalking) {
    this.isWalking = isWalking;
    this.target.copy(this.centre);
    this.pitch = isWalking ? 0 : 0.5;
    this.distance = 1.1 * this.size;
    this.update();
  }

  direction() { // from the camera
    const flat = Math.cos(this.pitch);
    return new THREE.Vector3()
      .addScaledVector(this.east, -flat * Math.cos(this.yaw))
      .addScaledVector(this.north, -flat * Math.sin(this.yaw))
      .addScaledVector(this.up, -Math.sin(this.pitch));
  }

  update() {
    const ahead = this.direction();
    this.camera.up.copy(this.up);
    this.camera.position.copy(this.target);
    if (!this.isWalking) this.camera.position.addScaledVector(ahead, -this.distance);
    this.camera.lookAt(this.camera.position.clone().add(ahead));
    this.whenMoved();
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before[0], dy = event.clientY - before[1];
    if (this.fingers.size === 2) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const reach = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      this.nearer(reach([event.clientX, event.clientY]) / reach(before));
    } else {
      this.turn(dx, dy);
    }
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  turn(dx, dy) {
    const sign = this.isWalking ? -1 : 1;
    this.yaw -= sign * dx * TURN_PER_PIXEL;
    this.pitch = Math.max(-STEEPEST, Math.min(STEEPEST, this.pitch + sign * dy * TURN_PER_PIXEL));
    this.update();
  }

  nearer(factor) {
    if (this.isWalking) this.step(Math.log(factor) * 5, 0, 0);
    else this.distance = Math.max(0.01 * this.size, Math.min(5 * this.size, this.distance / factor));
    this.update();
  }

  step(ahead, right, up) {
    const forward = this.direction(), by = STEP_SHARE * this.size;
    const aside = new THREE.Vector3().crossVectors(forward, this.up).normalize();
    this.target.addScaledVector(forward, ahead * by).addScaledVector(aside, right * by).addScaledVector(this.up, up * by);
  }

  key(event) {
    const way = { w: [1, 0, 0], s: [-1, 0, 0], a: [0, -1, 0], d: [0, 1, 0], q: [0, 0, -1], e: [0, 0, 1] }[event.key.toLowerCase()];
    const arrow = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] }[event.key];
    if (event.key === "+" || event.key === "-") this.nearer(event.key === "+" ? 1.15 : 1 / 1.15);
    else if (way && this.isWalking) this.step(...way);
    else if (arrow && this.isWalking && arrow[1] !== 0) this.step(arrow[1], 0, 0);
    else if (arrow) this.turn(arrow[0] * 20 * (this.isWalking ? 1 : -1), arrow[1] * -20);
    else return;
    event.preventDefault();
    this.update();
  }
}
