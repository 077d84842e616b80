// The page of a dance on the user's character.

import { CharacterRenderer } from "./character_renderer.js";
import { consumeText, inflate } from "./decompress.js";
import { createElement } from "./elements.js";
import { Figure, NOBODY } from "./figure.js";
import { notice, openPage } from "./page.js";

// A separate script that defines the global `Three`.
async function loadThree() {
  const code = new TextDecoder().decode(await inflate(consumeText("three")));
  document.head.append(createElement("script", "", [code]));
}

// The character, and its errors. In the worst case, the stage is empty.
async function loadFigure(dance) {
  const lost = [];
  const manager = new Three.LoadingManager(undefined, undefined, () => { lost[0] = "a texture cannot be read"; });
  try {
    const { buffer } = await inflate(consumeText("character"));
    const gltf = await new Three.GLTFLoader(manager).parseAsync(buffer, "");
    const joints = await Promise.all(dance.nodes.map((node) => gltf.parser.getDependency("node", node)));
    return { figure: new Figure(gltf, joints, dance), trouble: lost[0] };
  } catch (error) {
    return { figure: NOBODY, trouble: error.message };
  }
}

const dance = JSON.parse(consumeText("dance"));
await loadThree();
const { figure, trouble } = await loadFigure(dance);
await openPage(dance, figure, CharacterRenderer.open(document.getElementById("view")));
if (trouble) notice(`The character cannot be shown correctly: ${trouble}`);
