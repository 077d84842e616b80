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
  // canvas: its element, which is replaced when another kind of dancer is drawn. isBusy: whether the server works.
  constructor(canvas, player, onFrame, isBusy = () => false) {
    Object.assign(this, { canvas, player, onFrame, isBusy, stage: null, kind: null, mesh: null });
    this.turn = 0; // of what is shown
    this.shown = null; // the repertoire of the dance that is shown, or null for a version or a character
    this.decoding = null; // once the motion that has come is shown
    this.known = null; // the dancer before a part of the next dance is shown
  }

  get camera() { return this.stage?.camera ?? null; }

  wake() { this.stage?.wake(); }

  // Show the dance of a state. `motion` is its text, or that of another version of the dance.
  async show(state, { dance = state.dance, motion = null, motionPath = null } = {}) {
    const isNewest = !motion && !motionPath;
    if (isNewest) await this.decoding;
    const turn = ++this.turn;
    this.known = null;
    if (state.character && isNewest) { this.shown = null; return this.#showCharacter(state); }
    if (isNewest && this.#shows(state)) return null;
    const text = motion ?? (await get(motionPath ?? `motion?revision=${state.revision}`)).motion;
    const decoded = await decompressMotion(text, dance);
    this.mesh ??= await decompressMesh((await get("mesh")).mesh, dance.mesh);
    if (turn !== this.turn) return null; // something newer is shown
    this.#open("mannequin", (canvas) => Renderer.open(canvas, this.mesh));
    this.#take(new Dancer(dance, decoded), isNewest ? state.revision : null);
    this.shown = isNewest ? state.repertoire.name : null;
    return null;
  }

  // Whether the whole dance of a state is on the stage already.
  #shows({ revision, repertoire }) {
    const { dancer } = this.stage ?? {};
    return this.shown === repertoire.name && dancer.revision === revision && !dancer.part;
  }

  // Show the motion of a revision before its state is known. `dance` is the one before, of the same body. Done when
  // the motion has come.
  async showMotion(revision, dance) {
    if (!this.shown) return;
    const turn = ++this.turn, { facts, motion, repertoire } = await get(`motion?revision=${revision}`);
    const shape = { ...dance, ...facts };
    if (turn !== this.turn || repertoire !== this.shown) return;
    this.decoding = decompressMotion(motion, shape).then((decoded) => {
      if (turn !== this.turn) return;
      this.known = null;
      this.#take(new Dancer(shape, decoded), revision);
    });
  }

  // Show a part of the next dance within the one that is shown, or without a part the one that was shown before.
  async showPart(part, dance) {
    if (!part) {
      if (this.known) this.#take(this.known, this.known.revision);
      this.known = null;
      return;
    }
    const { dancer } = this.stage;
    if (!this.shown || part.facts.fps !== dancer.fps) return;
    const decoded = await decompressMotion(part.motion, { ...dance, ...part.facts });
    if (dancer !== this.stage.dancer) return; // all of it is there already
    const roots = dancer.roots.slice(), quats = dancer.quats.slice(), first = Math.round(part.from_s * dancer.fps);
    const stop = Math.min(dancer.frames, first + part.facts.frames);
    if (first >= stop) return;
    roots.set(decoded.roots.subarray(0, 3 * (stop - first)), 3 * first);
    quats.set(decoded.quats.subarray(0, 4 * dancer.joints * (stop - first)), 4 * dancer.joints * first);
    const mixed = new Dancer(dance, { roots, quats });
    mixed.part = { from: first / dancer.fps, to: (stop - 1) / dancer.fps };
    this.known ??= dancer;
    this.#take(mixed, part.revision);
  }

  #take(dancer, revision) {
    dancer.revision = revision;
    this.stage.show(dancer, this.player);
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
    this.#take(new Figure(gltf, joints, { names }), state.revision);
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
    this.stage.isSparing = this.isBusy;
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
