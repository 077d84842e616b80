// Writing the dance as a file, the whole or the selected span.

import { createElement } from "/page/elements.js";
import { post } from "./api.js";
import { attempt, say } from "./messages.js";

const NAMES = {
  glb: ["GLB", "for Blender, game engines and the web"], bvh: ["BVH", "motion for any animation program"],
  fbx: ["FBX", "for Maya, Unreal and Unity"], usd: ["USD", "for Omniverse and Houdini"], npz: ["NPZ", "arrays for Python"],
  mp4: ["MP4", "a video with the song"], vrma: ["VRMA", "an animation for avatars (VRM)"], vmd: ["VMD", "a motion for MikuMikuDance"], png: ["PNG", "a strip of poses"], html: ["HTML", "one page that plays anywhere"], json: ["JSON", "the plan, to dance it again"],
};

const WHOLE_ONLY = ["html", "json"]; // a part of a dance has no page or plan

export class Export {
  constructor(store, jobs) {
    Object.assign(this, { store, jobs });
    this.form = document.getElementById("export-form");
    this.form.addEventListener("submit", (event) => { event.preventDefault(); this.write(); });
    this.form.addEventListener("change", () => this.show());
    this.built = "";
    store.addEventListener("state", () => this.show());
    store.addEventListener("span", () => this.show());
  }

  show() {
    const { choices, character, dance, settings } = this.store.state;
    const formats = choices.exports ?? Object.keys(NAMES);
    if (formats.join() !== this.built) this.#build(formats);
    this.built = formats.join();
    const span = this.form.elements.part;
    const partly = this.store.span && !WHOLE_ONLY.includes(this.form.elements.format?.value);
    for (const radio of span) if (radio.value === "span") radio.disabled = !partly;
    if (!partly) span.value = "whole";
    document.getElementById("export-character").hidden = !character;
    const onCharacter = character && this.form.elements.character.checked;
    const ofEach = onCharacter ? choices.exports_of_each_character : choices.exports_of_each;
    for (const label of document.querySelectorAll("#formats .format")) {
      const format = label.querySelector("input").value, packed = settings.dancers > 1 && ofEach?.includes(format);
      label.querySelector("span").textContent = packed ? "a .zip with a file for each dancer" : NAMES[format]?.[1] ?? "";
    }
    this.form.querySelector("[type=submit]").disabled = !dance;
  }

  #build(formats) {
    const list = document.getElementById("formats");
    list.replaceChildren(...formats.map((format, i) => {
      const radio = createElement("input");
      Object.assign(radio, { type: "radio", name: "format", value: format, checked: formats.includes("glb") ? format === "glb" : i === 0 });
      const [name, what] = NAMES[format] ?? [format.toUpperCase(), ""];
      return createElement("label", "format", [radio, createElement("b", "", [name]), createElement("span", "", [what])]);
    }));
  }

  write() {
    return attempt(async () => {
      const { format, part } = Object.fromEntries(new FormData(this.form));
      const { span, state } = this.store;
      const onCharacter = Boolean(state.character) && this.form.elements.character.checked;
      const wanted = { format, character: onCharacter, ...(part === "span" && span ? span : {}) };
      const answer = await post("export", wanted);
      const { id, file, bytes } = await this.jobs.finish(answer, `Writing ${format.toUpperCase()}`);
      const link = createElement("a", "", [`${file}, ${sizeText(bytes)}`]);
      Object.assign(link, { href: `/api/export/${id}`, download: file });
      document.getElementById("exported").prepend(createElement("li", "", [link]));
      link.click();
      say(`${file} is written.`);
    });
  }
}

const sizeText = (bytes) => (bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
