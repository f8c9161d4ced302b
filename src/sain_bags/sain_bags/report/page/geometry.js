// Places of the world in the top view: millimetres, x to the right, y down.

import { draw } from "./elements.js";

// The style of a disk by its place in the scene.
function diskClass(number) {
  return ["mid", "target"][number] ?? "other";
}

function place(pose) {
  return [1000 * pose[0], -1000 * pose[1]];
}

// A recorded radius may be negative or absent; that of a circle may not.
function size(metres) {
  return 1000 * Math.max(metres ?? 0, 0);
}

// A body from above: round, or with an outline in its own frame.
function outline(disk, pose, attributes = {}) {
  const [x, y] = place(pose);
  if (!disk.outline) return draw("circle", { ...attributes, cx: x, cy: y, r: size(disk.radius) });
  const points = disk.outline.map((corner) => place(corner).join(",")).join(" ");
  return draw("polygon", { ...attributes, points, transform: `translate(${x} ${y}) rotate(${turn(pose)})` });
}

// The heading of a pose, clockwise in degrees as SVG has it.
function turn(pose) {
  return (-180 * pose[2]) / Math.PI;
}

function apart(one, other) {
  return 1000 * Math.hypot(one[0] - other[0], one[1] - other[1]);
}

// Whether bodies are called by their shapes.
function named(episode) {
  return episode.disks.some((disk) => disk.name);
}

// What the goal is about.
function wantedName(episode) {
  return named(episode) ? "bodies" : "target";
}

// The largest distance of a body from its pose [mm].
function goalDistance(episode, poses) {
  return Math.max(...episode.poses.map(({ body, x, y }) => (poses[body] ? apart(poses[body], [x, y]) : 0)));
}

function wayLength(poses, number) {
  let sum = 0;
  for (let index = 1; index < poses.length; index += 1) sum += apart(poses[index - 1][number], poses[index][number]);
  return sum;
}

function sector(inner, outer, bearing) {
  const [c, s] = [Math.cos(bearing), Math.sin(bearing)], large = bearing > Math.PI / 2 ? 1 : 0;
  return `M${outer * c} ${-outer * s}A${outer} ${outer} 0 ${large} 1 ${outer * c} ${outer * s}` +
    `L${inner * c} ${inner * s}A${inner} ${inner} 0 ${large} 0 ${inner * c} ${-inner * s}Z`;
}

export { apart, diskClass, goalDistance, named, outline, place, sector, size, turn, wantedName, wayLength };
