// How many dancers there are, in which formation and relation, for the whole song or the selected span.

import { createElement } from "/page/elements.js";
import { clockText } from "/page/timeline.js";

const LABELS = {
  v: "V", unison: "in unison", mirror: "mirrored", "call-and-response": "call and response", free: "each on its own",
};
const KINDS = [["formation", "Formation"], ["relation", "Relation"]];

export class Dancers {
  // getSpan: the span that settings are for, or null for the whole song.
  constructor(store, actions, getSpan) {
    Object.assign(this, { store, actions, getSpan, changes: {}, sending: false });
    this.box = document.getElementById("dancers-form");
    this.parts = document.getElementById("dancers-parts");
    this.note = document.getElementById("dancers-note");
    this.number = createElement("input");
    Object.assign(this.number, { type: "number", min: 1, step: 1 });
    this.number.addEventListener("input", () => this.#showRows(Number(this.number.value))); // before the focus moves on
    this.number.addEventListener("change", () => this.#change({ dancers: Math.round(Number(this.number.value)) || 1 }));
    this.selects = Object.fromEntries(KINDS.map(([name]) => {
      const select = createElement("select");
      select.addEventListener("change", () => this.#choose(name, select.value));
      return [name, select];
    }));
    const row = (label, control) => createElement("label", "row", [createElement("span", "", [label]), control]);
    this.rows = KINDS.map(([name, label]) => row(label, this.selects[name]));
    this.box.append(row("Number", this.number), ...this.rows);
    store.addEventListener("state", () => this.show());
    store.addEventListener("span", () => this.show());
    document.getElementById("only-span").addEventListener("change", () => this.show());
  }

  show() {
    const { settings, choices, scene, character } = this.store.state ?? {};
    if (!settings?.dancers || this.sending) return;
    this.number.max = choices.most_dancers;
    this.number.value = settings.dancers;
    this.#showRows(settings.dancers);
    for (const [name] of KINDS) {
      const select = this.selects[name], value = this.#valueOf(settings[name]);
      const options = [...new Set([...choices[`${name}s`], value])];
      select.replaceChildren(...options.map((option) => new Option(labelOf(option), option)));
      select.value = value;
    }
    this.parts.replaceChildren(...(settings.dancers === 1 ? [] : KINDS.flatMap(([name]) => this.#partsOf(name, settings[name]))));
    const notes = scene?.notes.map(sentence) ?? [];
    if (scene && character) notes.unshift("The stage shows mannequins, and exports have the character.");
    if (scene) notes.unshift("What you change is the dance of the leader, the larger point on the floor plan. The others follow.");
    this.note.textContent = notes.join(" ");
  }

  #showRows(dancers) {
    for (const row of this.rows) row.hidden = !(dancers > 1);
  }

  // What is set for the span, if there is something for it, or for the whole song.
  #valueOf(texts) {
    const entries = texts.map(entryOf), when = this.#when();
    return (entries.find((entry) => when && entry.when === when) ?? entries.find((entry) => !entry.when) ?? entries[0]).value;
  }

  #when() {
    const span = this.getSpan();
    return span ? `${Number(span.from.toFixed(2))}-${Number(span.to.toFixed(2))}` : "";
  }

  #choose(name, value) {
    const when = this.#when(), others = this.store.state.settings[name].filter((text) => entryOf(text).when !== when);
    const text = when ? `${when}=${value}` : value;
    this.#change({ [name]: when ? [...others, text] : [text, ...others] });
  }

  // The parts of the song that have a formation or relation of their own, each with a button that removes it.
  #partsOf(name, texts) {
    return texts.filter((text) => entryOf(text).when).map((text) => {
      const { when, value } = entryOf(text), what = `${whenText(when)}: ${labelOf(value)}`;
      const button = createElement("button", "plain", ["×"]);
      button.type = "button";
      button.setAttribute("aria-label", `Remove the ${name} of ${what}`);
      button.addEventListener("click", () => {
        this.#change({ [name]: this.store.state.settings[name].filter((one) => one !== text) });
        this.selects[name].focus();
      });
      return createElement("li", "", [createElement("span", "", [what]), button]);
    });
  }

  // Send what has changed. What changes meanwhile is sent after that.
  async #change(changes) {
    Object.assign(this.changes, changes);
    if (this.sending) return;
    this.sending = true;
    while (Object.keys(this.changes).length) {
      const sent = this.changes;
      this.changes = {};
      await this.actions.settings(sent, null, "Placing the dancers");
    }
    this.sending = false;
    this.show(); // what is danced, also if something was refused
  }
}

// The part of the song and the value of VALUE or WHEN=VALUE.
function entryOf(text) {
  const at = text.lastIndexOf("=");
  return at < 0 ? { when: "", value: text } : { when: text.slice(0, at), value: text.slice(at + 1) };
}

function labelOf(value) {
  const [kind, counts] = value.split(":");
  return LABELS[value] ?? (counts ? `${kind}, ${counts} counts behind` : value);
}

// Times in seconds as on the timeline. Other parts of the song, such as chorus 2, are as they were written.
function whenText(when) {
  const ends = when.split("-");
  return ends.every((end) => end.trim() && Number.isFinite(Number(end))) ? ends.map((end) => clockText(Number(end), true)).join(" to ") : when;
}

const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
