// What is known of one second: its take, where in it, how it was warped, and what it cost.

import { clamp } from "./math.js";
import { clockText } from "./timeline.js";

export class Card {
  constructor(dance) {
    this.dance = dance;
    this.element = document.getElementById("card");
    this.second = null;
    const all = dance.seconds.flatMap((second) => Object.values(second.costs).map(Math.abs));
    this.dearest = all.reduce((a, b) => Math.max(a, b), 1e-9); // bars of all seconds are on one scale
  }

  // Over the timeline, its middle at x of the window; second null hides it.
  show(second, x, colours) {
    this.element.hidden = second === null;
    if (second === null) { this.second = null; return; }
    if (second !== this.second) this.#fill(second, colours);
    this.second = second;
    const box = this.element.getBoundingClientRect();
    const top = document.getElementById("timeline").getBoundingClientRect().top - box.height - 10;
    const left = clamp(x - box.width / 2, 8, innerWidth - box.width - 8);
    this.element.style.transform = `translate(${Math.round(left)}px, ${Math.round(Math.max(8, top))}px)`;
  }

  #fill(index, colours) {
    const second = this.dance.seconds[index], take = this.dance.takes[second.take];
    const length = Math.min(1, this.dance.duration_s - index);
    this.element.style.setProperty("--take", colours[second.take].css);
    const title = made("h2", "", [made("i", "dot"), made("span", "", [take.name])]);
    const sub = [take.genre, take.performer, take.licence && `licence: ${take.licence}`].filter(Boolean).join(" · ");
    const facts = [
      ["Second", `${clockText(index)} – ${clockText(index + length, length < 1)}`],
      ["Clip", `${second.clip}, from ${clockText(second.clip_start_s, true)}`],
      ["Danced there", `${second.from_s.toFixed(2)} – ${second.to_s.toFixed(2)} s`],
      ["Warp", warpText(second.to_s - second.from_s)],
    ];
    const costs = Object.entries(second.costs);
    const total = costs.reduce((sum, [, cost]) => sum + cost, 0);
    this.element.replaceChildren(
      title,
      made("p", "sub", [sub || "no credits given"]),
      made("dl", "", facts.flatMap(([name, value]) => [made("dt", "", [name]), made("dd", "", [value])])),
      made("dl", "costs", [
        ...costs.flatMap(([name, cost]) => [
          made("dt", "", [name]), this.#bar(cost), made("dd", "", [cost.toFixed(3)]),
        ]),
        made("dt", "", ["cost in all"]), made("span"), made("dd", "", [total.toFixed(3)]),
      ]),
    );
  }

  #bar(cost) {
    const inner = made("i");
    inner.style.width = `${(100 * Math.abs(cost)) / this.dearest}%`;
    return made("span", "bar", [inner]);
  }
}

function warpText(slope) {
  const percent = Math.round(100 * (slope - 1));
  return `${slope.toFixed(2)}×${percent ? `, ${Math.abs(percent)} % ${percent > 0 ? "faster" : "slower"}` : ""}`;
}

// An element with children; text goes in as text, whatever it holds.
export function made(tag, className = "", children = []) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
}
