// Small moving figures: bodies drawn as limbs on a 2D canvas, cheap enough for two dozen of them.

import { Dancer } from "/page/skeleton.js";
import { decompressMotion } from "/page/decompress.js";

const WIDTHS = { spine: 0.2, pelvis: 0.22, neck: 0.1, hip: 0.15, knee: 0.13, ankle: 0.1, foot: 0.07, collar: 0.12, shoulder: 0.11, elbow: 0.09, wrist: 0.07, hand: 0.06 };
const HEAD_M = 0.115; // radius
const TURN_RAD = 0.35; // of the view, from the front
const FRAME_S = 1 / 40; // at least, between two drawings of a figure: small ones need no more than 30 a second
const REACH_M = 0.95; // shown from the middle of the body to each side

// All figures of the page, of which those on screen are drawn in every frame.
export class Figures {
  constructor(store) {
    this.store = store;
    this.shown = new Set();
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.requested = false;
    this.drawnAt = 0;
    this.watcher = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) target.figure.visible = isIntersecting;
      this.wake();
    });
  }

  // A figure of a motion { facts, motion }, which begins at from_s of the dance. The body is that of the dance.
  async add(canvas, { facts, motion }, colour) {
    const { dance } = this.store;
    const body = { ...dance, ...facts };
    const figure = new LittleFigure(canvas, new Dancer(body, await decompressMotion(motion, body)), body, colour);
    canvas.figure = figure;
    this.shown.add(figure);
    this.watcher.observe(canvas);
    figure.draw(figure.durationS / 2);
    this.wake();
    return figure;
  }

  // Forget the figures of a part of the page.
  clear(element) {
    for (const canvas of element.querySelectorAll("canvas")) {
      if (!canvas.figure) continue;
      this.watcher.unobserve(canvas);
      this.shown.delete(canvas.figure);
    }
  }

  wake() {
    if (this.requested || !this.shown.size) return;
    this.requested = true;
    requestAnimationFrame((at) => this.#frame(at / 1000));
  }

  #frame(at) {
    this.requested = false;
    if (at - this.drawnAt < FRAME_S) { this.wake(); return; }
    this.drawnAt = at;
    let moving = false;
    for (const figure of this.shown) {
      if (!figure.visible || !(figure.clock || !this.calm.matches)) continue;
      figure.draw(figure.clock ? figure.clock() : at % Math.max(0.5, figure.durationS));
      moving = true;
    }
    if (moving) this.wake();
  }
}

class LittleFigure {
  constructor(canvas, dancer, { names, parents, fps, frames }, colour) {
    Object.assign(this, { canvas, dancer, names, colour, visible: false, clock: null });
    this.durationS = (frames - 1) / fps;
    this.limbs = names
      .map((name, j) => ({ j, parent: parents[j], width: widthOf(name) }))
      .filter(({ parent, j }) => parent >= 0 && names[j] !== "head");
    this.head = names.indexOf("head");
  }

  draw(timeS) {
    const { canvas, dancer, head } = this;
    const ratio = Math.min(2, devicePixelRatio || 1), width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio)) Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    dancer.pose(timeS);
    const p = dancer.positions, [cos, sin] = [Math.cos(TURN_RAD), Math.sin(TURN_RAD)];
    const scale = Math.min(height / 2.05, width / (2 * REACH_M)), floor = height - 0.1 * scale;
    const middle = p[0] * cos - p[2] * sin; // follows the pelvis
    const x = (j) => width / 2 + (p[3 * j] * cos - p[3 * j + 2] * sin - middle) * scale;
    const depth = (j) => p[3 * j] * sin + p[3 * j + 2] * cos;
    const y = (j) => floor - p[3 * j + 1] * scale + depth(j) * 0.04 * scale - depth(0) * 0.04 * scale;
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.fillStyle = "rgb(0 0 0 / 0.16)";
    context.beginPath();
    context.ellipse(width / 2, floor, 0.4 * scale, 0.07 * scale, 0, 0, 2 * Math.PI);
    context.fill();
    context.lineCap = "round";
    const limbs = this.limbs.map((limb) => ({ ...limb, at: depth(limb.j) + depth(limb.parent) - 2 * depth(0) }));
    limbs.sort((a, b) => a.at - b.at);
    for (const { j, parent, width: wide, at } of limbs) {
      context.strokeStyle = shaded(this.colour, at);
      context.lineWidth = wide * scale;
      context.beginPath();
      context.moveTo(x(parent), y(parent));
      context.lineTo(x(j), y(j));
      context.stroke();
    }
    context.fillStyle = this.colour;
    context.beginPath();
    context.arc(x(head), y(head) - 0.06 * scale, HEAD_M * scale, 0, 2 * Math.PI);
    context.fill();
  }
}

const widthOf = (name) => Object.entries(WIDTHS).find(([part]) => name.includes(part))?.[1] ?? 0.09;

// A CSS colour "rgb(r g b)", lighter in front of the body and darker behind it.
function shaded(colour, at) {
  const goal = at > 0 ? 255 : 0, share = Math.min(0.38, Math.abs(at) * 0.45);
  return `rgb(${colour.match(/\d+/g).map((x) => Math.round(x * (1 - share) + goal * share)).join(" ")})`;
}
