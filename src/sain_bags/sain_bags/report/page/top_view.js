// An episode from above: the things that the recording's lists hold, at one of its moments.

import { draw, onWidth } from "./elements.js";
import { wayLength } from "./geometry.js";
import { areas, arrow, ghost, goal, mover, outline, place, turn } from "./things.js";

const TRAIL_SHOWN = 1; // [mm], a disk that moved less leaves no path

class TopView {
  constructor(svg, data) {
    this.svg = svg;
    this.stage = data.stage;
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
    const px = (pixels) => this.px(pixels);
    this.push = [];
    this.episode = episode;
    this.svg.style.setProperty("--pixel", this.px(1));
    this.svg.setAttribute("aria-label", `Top view of episode ${episode.number}: table, arm, disks, goal, pushes`);
    for (const name of ["table", "goal", "starts", "paths", "ghosts", "disks", "push"]) {
      this.layers[name] = draw("g", { class: name });
    }
    this.svg.replaceChildren(...Object.values(this.layers));
    const arm = draw("text", { y: this.px(4), "text-anchor": "middle" }, "arm");
    this.layers.table.append(...this.stage.flatMap(areas), draw("circle", { class: "base", r: 55 }), arm, ...this.scale());
    this.layers.goal.append(...episode.goals.flatMap((mark) => goal(mark, px)));
    this.drawDisks();
    this.moveTo(index);
  }

  scale() {
    const x = this.box.x + this.px(14), y = this.box.y + this.box.height - this.px(14);
    const text = draw("text", { x: x + 50, y: y - this.px(7), "text-anchor": "middle" }, "10 cm");
    return [draw("line", { class: "scale", x1: x, y1: y, x2: x + 100, y2: y }), text];
  }

  drawDisks() {
    const poses = this.episode.frames.poses;
    this.disks = this.episode.disks.map((body, number) => {
      const name = `c-${body.colour}`, group = mover(body);
      this.layers.starts.append(outline(body, poses[0][number], { class: `start ${name}` }));
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
    const px = (pixels) => this.px(pixels);
    this.push = [push, number];
    this.layers.push.replaceChildren();
    this.layers.ghosts.replaceChildren();
    for (const thing of push?.things ?? []) {
      if (thing.kind === "push") this.layers.push.append(arrow(thing, push.outcome, number, px));
      else if (this.shown[thing.look]) this.layers.ghosts.append(...ghost(thing, px));
    }
  }
}

export { TopView };
