// The things of a list, drawn from above in millimetres: x to the right, y down. One function a kind.

import { draw } from "./elements.js";

// Millimetres of metres; a recorded radius may be negative or absent, that of a circle may not.
function size(metres) {
  return 1000 * Math.max(metres ?? 0, 0);
}

function place(pose) {
  return [1000 * pose[0], -1000 * pose[1]];
}

// The heading of a pose, clockwise in degrees as SVG has it.
function turn(pose) {
  return (-180 * pose[2]) / Math.PI;
}

function corners(points) {
  return points.map((point) => place(point).join(",")).join(" ");
}

// A body in a pose: round, or with its outline.
function outline(body, pose, attributes = {}) {
  const [x, y] = place(pose);
  if (!body.outline) return draw("circle", { ...attributes, cx: x, cy: y, r: size(body.radius) });
  const points = corners(body.outline), transform = `translate(${x} ${y}) rotate(${turn(pose)})`;
  return draw("polygon", { ...attributes, points, transform });
}

function cross(name, [x, y], arm) {
  return draw("path", { class: name, d: `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}` });
}

function areas(thing) {
  const name = thing.kind === "table" ? "top" : "reach";
  return (thing.pieces ?? [thing.points]).map((points) => draw("polygon", { class: name, points: corners(points) }));
}

function goal(mark, px) {
  const [x, y] = place(mark.pose);
  return [
    ...(mark.body ? [outline(mark.body, mark.pose, { class: "wanted" })] : []),
    draw("circle", { class: "ring", cx: x, cy: y, r: size(mark.radius) }),
    cross("cross", [x, y], px(7)),
  ];
}

function ghost(body, px) {
  const name = `ghost ${body.look}`;
  return [outline(body, body.pose, { class: name, "data-disk": body.number }), cross(name, place(body.pose), px(3.5))];
}

// A body that moves: it is drawn at the origin of a group.
function mover(body) {
  const r = size(body.radius), mark = body.outline ? [] : [draw("line", { x1: 0.62 * r, x2: 0.94 * r })];
  const name = `disk c-${body.colour}${body.fixed ? " fixed" : ""}`;
  return draw("g", { class: name, "data-disk": body.number }, outline(body, [0, 0, 0]), ...mark);
}

function arrow(push, outcome, number, px) {
  const [[x1, y1], [x2, y2]] = push.points.map(place);
  const reach = Math.hypot(x2 - x1, y2 - y1) || 1, along = [(x2 - x1) / reach, (y2 - y1) / reach];
  const head = Math.min(px(11), reach), half = 0.42 * head;
  const neck = [x2 - head * along[0], y2 - head * along[1]];
  const side = [-half * along[1], half * along[0]];
  const tip = [[x2, y2], [neck[0] + side[0], neck[1] + side[1]], [neck[0] - side[0], neck[1] - side[1]]];
  const shaft = { x1, y1, x2: neck[0], y2: neck[1] };
  return draw("g", { class: outcome },
    draw("line", { class: "halo", ...shaft }), draw("line", { class: "tool", ...shaft }),
    draw("polygon", { class: "tip", points: tip.map((corner) => corner.join(",")).join(" ") }),
    draw("circle", { class: "badge", cx: x1, cy: y1, r: px(9) }),
    draw("text", { class: "digit", x: x1, y: y1 }, String(number)));
}

export { areas, arrow, ghost, goal, mover, outline, place, size, turn };
