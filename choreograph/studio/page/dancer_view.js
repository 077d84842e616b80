// The dancers on the stage: mannequins, or the user's character, whose renderers are the dance page's.

import { CharacterRenderer } from "/page/character_renderer.js";
import { decompressMesh, decompressMotion } from "/page/decompress.js";
import { Crowd } from "/page/crowd.js";
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

  // Show the dance of a state, or the version of it whose facts and path of its motion are given.
  async show(state, { dance = state.dance, motionPath = null } = {}) {
    const isNewest = !motionPath;
    if (isNewest) await this.decoding;
    const turn = ++this.turn;
    this.known = null;
    if (state.character && isNewest && state.settings.dancers === 1) { this.shown = null; return this.#showCharacter(state); }
    if (isNewest && this.#shows(state)) return null;
    const { motion, others = [] } = await get(motionPath ?? `motion?revision=${state.revision}`);
    const bodies = await this.#bodies(dance, motion, others);
    if (turn !== this.turn) return null; // something newer is shown
    this.#takeBodies(bodies, isNewest ? state.revision : null);
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
    const turn = ++this.turn, { facts, motion, others = [], repertoire } = await get(`motion?revision=${revision}`);
    const shape = { ...dance, ...facts };
    if (turn !== this.turn || repertoire !== this.shown) return;
    this.decoding = this.#bodies(shape, motion, others).then((bodies) => {
      if (turn !== this.turn) return;
      this.known = null;
      this.#takeBodies(bodies, revision);
    });
  }

  // All dancers with their meshes. Others are on the mesh of the first one, in another size and other colours.
  async #bodies(dance, motion, others) {
    this.meshText ??= (await get("mesh")).mesh;
    this.mesh ??= await decompressMesh(this.meshText, dance.mesh);
    const rest = others.map(async ({ facts, motion: text }) => {
      const own = { ...dance, ...facts };
      return { dancer: new Dancer(own, await decompressMotion(text, own)), mesh: await decompressMesh(this.meshText, own.mesh) };
    });
    return [{ dancer: new Dancer(dance, await decompressMotion(motion, dance)), mesh: this.mesh }, ...(await Promise.all(rest))];
  }

  #takeBodies(bodies, revision) {
    const { kind } = this;
    this.#open(`${bodies.length} mannequins`, (canvas) => Renderer.open(canvas, bodies.map(({ mesh }) => mesh)));
    const dancers = bodies.map(({ dancer }) => dancer);
    this.#take(dancers.length > 1 ? new Crowd(dancers) : dancers[0], revision);
    if (kind?.endsWith("mannequins") && kind !== this.kind) this.camera.reset(); // another number of dancers
  }

  // Show a part of the next dance within the one that is shown, or without a part the one that was shown before.
  async showPart(part, dance) {
    if (!part) {
      if (this.known) this.#take(this.known, this.known.revision);
      this.known = null;
      return;
    }
    const { dancer } = this.stage;
    if (!this.shown || dancer.dancers || part.facts.fps !== dancer.fps) return;
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

  // Where each dancer goes over the dance: [x, z] in metres, ten a second.
  paths() {
    const { dancer } = this.stage ?? {};
    return dancer ? (dancer.dancers ?? [dancer]).map(({ path }) => path.places) : [];
  }
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
