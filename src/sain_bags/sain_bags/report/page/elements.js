// Elements, made without markup: what a bag says is only ever text.

const SVG_NAMES = "http://www.w3.org/2000/svg";

function make(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

function draw(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG_NAMES, tag), attributes, children);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

function find(id) {
  return document.getElementById(id);
}

// Draws into a box whenever its width changes; the drawing gets that width in pixels.
function onWidth(box, redraw) {
  let width = 0;
  new ResizeObserver(() => {
    if (box.clientWidth !== width && box.clientWidth > 0) redraw((width = box.clientWidth));
  }).observe(box);
}

function icon(path) {
  return draw("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, draw("path", { d: path }));
}

export { draw, find, icon, make, onWidth };
