// tar.js -- a folder as a tar archive (POSIX.1-2001, pax) that is read only while it is sent: a Blob of headers and files.

const BLOCK = 512, NAME_BYTES = 100;
const encode = (text) => new TextEncoder().encode(text);

function header(name, size, type) {
  const block = new Uint8Array(BLOCK);
  const put = (at, text) => block.set(encode(text), at);
  const octal = (value, digits) => value.toString(8).padStart(digits, "0");
  block.set(encode(name).slice(0, NAME_BYTES), 0);
  put(100, "0000644\0" + "0000000\0" + "0000000\0");
  put(124, octal(type === "x" ? size : Math.min(size, 8 ** 11 - 1), 11) + "\0" + octal(0, 11) + "\0" + "        " + type);
  put(257, "ustar\0" + "00");
  put(148, octal(block.reduce((sum, byte) => sum + byte, 0), 6) + "\0 ");
  return block;
}

// "LENGTH KEY=VALUE\n", where LENGTH counts itself.
function record(key, value) {
  const rest = encode(` ${key}=${value}\n`).length;
  let length = rest + String(rest).length;
  if (String(length).length > String(rest).length) length++;
  return `${length} ${key}=${value}\n`;
}

const padding = (size) => new Uint8Array((BLOCK - size % BLOCK) % BLOCK);

// files: [{path, file}], without a folder of their own above all of them.
export function tar(files) {
  const parts = [];
  for (const { path, file } of files) {
    const bytes = encode(path), isPlain = bytes.length <= NAME_BYTES && bytes.every((byte) => byte < 128);
    const extended = (isPlain ? "" : record("path", path)) + (file.size < 8 ** 11 ? "" : record("size", String(file.size)));
    if (extended) {
      const body = encode(extended);
      parts.push(header("pax", body.length, "x"), body, padding(body.length));
    }
    parts.push(header(path, file.size, "0"), file, padding(file.size));
  }
  parts.push(new Uint8Array(2 * BLOCK));
  return new Blob(parts);
}

// --- what a drop or a choice of files means -----------------------------------------------------

async function walk(entry, path, found) {
  if (entry.isFile) {
    found.push({ path: path + entry.name, file: await new Promise((done, failed) => entry.file(done, failed)) });
    return;
  }
  const reader = entry.createReader();
  for (;;) { // it gives some at a time
    const some = await new Promise((done, failed) => reader.readEntries(done, failed));
    if (some.length === 0) return;
    for (const child of some) await walk(child, `${path}${entry.name}/`, found);
  }
}

const ARCHIVE = /\.(zip|tar|tar\.gz|tgz|tar\.zst)$/i;
const isHidden = (path) => path.split("/").some((part) => part.startsWith("."));

// {name, blob} of what is to be sent: an archive as it is, a folder or several files as a tar.
export function bundle(files) {
  const shown = files.filter(({ path }) => !isHidden(path)).sort((a, b) => (a.path < b.path ? -1 : 1));
  if (shown.length === 0) throw new Error("there are no files in it");
  if (shown.length === 1 && ARCHIVE.test(shown[0].path))
    return { name: shown[0].file.name.replace(ARCHIVE, "").slice(0, 100) || "room", blob: shown[0].file, stamp: String(shown[0].file.lastModified) };
  const top = shown[0].path.split("/")[0] + "/", isFolder = shown.every(({ path }) => path.startsWith(top));
  const inside = shown.map(({ path, file }) => ({ path: isFolder ? path.slice(top.length) : path, file }));
  return { name: isFolder ? top.slice(0, -1).slice(0, 100) : "room", blob: tar(inside),
    stamp: String(Math.max(...shown.map(({ file }) => file.lastModified))) };
}

export const chosenFiles = (list) => [...list].map((file) => ({ path: file.webkitRelativePath || file.name, file }));

export async function droppedFiles(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean), found = [];
  if (entries.length === 0) return chosenFiles(transfer.files);
  for (const entry of entries) await walk(entry, "", found);
  return found;
}
