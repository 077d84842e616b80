// The page of a dance, or of several dancers, on the mannequin.

import { Crowd } from "./crowd.js";
import { Dancer } from "./skeleton.js";
import { Renderer } from "./renderer.js";
import { consumeText, decompressMesh, decompressMotion } from "./decompress.js";
import { openPage } from "./page.js";

const dance = JSON.parse(consumeText("dance"));
const meshText = consumeText("mesh");
// The others have the mesh of the first one in another size and other colours.
const bodies = await Promise.all([dance, ...(dance.others ?? [])].map(async (other, i) => {
  const own = { ...dance, ...other };
  const motion = await decompressMotion(consumeText(i ? `motion-${i + 1}` : "motion"), own);
  return { dancer: new Dancer(own, motion), mesh: await decompressMesh(meshText, own.mesh) };
}));
const dancers = bodies.map((body) => body.dancer);
const canvas = document.getElementById("view");
const shown = dancers.length > 1 ? new Crowd(dancers) : dancers[0];
await openPage(dance, shown, Renderer.open(canvas, bodies.map((body) => body.mesh)));
