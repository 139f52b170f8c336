// exr.js -- reads the pictures that the server's renders write: OpenEXR 2 scan lines of R, G, B in half or float, without
// compression or with ZIP (https://openexr.com/en/latest/OpenEXRFileLayout.html).

const MAGIC = 20000630, TILED_OR_PARTS = 0x1a00; // flags of version that stand for other layouts
const HALF = 1, FLOAT = 2, BYTES = { [HALF]: 2, [FLOAT]: 4 };
const LINES = { 0: 1, 2: 1, 3: 16 };             // of a chunk: no compression, ZIPS, ZIP

let halves = null;

// The value of each binary16 pattern.
function halfTable() {
  if (halves) return halves;
  halves = new Float32Array(65536);
  for (let h = 0; h < 65536; h++) {
    const exponent = (h >> 10) & 31, fraction = h & 1023, sign = h & 0x8000 ? -1 : 1;
    halves[h] = sign * (exponent === 0 ? fraction * 2 ** -24
      : exponent === 31 ? (fraction ? NaN : Infinity) : (1 + fraction / 1024) * 2 ** (exponent - 15));
  }
  return halves;
}

function text(view, at) {
  let end = at;
  while (view.getUint8(end) !== 0) end++;
  return [new TextDecoder().decode(new Uint8Array(view.buffer, at, end - at)), end + 1];
}

// [{name, type}] in the file's order.
function readChannels(view, at) {
  const channels = [];
  while (view.getUint8(at) !== 0) {
    const [name, next] = text(view, at);
    channels.push({ name, type: view.getInt32(next, true) });
    at = next + 16;
  }
  return channels;
}

function readHeader(view) {
  if (view.getUint32(0, true) !== MAGIC || view.getUint32(4, true) & TILED_OR_PARTS)
    throw new Error("not an EXR of scan lines");
  const header = {};
  let at = 8;
  while (view.getUint8(at) !== 0) {
    const [name, type] = text(view, at), [, size] = text(view, type), first = size + 4;
    if (name === "channels") header.channels = readChannels(view, first);
    if (name === "compression") header.compression = view.getUint8(first);
    if (name === "dataWindow") header.window = [0, 4, 8, 12].map((i) => view.getInt32(first + i, true));
    at = first + view.getUint32(size, true);
  }
  const [left, top, right, bottom] = header.window;
  Object.assign(header, { width: right - left + 1, height: bottom - top + 1, top, chunks: at + 1, lines: LINES[header.compression] });
  if (!header.lines || header.channels.some(({ type }) => !BYTES[type])) throw new Error("an EXR of another kind");
  return header;
}

// A chunk's bytes before compression: the two halves were split, and each byte is the difference from the one before.
async function expand(data, size) {
  if (data.length === size) return data;
  const stream = new Blob([data]).stream().pipeThrough(new DecompressionStream("deflate"));
  const split = new Uint8Array(await new Response(stream).arrayBuffer()), whole = new Uint8Array(size), half = (size + 1) >> 1;
  if (split.length !== size) throw new Error("an EXR that is damaged");
  for (let i = 1; i < size; i++) split[i] += split[i - 1] - 128;
  for (let i = 0; i < size; i++) whole[i] = split[(i & 1 ? half : 0) + (i >> 1)];
  return whole;
}

// Puts the lines of a chunk, each with its channels one after another, into rgb.
function place(bytes, header, first, count, rgb) {
  const view = new DataView(bytes.buffer, bytes.byteOffset), table = halfTable();
  let at = 0;
  for (let y = first; y < first + count; y++)
    for (const { name, type } of header.channels) {
      const c = "RGB".indexOf(name);
      for (let x = 0; x < header.width && c >= 0; x++)
        rgb[3 * (y * header.width + x) + c] = type === HALF ? table[view.getUint16(at + 2 * x, true)] : view.getFloat32(at + 4 * x, true);
      at += BYTES[type] * header.width;
    }
}

// {width, height, rgb: Float32Array of 3 x width x height} of an ArrayBuffer.
export async function readExr(buffer) {
  const view = new DataView(buffer), header = readHeader(view), { width, height, lines, top, chunks } = header;
  const rgb = new Float32Array(3 * width * height), lineBytes = header.channels.reduce((sum, { type }) => sum + BYTES[type], 0) * width;
  await Promise.all([...Array(Math.ceil(height / lines)).keys()].map(async (i) => {
    const at = Number(view.getBigUint64(chunks + 8 * i, true)), first = view.getInt32(at, true) - top;
    const count = Math.min(lines, height - first), data = new Uint8Array(buffer, at + 8, view.getUint32(at + 4, true));
    place(await expand(data, lineBytes * count), header, first, count, rgb);
  }));
  return { width, height, rgb };
}
