// An element with children; text goes in as text, whatever it holds.
export function made(tag, className = "", children = []) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
}
