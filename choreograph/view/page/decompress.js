// Decodes the data that view/page.py encodes.

import { rotationVectorInto } from "./math.js";

export function fromBase64(text) {
  const raw = atob(text.trim());
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

// The text of a data element, which is removed: a song in base64 is large and read once.
export function consumeText(id) {
  const element = document.getElementById(id);
  const text = element.textContent;
  element.remove();
  return text;
}

export async function inflate(text) {
  const stream = new Blob([fromBase64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// roots (T, 3) in metres and quaternions (T, J, 4), flat.
export async function decompressMotion(text, dance) {
  const joints = dance.names.length, frames = dance.frames, channels = 3 + 3 * joints;
  const planes = await inflate(text);
  const high = channels * frames;
  const steps = new Int16Array(channels * frames);
  for (let c = 0; c < channels; c++) {
    let value = 0, change = 0;
    for (let t = 0, i = c * frames; t < frames; t++, i++) {
      const folded = planes[i] | (planes[high + i] << 8);
      change = (change + ((folded >>> 1) ^ -(folded & 1))) << 16 >> 16;
      value = (value + change) << 16 >> 16;
      steps[i] = value;
    }
  }
  const roots = new Float32Array(frames * 3);
  const quats = new Float32Array(frames * joints * 4);
  const turn = dance.rotvec_step_rad;
  for (let t = 0; t < frames; t++) {
    for (let k = 0; k < 3; k++) {
      roots[3 * t + k] = steps[k * frames + t] * dance.root_step_m + dance.root_origin_m[k];
    }
    for (let j = 0; j < joints; j++) {
      const at = (3 + 3 * j) * frames + t;
      rotationVectorInto(quats, 4 * (t * joints + j), steps[at] * turn, steps[at + frames] * turn, steps[at + 2 * frames] * turn);
    }
  }
  return { roots, quats };
}

export async function decompressMesh(text, { vertices, triangles, step_m, palette }) {
  const bytes = await inflate(text);
  let at = 0;
  const next = (Kind, count) => {
    const start = at;
    at += count * Kind.BYTES_PER_ELEMENT;
    return new Kind(bytes.slice(start, at).buffer);
  };
  const places = Float32Array.from(next(Int16Array, 3 * vertices), (x) => x * step_m);
  const indices = next(Uint32Array, 3 * triangles);
  const joints = next(Uint16Array, 2 * vertices);
  const weights = next(Uint8Array, vertices);
  const normals = next(Int8Array, 3 * vertices);
  const parts = next(Uint8Array, vertices);
  const colours = new Uint8Array(3 * vertices);
  parts.forEach((part, v) => palette[part].forEach((x, k) => (colours[3 * v + k] = Math.round(255 * x))));
  return { places, indices, joints, weights, normals, colours };
}

// Peaks (N,) then RMS (N,), 0 to 255.
export async function decompressLevels(text) {
  if (!text.trim()) return { peaks: new Uint8Array(0), cores: new Uint8Array(0) };
  const planes = await inflate(text);
  const half = planes.length / 2;
  return { peaks: planes.subarray(0, half), cores: planes.subarray(half) };
}
