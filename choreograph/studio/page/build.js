// A repertoire from the user's own takes: a folder of files is sent, checked, built with a log, and danced with.

import { post, upload } from "./api.js";
import { attempt, say } from "./messages.js";

export class Build {
  constructor(store, jobs) {
    Object.assign(this, { store, jobs });
    this.log = document.getElementById("build-log");
    this.button = document.getElementById("build-choose");
    const files = document.getElementById("build-files");
    this.button.addEventListener("click", () => files.click());
    files.addEventListener("change", () => { const chosen = [...files.files]; files.value = ""; if (chosen.length) this.build(chosen); });
    store.addEventListener("state", () => this.show());
  }

  show() {
    const { repertoire } = this.store.state;
    const { name, takes, clips, genres } = repertoire;
    document.getElementById("repertoire").textContent =
      `${name}: ${takes} takes, ${clips} clips${genres.length ? `, ${genres.length} genres` : ""}.`;
  }

  // files: takes and their songs, as chosen or dropped.
  async build(files) {
    this.button.disabled = true;
    this.log.hidden = false;
    const lines = [];
    const write = (line) => { lines.push(line); this.log.textContent = lines.join("\n"); };
    await attempt(async () => {
      for (const [i, file] of files.entries()) {
        write(`${i + 1} of ${files.length}: ${file.name}`);
        await upload("build", file);
      }
      const name = document.getElementById("build-name").value.trim() || "my-takes";
      const sent = lines.length;
      const answer = await post("build/start", { name });
      await this.jobs.finish(answer, "Building the repertoire", {
        onLog: (log) => { this.log.textContent = [...lines.slice(0, sent), ...log].join("\n"); this.log.scrollTop = this.log.scrollHeight; },
      });
      this.store.apply(await post("repertoire", { name }));
      say(`Dances are made with ${name} now.`);
    });
    this.button.disabled = false;
  }
}
