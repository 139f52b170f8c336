// room_mesh.js -- the mesh of a room for three.js: one texture on it, and for each segment whether it is hidden, picked
// or marked. The shader is our own, so that colours are those of the picture whatever three.js does with them.

import * as THREE from "./three.module.js";

const ROW = 256; // segments a row of the texture of their states

const VERTEX = `
attribute float segment;
uniform sampler2D states;
uniform float rows;
varying vec2 place;
varying vec4 state;
varying vec3 seen;
void main() {
  state = texture2D(states, vec2((mod(segment, ${ROW}.0) + 0.5) / ${ROW}.0, (floor(segment / ${ROW}.0) + 0.5) / rows));
  place = uv;
  vec4 p = modelViewMatrix * vec4(position, 1.0);
  seen = p.xyz;
  gl_Position = state.r > 0.5 ? vec4(2.0, 2.0, 2.0, 1.0) : projectionMatrix * p; // hidden: outside the picture
}`;

const FRAGMENT = `
uniform sampler2D map;
uniform bool hasMap, byShape;
varying vec2 place;
varying vec4 state;
varying vec3 seen;
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  float shade = 0.35 + 0.65 * abs(dot(normal, normalize(seen)));
  vec3 color = hasMap ? texture2D(map, place).rgb : vec3(0.75);
  if (byShape || !hasMap) color *= shade;
  if (state.g > 0.5) color = mix(color, vec3(1.0, 0.55, 0.1), 0.55);
  if (state.b > 0.75) color = mix(color, vec3(1.0, 0.95, 0.3), 0.6);
  else if (state.b > 0.25) color = mix(color, vec3(0.2, 0.4, 1.0), 0.6);
  gl_FragColor = vec4(color, 1.0);
}`;

export class RoomMesh {
  constructor({ count, position, uv, segment }) {
    this.count = count;
    this.segment = segment;
    this.segmentCount = segment.reduce((most, s) => Math.max(most, s), 0) + 1;
    const rows = Math.ceil(this.segmentCount / ROW), each = new Float32Array(3 * count);
    for (let t = 0; t < count; t++) each.fill(segment[t], 3 * t, 3 * t + 3);
    this.states = new Uint8Array(4 * ROW * rows);
    this.stateTexture = new THREE.DataTexture(this.states, ROW, rows, THREE.RGBAFormat);
    this.stateTexture.minFilter = this.stateTexture.magFilter = THREE.NearestFilter;
    this.stateTexture.needsUpdate = true;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
    geometry.setAttribute("segment", new THREE.BufferAttribute(each, 1));
    geometry.computeBoundingBox();
    geometry.computeBoundingSphere();
    const material = new THREE.ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, extensions: { derivatives: true },
      uniforms: { map: { value: null }, hasMap: { value: false }, byShape: { value: false },
        states: { value: this.stateTexture }, rows: { value: rows } },
    });
    this.object = new THREE.Mesh(geometry, material);
  }

  // An image that has loaded; null: no texture.
  setTexture(image) {
    const { map, hasMap } = this.object.material.uniforms;
    map.value?.dispose();
    map.value = image && new THREE.Texture(image);
    hasMap.value = image !== null;
    if (!image) return;
    map.value.minFilter = THREE.LinearFilter; // charts lie close together: mip levels would mix them
    map.value.generateMipmaps = false;
    map.value.needsUpdate = true;
  }

  // What faces away is left out, so that one sees into the room from outside.
  setOpen(isOpen) {
    this.object.material.side = isOpen ? THREE.FrontSide : THREE.DoubleSide;
    this.object.material.needsUpdate = true;
  }

  // channel: 0 hidden, 1 picked, 2 marked (255: a lamp, 128: no lamp)
  set(segment, channel, value) {
    this.states[4 * segment + channel] = value;
    this.stateTexture.needsUpdate = true;
  }
  get(segment, channel) { return this.states[4 * segment + channel]; }

  // The nearest segment along the ray that is not hidden; -1: none.
  pick(raycaster) {
    const hit = raycaster.intersectObject(this.object)
      .find(({ faceIndex }) => this.get(this.segment[faceIndex], 0) === 0);
    return hit ? this.segment[hit.faceIndex] : -1;
  }

  dispose() {
    this.setTexture(null);
    this.object.geometry.dispose();
    this.object.material.dispose();
    this.stateTexture.dispose();
  }
}
