// What the page knows: the newest state of the project, the selected span, and the paths of the server.

import { ApiError, get, post } from "./api.js";

export class Store extends EventTarget {
  constructor(paths) {
    super();
    this.paths = paths;
    this.state = null;
    this.changing = 0; // requests for changes that are not answered yet
    this.before = async () => {}; // what is done with a new revision before its state is asked for
    this.span = null; // the selected span: { from, to } in seconds of the dance
  }

  has(path) { return this.paths.has(`/api/${path}`); }
  get dance() { return this.state?.dance ?? null; }

  // Whether a time lies in a locked span.
  isLocked(timeS) { return this.state.locks.some(([from, to]) => timeS >= from && timeS < to); }

  // Take over a state of the server, unless it is older than the one shown.
  apply(state) {
    if (!state || (this.state && state.revision < this.state.revision)) return;
    const before = this.state;
    this.state = state;
    this.#tell("state", { before });
  }

  // Ask for the newest state. With the revision that is known to be new, its motion comes first.
  async refresh(revision = null) {
    if (revision !== null) await this.before(revision);
    this.apply(await get("state"));
  }

  // Send a change of the newest revision. Its answer is the new state, or a job.
  async change(path, body = {}, method = "POST") {
    try {
      const answer = await this.sending(post(path, { revision: this.state.revision, ...body }, method));
      if (answer && "revision" in answer) this.apply(answer);
      return answer;
    } catch (error) {
      if (error instanceof ApiError && error.status === 409) {
        if (error.state) this.apply(error.state); else await this.refresh();
        throw new ApiError(409, { error: "Another page has changed this dance. The newest version is shown now: try again." });
      }
      throw error;
    }
  }

  // Wait for a request that changes the dance. News of changes by other pages are of no interest meanwhile.
  async sending(request) {
    this.changing += 1;
    try {
      return await request;
    } finally {
      this.changing -= 1;
    }
  }

  // Tell that the dance of the newest state is on the stage.
  tellShown() { this.#tell("shown"); }

  // Tell of a part of the dance that is there before the rest, or null if there will be no rest.
  tellFirst(part) { this.#tell("first", part); }

  select(span) {
    this.span = span;
    this.#tell("span");
  }

  #tell(name, detail = null) { this.dispatchEvent(new CustomEvent(name, { detail })); }
}
