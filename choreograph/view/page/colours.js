// A colour for every take, derived from its name so that a take has nearly the same colour in every dance.

const HUES = 16; // neighbours are just distinguishable
const DARKER = 0.12; // the second round of hues, for dances with more takes

// CSS colours, and linear ones for the rim light, by take. They are equally bright because they are chosen in OKLCH.
export function takeColours(names, lightness, chroma) {
  const taken = new Set();
  return names.map((name, i) => {
    let hue = hash(name) % HUES;
    if (i % HUES === 0) taken.clear();
    // No two of one round share a hue. The later one in the alphabet gets the next free hue.
    while (taken.has(hue)) hue = (hue + 7) % HUES;
    taken.add(hue);
    const light = fromOklch(lightness - (Math.floor(i / HUES) % 2) * DARKER, chroma, (hue / HUES) * 2 * Math.PI);
    const css = light.map((x) => Math.round(255 * encoded(x)));
    return { css: `rgb(${css.join(" ")})`, light };
  });
}

const encoded = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055); // sRGB

// FNV-1a with a final mix, so that names that differ in one digit do not get adjacent hues.
function hash(text) {
  let h = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(text)) h = Math.imul(h ^ byte, 0x01000193) >>> 0;
  h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d) >>> 0;
  return (h ^ (h >>> 12)) >>> 0;
}

// Linear sRGB in 0 to 1 (Ottosson's OKLab).
function fromOklch(lightness, chroma, hue) {
  const a = chroma * Math.cos(hue), b = chroma * Math.sin(hue);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ].map((x) => Math.min(1, Math.max(0, x)));
}
