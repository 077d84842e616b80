// The palette: takes and motifs that can be placed in the dance, with small moving figures, searched by words and by
// genre, energy, level and travel.

import { createElement } from "/page/elements.js";
import { clamp } from "/page/math.js";
import { get, query } from "./api.js";
import { attempt, say } from "./messages.js";

const PAGE = 24, WAIT_MS = 200;
const TYPE = "application/x-choreograph-take";

export class Palette {
  constructor(store, actions, figures, getLanes, getPlayer) {
    Object.assign(this, { store, actions, figures, getLanes, getPlayer, waiting: 0, offset: 0, opened: false });
    this.form = document.getElementById("palette-form");
    this.list = document.getElementById("palette-list");
    this.note = document.getElementById("palette-note");
    this.more = document.getElementById("palette-more");
    this.form.addEventListener("input", () => { clearTimeout(this.waiting); this.waiting = setTimeout(() => this.search(), WAIT_MS); });
    this.form.addEventListener("submit", (event) => { event.preventDefault(); this.search(); });
    this.more.addEventListener("click", () => this.search(this.offset + PAGE));
    store.addEventListener("state", () => this.#showGenres());
    store.addEventListener("span", () => this.#showTarget());
    this.#acceptDrops();
  }

  open() {
    if (this.opened || !this.store.dance) return;
    this.opened = true;
    this.search();
  }

  #showGenres() {
    const select = this.form.elements.genre, { genres } = this.store.state.repertoire;
    if (select.options.length !== genres.length + 1) select.replaceChildren(new Option("any genre", ""), ...genres.map((genre) => new Option(genre, genre)));
    const { name } = this.store.state.repertoire;
    if (this.repertoire !== undefined && this.repertoire !== name) { this.opened = false; this.list.replaceChildren(); }
    this.repertoire = name;
  }

  #showTarget() {
    const { span } = this.store;
    this.form.classList.toggle("has-span", Boolean(span));
  }

  async search(offset = 0) {
    await attempt(async () => {
      const wanted = Object.fromEntries(new FormData(this.form));
      const found = await get(`palette?${query({ ...wanted, offset, limit: PAGE })}`);
      this.offset = offset;
      if (offset === 0) { this.figures.clear(this.list); this.list.replaceChildren(); }
      const motifs = offset === 0 ? found.motifs ?? [] : [];
      const items = [...found.takes, ...motifs];
      this.note.textContent = found.total ? `${found.total} moves. Drag one to the timeline, or press it to place it.` : "No moves fit. Ask for less.";
      this.more.hidden = offset + PAGE >= found.total;
      for (const item of items) this.list.append(this.#card(item));
    });
  }

  #card(item) {
    const canvas = createElement("canvas");
    canvas.setAttribute("aria-hidden", "true");
    const name = item.figure || ("motif" in item ? `motif ${item.motif}` : item.take);
    const facts = [item.genre, item.energy && `${item.energy} energy`, item.performer].filter(Boolean).join(" · ");
    const button = createElement("button", "figure", [canvas, createElement("span", "why", [name]), createElement("span", "cost", [facts])]);
    button.type = "button";
    button.draggable = true;
    button.setAttribute("aria-label", `Place ${name}${facts ? `, ${facts}` : ""}`);
    button.addEventListener("click", () => this.place(item));
    button.addEventListener("dragstart", (event) => {
      event.dataTransfer.setData(TYPE, JSON.stringify(item));
      event.dataTransfer.effectAllowed = "copy";
    });
    this.#thumbnail(canvas, item);
    return createElement("li", "", [button]);
  }

  // The motion of a card is asked for once it is on screen.
  #thumbnail(canvas, item) {
    const watcher = new IntersectionObserver(async ([{ isIntersecting }]) => {
      if (!isIntersecting) return;
      watcher.disconnect();
      const part = query({ take: item.take, from: item.from_s, to: Math.min(item.to_s, item.from_s + 8) });
      const motion = await get(`palette/motion?${part}`).catch(() => null);
      if (!motion || !canvas.isConnected) return;
      const colour = getComputedStyle(document.documentElement).getPropertyValue("--figure").trim();
      await this.figures.add(canvas, motion, colour);
    });
    watcher.observe(canvas);
  }

  // Place a move in the selected span, or where the dance stands.
  async place(item, atS = null) {
    const { span, dance } = this.store;
    const long = clamp(item.to_s - item.from_s, 1, 8);
    const start = atS ?? span?.from ?? this.getPlayer().time;
    const from = clamp(this.getLanes().snap(start), 0, dance.duration_s - 1);
    const to = atS === null && span ? span.to : Math.min(dance.duration_s, this.getLanes().snap(from + long));
    if ("motif" in item) await this.actions.edit("pin_motif", { from, to, motif: item.motif });
    else if (await this.actions.edit("pin_take", { from, to, take: item.take, source_s: item.from_s })) {
      say(`${item.take} is danced here, from the count nearest to this move.`);
    }
  }

  // A move that is dragged to the timeline is placed where it is let go.
  #acceptDrops() {
    const element = document.getElementById("timeline");
    element.addEventListener("dragover", (event) => {
      if (!event.dataTransfer.types.includes(TYPE)) return;
      event.preventDefault();
      event.dataTransfer.dropEffect = "copy";
    });
    element.addEventListener("drop", (event) => {
      const text = event.dataTransfer.getData(TYPE);
      if (!text) return;
      event.preventDefault();
      const x = event.clientX - element.getBoundingClientRect().left;
      const timeS = this.getLanes().timeline.timeAt(x);
      if (this.store.isLocked(timeS)) say("This span is locked. Unlock it to place something here.", { error: true });
      else this.place(JSON.parse(text), timeS);
    });
  }
}
