// A new element with children. Strings are inserted as text, never as HTML.
export function createElement(tag, className = "", children = []) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
}
