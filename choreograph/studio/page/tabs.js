// The panels on the right, chosen by tabs that the arrow keys move between.

export class Tabs {
  // onOpen gets the name of the panel that is shown.
  constructor(onOpen) {
    this.onOpen = onOpen;
    this.list = document.getElementById("rail");
    this.list.addEventListener("click", (event) => {
      const tab = event.target.closest("[role=tab]");
      if (tab) this.open(tab.dataset.panel);
    });
    this.list.addEventListener("keydown", (event) => this.#key(event));
  }

  get tabs() { return [...this.list.querySelectorAll("[role=tab]:not([hidden])")]; }
  get current() { return this.list.querySelector("[aria-selected=true]").dataset.panel; }

  open(name, { focus = false } = {}) {
    for (const tab of this.list.querySelectorAll("[role=tab]")) {
      const chosen = tab.dataset.panel === name;
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      document.getElementById(`panel-${tab.dataset.panel}`).hidden = !chosen;
      if (chosen && focus) tab.focus();
    }
    document.getElementById("side").scrollTop = 0;
    this.onOpen(name);
  }

  hide(name) { this.list.querySelector(`[data-panel=${name}]`).hidden = true; }

  #key(event) {
    const { tabs } = this, at = tabs.findIndex((tab) => tab.dataset.panel === this.current);
    const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
    const next = event.key === "Home" ? 0 : event.key === "End" ? tabs.length - 1 : step ? (at + step + tabs.length) % tabs.length : -1;
    if (next < 0) return;
    event.preventDefault();
    this.open(tabs[next].dataset.panel, { focus: true });
  }
}
