// The user's character: its file, and which of its bones moves as which joint, shown on a coloured skeleton.

import { createElement } from "/page/elements.js";
import { put, upload } from "./api.js";
import { attempt, say } from "./messages.js";

const HUES = { left: 28, right: 215, middle: 150 };

export class Character {
  constructor(store) {
    Object.assign(this, { store, shown: "" });
    this.skeleton = document.getElementById("skeleton");
    this.bones = document.getElementById("bones");
    const file = document.getElementById("character-file");
    file.addEventListener("change", () => { if (file.files[0]) this.send(file.files[0]); file.value = ""; });
    document.getElementById("character-choose").addEventListener("click", () => file.click());
    store.addEventListener("state", () => this.show());
    new ResizeObserver(() => this.#drawNewest()).observe(this.skeleton); // also once its tab is opened
  }

  send(file) {
    return attempt(async () => {
      this.store.apply(await this.store.sending(upload("character", file)));
      const several = this.store.state.settings.dancers > 1;
      say(several ? `Exports are on ${file.name} now. The stage shows several dancers as mannequins.` : `The dance is on ${file.name} now.`);
    });
  }

  show() {
    const { character, dance } = this.store.state;
    document.getElementById("character-name").textContent = character?.name ?? "The mannequin. Drop a .glb or .vrm file to dance with your own character.";
    const key = JSON.stringify([character?.name, character?.bones]);
    if (key === this.shown) return;
    this.shown = key;
    this.skeleton.hidden = !character || !dance;
    this.bones.replaceChildren(...(character ? this.#rows(character) : []));
    this.#drawNewest();
  }

  #drawNewest(pointed = null) {
    const { character, dance } = this.store.state ?? {};
    if (character && dance) this.#draw(dance, character, pointed);
  }

  #rows({ bones, all_bones: names, joints }) {
    return joints.map((joint) => {
      const select = createElement("select", "", [new Option("no bone", ""), ...names.map((name) => new Option(name, name))]);
      if (bones[joint] && !names.includes(bones[joint])) select.append(new Option(bones[joint], bones[joint]));
      select.value = bones[joint] ?? "";
      select.addEventListener("change", () => this.#map(joint, select.value));
      const swatch = createElement("i", "swatch");
      swatch.style.setProperty("--bone", colourOf(joint));
      const row = createElement("label", "row", [swatch, createElement("span", "", [joint.replaceAll("_", " ")]), select]);
      const point = (on) => this.#drawNewest(on ? joint : null);
      for (const name of ["pointerenter", "focusin"]) row.addEventListener(name, () => point(true));
      for (const name of ["pointerleave", "focusout"]) row.addEventListener(name, () => point(false));
      return row;
    });
  }

  #map(joint, node) {
    const changed = { ...this.store.state.character.bones, [joint]: node };
    if (!node) delete changed[joint];
    return attempt(async () => this.store.apply(await put("character/bones", { bones: changed })));
  }

  // The rest pose of the dance's skeleton: joints with a bone are filled, the pointed one is larger.
  #draw(dance, character, pointed) {
    const places = restPose(dance), canvas = this.skeleton;
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const ys = places.map(([, y]) => y), low = Math.min(...ys), tall = Math.max(...ys) - low;
    const wide = Math.max(...places.map(([x]) => Math.abs(x))) * 2;
    const scale = Math.min((height - 28) / tall, (width - 28) / wide);
    const at = ([x, y]) => [width / 2 + x * scale, height - 14 - (y - low) * scale];
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.lineCap = "round";
    dance.names.forEach((joint, j) => {
      if (dance.parents[j] < 0) return;
      context.strokeStyle = colourOf(joint);
      context.globalAlpha = character.bones[joint] ? 0.85 : 0.25;
      context.lineWidth = joint === pointed ? 7 : 4;
      context.beginPath();
      context.moveTo(...at(places[dance.parents[j]]));
      context.lineTo(...at(places[j]));
      context.stroke();
    });
    dance.names.forEach((joint, j) => {
      context.globalAlpha = 1;
      context.fillStyle = colourOf(joint);
      context.beginPath();
      context.arc(...at(places[j]), joint === pointed ? 8 : character.bones[joint] ? 4.5 : 2.5, 0, 2 * Math.PI);
      context.fill();
    });
  }
}

function restPose({ names, parents, offsets_m: offsets }) {
  const places = [];
  names.forEach((_, j) => {
    const parent = parents[j];
    places.push(parent < 0 ? [0, 0, 0] : offsets[j].map((x, k) => x + places[parent][k]));
  });
  return places;
}

// Left, right and middle have a hue each; parts differ in lightness.
function colourOf(joint) {
  const side = joint.startsWith("left") ? "left" : joint.startsWith("right") ? "right" : "middle";
  const order = ["hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist", "hand", "spine", "neck", "head", "pelvis"];
  const index = order.findIndex((part) => joint.includes(part));
  return `hsl(${HUES[side] + (index % 5) * 9} 72% ${46 + (index % 4) * 6}%)`;
}
