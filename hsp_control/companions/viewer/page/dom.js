// Elements, buttons and keys: what all parts of the page are made of.
"use strict";

// An element with properties, attributes and children:
//   make("button", {className: "x", "aria-label": "..."}, "its text")
function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value; else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

// A button. A click of the mouse returns the keyboard to the page; space and enter press the
// button that has the focus, and nothing else.
function makeButton(properties, act, ...children) {
  const button = make("button", {type: "button", ...properties}, ...children);
  button.addEventListener("click", (event) => {
    act(event);
    if (event.detail) button.blur();
  });
  button.addEventListener("keydown", (event) => {
    if (event.key === " " || event.key === "Enter") event.stopPropagation();
  });
  return button;
}

// A picture of one path, 24 units wide.
function makeIcon(path) {
  const parent = make("i");
  parent.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path fill-rule="evenodd"
    d="${path}"/></svg>`;
  return parent.firstChild;
}

// Call `actionOf` for each key, outside of fields and without ctrl: it returns what to do, or
// nothing. The browser then does no more with that key.
function onKey(actionOf) {
  addEventListener("keydown", (event) => {
    const field = "select, textarea, input:not([type=range], [type=checkbox])";
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches?.(field)) return;
    const action = actionOf(event);
    if (!action) return;
    event.preventDefault();
    action();
  });
}

// Call a function for each of some kinds of events of an element.
function on(element, kinds, act, options) {
  for (const kind of kinds.split(" ")) element.addEventListener(kind, act, options);
}

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
