// ply.js -- reads scene.ply as server/export/mesh_ply.h writes it: binary, little-endian, triangles, each with its segment.

const HEADER_MAX = 1 << 17; // bytes: it has the names of segments
const FLOAT_BYTES = 4, FACE_BYTES = 1 + 3 * 4 + 2 * 4; // 3, three indices, segment, face of the input

// {count, position[9 count], uv[6 count], segment[count]}: the corners of `count` triangles, one after another.
export function readPly(buffer) {
  const header = new TextDecoder("latin1").decode(buffer.slice(0, HEADER_MAX));
  const end = header.indexOf("end_header\n");
  const vertices = Number(/element vertex (\d+)/.exec(header)?.[1]), count = Number(/element face (\d+)/.exec(header)?.[1]);
  if (end < 0 || !header.startsWith("ply\nformat binary_little_endian") || !(count > 0))
    throw new Error("scene.ply is not as expected");
  const names = [...header.slice(0, end).matchAll(/property float (\w+)/g)].map((match) => match[1]);
  const floats = names.length, s = names.indexOf("s");
  const view = new DataView(buffer, end + "end_header\n".length);
  const faces = vertices * floats * FLOAT_BYTES;
  if (s < 0 || view.byteLength < faces + count * FACE_BYTES) throw new Error("scene.ply is cut off");
  const position = new Float32Array(9 * count), uv = new Float32Array(6 * count), segment = new Uint32Array(count);
  for (let t = 0; t < count; t++) {
    const face = faces + t * FACE_BYTES;
    for (let c = 0; c < 3; c++) {
      const at = view.getUint32(face + 1 + 4 * c, true) * floats * FLOAT_BYTES;
      for (let i = 0; i < 3; i++) position[9 * t + 3 * c + i] = view.getFloat32(at + i * FLOAT_BYTES, true);
      for (let i = 0; i < 2; i++) uv[6 * t + 2 * c + i] = view.getFloat32(at + (s + i) * FLOAT_BYTES, true);
    }
    segment[t] = view.getUint32(face + 13, true);
  }
  return { count, position, uv, segment };
}
