// An episode from above, in millimetres: x to the right, y up.

import { draw, onWidth } from "./elements.js";
import { apart, diskClass, outline, place, sector, size, turn, wayLength } from "./geometry.js";

const TRAIL_SHOWN = 1; // [mm], a disk that moved less leaves no path

class TopView {
  constructor(svg, data) {
    this.svg = svg;
    this.table = data.table;
    const [left, right, bottom, top] = data.view.map((metres) => 1000 * metres);
    this.box = { x: left, y: -top, width: right - left, height: top - bottom };
    this.layers = {};
    this.shown = { expected: true, physics: true, paths: true };
    svg.setAttribute("viewBox", [left, -top, right - left, top - bottom].join(" "));
    onWidth(svg.parentElement, () => this.resize());
  }

  // How many millimetres so many pixels are.
  px(pixels) {
    return (pixels * this.box.width) / (this.svg.clientWidth || this.box.width);
  }

  // Badges, texts and arrow heads keep their size in pixels, so they are drawn anew.
  resize() {
    if (!this.episode) return;
    const [push, number] = this.push;
    this.show(this.episode, this.index);
    this.showPush(push, number);
  }

  show(episode, index) {
    this.push = [];
    this.episode = episode;
    this.svg.style.setProperty("--pixel", this.px(1));
    this.svg.setAttribute("aria-label", `Top view of episode ${episode.number}: table, arm, disks, goal, pushes`);
    for (const name of ["table", "goal", "starts", "paths", "ghosts", "disks", "push"]) {
      this.layers[name] = draw("g", { class: name });
    }
    this.svg.replaceChildren(...Object.values(this.layers));
    this.drawTable();
    this.drawGoal();
    this.drawDisks();
    this.moveTo(index);
  }

  drawTable() {
    const { x, y, inner, outer, bearing } = this.table;
    const top = { x: 1000 * x[0], y: -1000 * y[1], width: 1000 * (x[1] - x[0]), height: 1000 * (y[1] - y[0]) };
    const clip = draw("clipPath", { id: "on-table" }, draw("rect", { ...top, rx: 15 }));
    const foot = draw("circle", { class: "base", r: 55 });
    const arm = draw("text", { y: this.px(4), "text-anchor": "middle" }, "arm");
    const ring = draw("path", { class: "reach", d: sector(1000 * inner, 1000 * outer, bearing), "clip-path": "url(#on-table)" });
    this.layers.table.append(draw("defs", {}, clip), draw("rect", { class: "top", ...top, rx: 15 }), ring, foot, arm);
    this.drawScale();
  }

  drawScale() {
    const x = this.box.x + this.px(14), y = this.box.y + this.box.height - this.px(14);
    const text = draw("text", { x: x + 50, y: y - this.px(7), "text-anchor": "middle" }, "10 cm");
    this.layers.table.append(draw("line", { class: "scale", x1: x, y1: y, x2: x + 100, y2: y }), text);
  }

  drawGoal() {
    for (const pose of this.episode.poses) {
      const [x, y] = place([pose.x, pose.y]), arm = this.px(7), body = this.episode.disks[pose.body];
      const shape = body && pose.heading !== null ? [outline(body, [pose.x, pose.y, pose.heading], { class: "wanted" })] : [];
      this.layers.goal.append(
        ...shape,
        draw("circle", { class: "ring", cx: x, cy: y, r: size(pose.tolerance) }),
        draw("path", { class: "cross", d: `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}` }),
      );
    }
  }

  drawDisks() {
    const poses = this.episode.frames.poses;
    this.disks = this.episode.disks.map((disk, number) => {
      const name = diskClass(number), r = size(disk.radius);
      this.layers.starts.append(outline(disk, poses[0][number], { class: `start ${name}` }));
      const fixed = disk.role === "fixed" ? " fixed" : "";
      const group = draw("g", { class: `disk ${name}${fixed}`, "data-disk": number },
        outline(disk, [0, 0, 0]), ...(disk.name && disk.outline ? [] : [draw("line", { x1: 0.62 * r, x2: 0.94 * r })]));
      this.layers.disks.append(group);
      const paths = ["ahead", "behind"].map((part) => draw("polyline", { class: `path ${part} ${name}` }));
      const points = poses.map((pose) => place(pose[number]).map((value) => value.toFixed(1)).join(","));
      if (wayLength(poses, number) > TRAIL_SHOWN) this.layers.paths.append(...paths);
      return { group, paths, points };
    });
  }

  moveTo(index) {
    this.index = index;
    this.disks.forEach(({ group, paths, points }, number) => {
      const pose = this.episode.frames.poses[index][number], [x, y] = place(pose);
      group.setAttribute("transform", `translate(${x} ${y}) rotate(${turn(pose)})`);
      paths[0].setAttribute("points", points.slice(index).join(" "));
      paths[1].setAttribute("points", points.slice(0, index + 1).join(" "));
    });
    this.layers.paths.style.display = this.shown.paths ? "" : "none";
  }

  showPush(push, number) {
    this.push = [push, number];
    this.layers.push.replaceChildren();
    this.layers.ghosts.replaceChildren();
    if (!push) return;
    for (const kind of ["physics", "expected"]) {
      if (this.shown[kind] && push[kind]) this.layers.ghosts.append(...this.ghosts(push, kind));
    }
    if (push.tool) this.layers.push.append(this.arrow(push, number));
  }

  // Outlines of the disks that the push was to move, or did.
  ghosts(push, kind) {
    const from = push.before ?? push[kind];
    return push[kind].flatMap((pose, number) => {
      const moved = [pose, push.after?.[number] ?? pose].some((end) => apart(from[number], end) > TRAIL_SHOWN);
      if (!moved || !this.episode.disks[number]) return [];
      const [x, y] = place(pose), arm = this.px(3.5);
      return [
        outline(this.episode.disks[number], pose, { class: `ghost ${kind}`, "data-disk": number }),
        draw("path", { class: `ghost ${kind}`, d: `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}` }),
      ];
    });
  }

  arrow(push, number) {
    const [x1, y1] = place(push.tool[0]), [x2, y2] = place(push.tool[1]);
    const reach = Math.hypot(x2 - x1, y2 - y1) || 1, along = [(x2 - x1) / reach, (y2 - y1) / reach];
    const head = Math.min(this.px(11), reach), half = 0.42 * head;
    const neck = [x2 - head * along[0], y2 - head * along[1]];
    const side = [-half * along[1], half * along[0]];
    const corners = [[x2, y2], [neck[0] + side[0], neck[1] + side[1]], [neck[0] - side[0], neck[1] - side[1]]];
    const shaft = { x1, y1, x2: neck[0], y2: neck[1] };
    return draw("g", { class: push.outcome },
      draw("line", { class: "halo", ...shaft }), draw("line", { class: "tool", ...shaft }),
      draw("polygon", { class: "tip", points: corners.map((corner) => corner.join(",")).join(" ") }),
      draw("circle", { class: "badge", cx: x1, cy: y1, r: this.px(9) }),
      draw("text", { class: "digit", x: x1, y: y1 }, String(number)));
  }
}

export { TopView };
