// What the page tells the user: short messages that fade, and errors that stay until they are closed.

import { createElement } from "/page/elements.js";

const SHOWN_MS = 4500;

// A message, also for screen readers. An error is kept until it is closed.
export function say(text, { error = false } = {}) {
  const close = createElement("button", "", ["×"]);
  close.type = "button";
  close.setAttribute("aria-label", "Close this message");
  const line = createElement("p", error ? "message error" : "message", [createElement("span", "", [text]), close]);
  const box = document.getElementById("messages");
  for (const old of box.children) if (error || !old.classList.contains("error")) old.remove();
  box.append(line);
  close.addEventListener("click", () => line.remove());
  if (!error) setTimeout(() => line.remove(), SHOWN_MS);
}

// Runs what a button does. A request that cannot be met is said in the page.
export async function attempt(act) {
  try {
    return await act();
  } catch (error) {
    if (error.name !== "AbortError") say(sentence(error.message), { error: true });
    return null;
  }
}

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : ".");
