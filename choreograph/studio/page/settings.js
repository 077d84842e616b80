// Settings of the dance: engine, genre, energy, front, seed, and a slider for each weight.

import { createElement } from "/page/elements.js";

const WAIT_MS = 180; // after the last move of a slider that is still held

export class Settings {
  constructor(store, actions) {
    Object.assign(this, { store, actions, waiting: 0, sending: false, changes: {}, built: "" });
    this.box = document.getElementById("settings-form");
    this.sliders = document.getElementById("weights");
    document.getElementById("roll").addEventListener("click", () => this.roll());
    store.addEventListener("state", () => this.show());
    store.addEventListener("span", () => this.#showSpan());
    this.#showSpan();
  }

  // Another seed: everything that is not locked is danced otherwise.
  roll() {
    const { seed = 0 } = this.store.state?.settings ?? {};
    return this.actions.settings({ seed: seed + 1 }, this.span);
  }

  // The span that is danced again, or null for the whole dance.
  get span() { return document.getElementById("only-span").checked ? this.store.span : null; }

  #showSpan() {
    const { span } = this.store, box = document.getElementById("only-span");
    box.disabled = !span;
    if (!span) box.checked = false;
  }

  show() {
    const { choices, settings } = this.store.state;
    const names = JSON.stringify([choices.engines, choices.genres, choices.weights?.map(({ name }) => name)]);
    if (names !== this.built) this.#build();
    this.built = names;
    if (Object.keys(this.changes).length) return; // the user is moving something
    for (const control of this.box.querySelectorAll("[data-setting]")) {
      const value = settings[control.dataset.setting];
      if (document.activeElement !== control || control.type !== "text") control.value = value ?? "";
    }
    for (const control of document.querySelectorAll("[data-weight]")) {
      const { weight, preset } = control.dataset;
      control.value = weight === "dynamics" ? settings.dynamics : settings.weights?.[weight] ?? preset;
      this.#showWeight(control);
    }
  }

  #build() {
    const { choices, settings } = this.store.state;
    const rows = [];
    const choice = (name, label, options) => {
      if (!(name in settings) || !options?.length) return;
      const select = createElement("select", "", options.map(([value, text]) => new Option(text, value)));
      select.dataset.setting = name;
      select.addEventListener("change", () => this.#change({ [name]: select.value === "" ? null : select.value }));
      rows.push(createElement("label", "row", [createElement("span", "", [label]), select]));
    };
    choice("engine", "Engine", choices.engines?.map((engine) => [engine, engine]));
    choice("genre", "Genre", [["", "as the music asks"], ...(choices.genres ?? []).map((genre) => [genre, genre])]);
    choice("stage", "Stage", [["near", "near the middle"], ["free", "free"], ["4x3", "4 × 3 m"], ["3x2", "3 × 2 m"]]);
    choice("front", "Front", [["audience", "to the audience"], ["free", "free"]]);
    if ("seed" in settings) {
      const seed = createElement("input");
      Object.assign(seed, { type: "number", min: 0, step: 1 });
      seed.dataset.setting = "seed";
      seed.addEventListener("change", () => this.#change({ seed: Math.max(0, Math.round(Number(seed.value))) }));
      rows.push(createElement("label", "row", [createElement("span", "", ["Seed"]), seed]));
    }
    const dynamics = { name: "dynamics", label: "dynamics", default: 1, low: 0, high: 1, sentence: "How much the size of the dance follows the loudness of the music." };
    if ("dynamics" in settings) rows.push(this.#slider(dynamics, (value) => ({ dynamics: value })));
    const weights = (choices.weights ?? []).map((weight) => this.#slider(weight, (value) => ({ weights: { [weight.name]: value } })));
    this.box.replaceChildren(...rows);
    this.sliders.replaceChildren(
      ...(weights.length ? [createElement("h4", "", ["Weights"]), createElement("p", "hint", ["A higher weight matters more. Each change makes the dance again, and keeps what is locked."])] : []),
      ...weights,
    );
  }

  #slider({ name, label: title, default: preset, sentence, low, high }, changesOf) {
    const input = createElement("input");
    Object.assign(input, { type: "range", min: low, max: high, step: "any", value: preset });
    Object.assign(input.dataset, { weight: name, preset });
    const value = createElement("output");
    const label = createElement("label", "weight", [createElement("span", "name", [title]), value, input]);
    input.id = `slider-${name}`;
    label.htmlFor = input.id; // otherwise it would be the label of its first element, the value
    if (sentence) {
      const hint = createElement("p", "hint", [sentence]);
      hint.id = `weight-${name}`;
      input.setAttribute("aria-describedby", hint.id);
      label.append(hint);
    }
    input.addEventListener("input", () => { this.#showWeight(input); this.#change(changesOf(Number(Number(input.value).toFixed(2)))); });
    input.addEventListener("change", () => this.#send()); // it is released
    input.addEventListener("dblclick", () => { input.value = preset; input.dispatchEvent(new Event("input")); });
    return label;
  }

  #showWeight(input) {
    input.parentElement.querySelector("output").textContent = Number(input.value).toFixed(Number(input.value) < 10 ? 1 : 0);
    const share = (input.value - input.min) / (input.max - input.min);
    input.style.setProperty("--filled", `${100 * share}%`);
  }

  #change(changes) {
    const weights = { ...this.changes.weights, ...changes.weights };
    Object.assign(this.changes, changes, Object.keys(weights).length ? { weights } : {});
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.#send(), WAIT_MS);
  }

  // Send what has changed. What changes meanwhile is sent when the dance with these settings is there.
  async #send() {
    clearTimeout(this.waiting);
    if (this.sending || !Object.keys(this.changes).length) return;
    const sent = this.changes;
    this.changes = {};
    this.sending = true;
    const done = await this.actions.settings(sent, this.span);
    this.sending = false;
    if (Object.keys(this.changes).length) this.#send();
    else if (!done) this.show(); // back to what is danced
  }
}
