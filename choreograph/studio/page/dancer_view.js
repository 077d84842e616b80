// The dancer on the stage: the mannequin, or the user's character, whose renderers are the dance page's.

import { CharacterRenderer } from "/page/character_renderer.js";
import { decompressMesh, decompressMotion } from "/page/decompress.js";
import { createElement } from "/page/elements.js";
import { Figure } from "/page/figure.js";
import { OrbitControls } from "/page/orbit.js";
import { Renderer } from "/page/renderer.js";
import { Dancer } from "/page/skeleton.js";
import { Stage } from "/page/stage.js";
import { get } from "./api.js";

export class DancerView {
  // canvas: its element, which is replaced when another kind of dancer is drawn.
  constructor(canvas, player, onFrame) {
    Object.assign(this, { canvas, player, onFrame, stage: null, kind: null, mesh: null });
  }

  get camera() { return this.stage?.camera ?? null; }

  wake() { this.stage?.wake(); }

  // Show the dance of a state. `motion` is its text, or that of another version of the dance.
  async show(state, { dance = state.dance, motion = null, motionPath = null } = {}) {
    if (state.character && !motion && !motionPath) return this.#showCharacter(state);
    const text = motion ?? (await get(motionPath ?? `motion?revision=${state.revision}`)).motion;
    const decoded = await decompressMotion(text, dance);
    this.mesh ??= await decompressMesh((await get("mesh")).mesh, dance.mesh);
    this.#open("mannequin", (canvas) => Renderer.open(canvas, this.mesh));
    this.stage.show(new Dancer(dance, decoded), this.player);
  }

  async #showCharacter(state) {
    await loadThree();
    const answer = await fetch(`/api/character/glb?revision=${state.revision}`);
    if (!answer.ok) throw new Error((await answer.json()).error);
    const gltf = await new Three.GLTFLoader().parseAsync(await answer.arrayBuffer(), "");
    const { names, nodes } = state.character;
    const joints = await Promise.all(nodes.map((node) => gltf.parser.getDependency("node", node)));
    this.#open("character", (canvas) => CharacterRenderer.open(canvas));
    const { renderer } = this.stage;
    if (renderer?.figure?.scene) renderer.scene.remove(renderer.figure.scene);
    this.stage.show(new Figure(gltf, joints, { names }), this.player);
  }

  // A canvas has one kind of WebGL state, so that another kind of dancer gets a new canvas.
  #open(kind, openRenderer) {
    if (this.kind === kind) return;
    const camera = this.camera;
    if (this.stage) {
      this.stage.player = null;
      const fresh = this.canvas.cloneNode(false);
      this.canvas.replaceWith(fresh);
      this.canvas = fresh;
    }
    this.kind = kind;
    this.stage = new Stage(this.canvas, openRenderer(this.canvas), (time) => this.onFrame(time));
    if (camera) this.stage.camera = camera;
    new OrbitControls(this.stage);
  }

  // Where the dancer goes over the dance: [x, z] in metres, ten a second.
  path() { return this.stage?.dancer?.path.places ?? new Float32Array(0); }
}

let three = null;

// A classic script that defines the global `Three`.
function loadThree() {
  three ??= new Promise((loaded, failed) => {
    const script = createElement("script");
    script.addEventListener("load", loaded);
    script.addEventListener("error", () => failed(new Error("the renderer of characters could not be loaded")));
    script.src = "/page/three/three.min.js";
    document.head.append(script);
  });
  return three;
}
