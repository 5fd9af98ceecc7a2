// Elements, buttons and keys: the parts of the page.
"use strict";

// An element with properties, attributes and children.
function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value; else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

function makeButton(properties, act, ...children) {
  return onPress(make("button", {type: "button", ...properties}, ...children), act);
}

// Let a button act. A click of the mouse returns the keyboard to the page; space and enter press
// the button that has the focus, and nothing else.
function onPress(button, act) {
  on(button, "click", (event) => {
    act(event);
    if (event.detail) button.blur();
  });
  on(button, "keydown", (event) => {
    if (event.key === " " || event.key === "Enter") event.stopPropagation();
  });
  return button;
}

// Call `actionOf` for each key, outside of fields and without ctrl: it returns an action, or
// nothing. The browser then does no more with that key.
function onKey(actionOf) {
  on(window, "keydown", (event) => {
    const field = "select, textarea, input:not([type=range], [type=checkbox])";
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches?.(field)) return;
    const action = actionOf(event);
    if (!action) return;
    event.preventDefault();
    action();
  });
}

// The first element that a selector of CSS names.
const part = (selector, parent = document) => parent.querySelector(selector);

// Call a function for each of some kinds of events.
function on(target, kinds, act, options) {
  for (const kind of kinds.split(" ")) target.addEventListener(kind, act, options);
}

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
