// The tooltip of a timeline block: its take, the source time, the warp, and its costs or its motif.

import { createElement } from "./elements.js";
import { clamp } from "./math.js";
import { clockText } from "./timeline.js";

const NEAR_S = 0.1; // a block that starts this little before a count starts on it

export class Card {
  constructor(dance, counts) {
    this.dance = dance;
    this.counts = counts;
    this.element = document.getElementById("card");
    this.block = null;
    const all = dance.blocks.flatMap((block) => Object.values(block.costs).map(Math.abs));
    this.highestCost = all.reduce((a, b) => Math.max(a, b), 1e-9); // the bars of all blocks share one scale
  }

  // Shows the card above the timeline, centred at x of the window. The block null hides it.
  show(block, x, colours) {
    this.element.hidden = block === null;
    if (block === null) { this.block = null; return; }
    if (block !== this.block) this.#fill(block, colours);
    this.block = block;
    const box = this.element.getBoundingClientRect();
    const top = document.getElementById("timeline").getBoundingClientRect().top - box.height - 10;
    const left = clamp(x - box.width / 2, 8, innerWidth - box.width - 8);
    this.element.style.transform = `translate(${Math.round(left)}px, ${Math.round(Math.max(8, top))}px)`;
  }

  #fill(index, colours) {
    const block = this.dance.blocks[index], take = this.dance.takes[block.take];
    const isWord = "motif" in block;
    this.element.style.setProperty("--take", colours[block.take].css);
    const title = createElement("h2", "", [createElement("i", "dot"), createElement("span", "", [take.name])]);
    const sub = [take.genre, take.performer, take.licence && `licence: ${take.licence}`].filter(Boolean).join(" · ");
    const facts = [
      [block.kept ? "Kept" : block.speed === 0 ? "Held" : isWord ? "Word" : "Second", `${clockText(block.start_s, true)} – ${clockText(block.end_s, true)}`],
    ];
    if (isWord) facts.push(["Motif", `${block.motif}${block.pinned ? ", pinned" : ""}`]);
    else if (!block.kept) facts.push(["Clip", `${block.clip}, from ${clockText(block.clip_start_s, true)}`]);
    const count = this.counts.textAt(block.start_s + NEAR_S);
    if (count) facts.push(["From", count]);
    if ("speed" in block) {
      facts.push(["Source time", `${block.from_s.toFixed(2)} – ${block.to_s.toFixed(2)} s${block.mirrored ? ", mirrored" : ""}`]);
      if (block.speed !== 0) facts.push(["Warp", warpText(block.speed)]);
    }
    const costs = Object.entries(block.costs);
    const total = costs.reduce((sum, [, cost]) => sum + cost, 0);
    this.element.replaceChildren(
      title,
      createElement("p", "sub", [sub || "no credits given"]),
      createElement("dl", "", facts.flatMap(([name, value]) => [createElement("dt", "", [name]), createElement("dd", "", [value])])),
      ...(costs.length === 0 ? [] : [createElement("dl", "costs", [
        ...costs.flatMap(([name, cost]) => [
          createElement("dt", "", [name]), this.#bar(cost), createElement("dd", "", [cost.toFixed(3)]),
        ]),
        createElement("dt", "", ["total cost"]), createElement("span"), createElement("dd", "", [total.toFixed(3)]),
      ])]),
    );
  }

  #bar(cost) {
    const inner = createElement("i");
    inner.style.width = `${(100 * Math.abs(cost)) / this.highestCost}%`;
    return createElement("span", "bar", [inner]);
  }
}

function warpText(slope) {
  const percent = Math.round(100 * (slope - 1));
  return `${slope.toFixed(2)}×${percent ? `, ${Math.abs(percent)} % ${percent > 0 ? "faster" : "slower"}` : ""}`;
}
