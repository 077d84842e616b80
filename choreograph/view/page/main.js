// The page of a dance on the mannequin.

import { Dancer } from "./skeleton.js";
import { Renderer } from "./renderer.js";
import { consumeText, decompressMesh, decompressMotion } from "./decompress.js";
import { openPage } from "./page.js";

const dance = JSON.parse(consumeText("dance"));
const [motion, mesh] = await Promise.all([
  decompressMotion(consumeText("motion"), dance),
  decompressMesh(consumeText("mesh"), dance.mesh),
]);
const canvas = document.getElementById("view");
await openPage(dance, new Dancer(dance, motion), Renderer.open(canvas, mesh));
