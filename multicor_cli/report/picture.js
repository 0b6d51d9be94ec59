/* Grains, walls and contacts on a canvas. */

const COLORS = {
  viridis: "44015448186a472d7b4240863b528b33638d2c728e26828e21918c1fa08828ae803fbc735ec96284d44baddc30d8e219fde725",
  plasma: "0d08873105974c02a16600a77e03a89511a1aa2395bc3587cc4778da5a6ae66c5cf0804ef89540fdac33fdc527f8df25f0f921",
  magma: "0000040a08221d114736106b51127c6a1c818326819c2e7fb73779d0416fe75263f56b5cfc8961fea772fec488fde2a3fcfdbf",
  balance: "053c6e0b5c9c2f7fb96aa5cf9fc6e0d3d9ddeccdb9e8a983d9774fbd4a25862a0b",
};
const STEPS = 256;
const CRISP = 20000; // with more grains a picture has two pixels per point at most
const LEAST = 0.6; // smallest radius of a grain, in points
const STRIP = 28; // height of the strip below the picture, where the ruler is, in points
const NEARLY = 1.02; // a box that fills the picture to this factor is all that the run shows
const NONE = STEPS; // number of the color of grains that have nothing of what a logarithmic scale shows

/** Some 256 colors as CSS texts, from evenly spaced ones. */
function makeColors(name) {
  const anchors = COLORS[name].match(/.{6}/g).map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));
  return Array.from({ length: STEPS }, (_, step) => {
    const place = (step / (STEPS - 1)) * (anchors.length - 1);
    const k = Math.min(Math.floor(place), anchors.length - 2);
    const mixed = anchors[k].map((channel, c) => Math.round(channel + (place - k) * (anchors[k + 1][c] - channel)));
    return `rgb(${mixed.join(",")})`;
  });
}

/** The number of the color of a value; -1 if it is not known, NONE if it is below a logarithmic scale. */
function colorIndex(field, value, [low, high]) {
  if (Number.isNaN(value)) return -1;
  const isLogarithmic = field.scale === "logarithmic";
  if (isLogarithmic && value < low) return NONE;
  const share = isLogarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.max(0, Math.min(STEPS - 1, Math.floor(share * STEPS)));
}

/** Smallest and largest value of a frame that get a color of their own. */
function frameRange(field, values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return field.range;
  if (field.scale === "logarithmic") return high > 0 ? [high * 1e-4, high] : field.range;
  if (field.scale === "centered") [low, high] = [-Math.max(-low, high), Math.max(-low, high)];
  if (meta.codes[field.name].spacing === "square") [low, high] = [0, high || 1];
  return low < high ? [low, high] : [low - (Math.abs(low) * 1e-3 || 1), high + (Math.abs(high) * 1e-3 || 1)];
}

/** Width, height and tilt by which images lie apart in a frame [m]; 0 where there are none. */
function sidesOf(frame) {
  return meta.isCell ? frame.about.walls[0] : [meta.period, 0, 0];
}

/** Values of images in a cell from their velocities, where they move as the mean flow. */
const OF_FLOW = { velocity: (u) => u, "velocity-y": (u, v) => v, speed: Math.hypot };

/** Where points of a wall are when its displacement and angle are these. */
function placing([dx, dy, angle]) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return ([x, y]) => [c * x - s * y + dx, s * x + c * y + dy];
}

class Picture {
  /** @param {HTMLCanvasElement} canvas where to draw
   *  @param {Float32Array} radii radii of the grains at the start [m]
   *  @param {Array} looks rings around each grain, null for discs */
  constructor(canvas, radii, looks) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.radii = radii;
    this.looks = looks;
    this.largest = radii.reduce((a, b) => Math.max(a, b), meta.codes.radius ? meta.codes.radius.high : 0);
    this.mean = radii.reduce((a, b) => a + b, 0) / Math.max(radii.length, 1);
    this.fit();
  }

  /** Radii of the grains in a frame [m]. */
  radiiIn(frame) {
    return frame.radii || this.radii;
  }

  /** Show what is in a box [m], by default everything that the run ever shows. */
  fit([[left, bottom], [right, top]] = meta.box) {
    this.center = [(left + right) / 2, (bottom + top) / 2];
    this.zoom = 1;
    this.resize();
    const closer = Math.min(this.canvas.width / (right - left), (2 * this.middle) / (top - bottom)) / this.whole;
    this.zoom = closer > NEARLY ? closer : 1;
    this.home = this.zoom;
    this.isMoved = false;
  }

  /** Height of the middle of the picture, which ends above the ruler, in pixels. */
  get middle() {
    return (this.canvas.height - STRIP * this.pixels) / 2;
  }

  /** Take up the size that the page gives the canvas. */
  resize() {
    const [[left, bottom], [right, top]] = meta.box;
    const width = this.canvas.clientWidth;
    // Not innerHeight: that changes when a phone hides its bars while the page scrolls.
    const most = 0.64 * document.documentElement.clientHeight;
    const height = STRIP + Math.round(Math.max(192, Math.min((width * (top - bottom)) / (right - left), most)));
    this.canvas.style.height = `${height}px`;
    this.pixels = Math.min(window.devicePixelRatio || 1, meta.grains > CRISP ? 2 : 3);
    this.canvas.width = Math.round(width * this.pixels);
    this.canvas.height = Math.round(height * this.pixels);
    this.whole = Math.min(this.canvas.width / (right - left), (2 * this.middle) / (top - bottom));
  }

  /** Pixels per meter. */
  get scale() {
    return this.whole * this.zoom;
  }

  /** Where a point of the page lies [m]. */
  toWorld(clientX, clientY) {
    const frame = this.canvas.getBoundingClientRect();
    const x = (clientX - frame.left) * this.pixels, y = (clientY - frame.top) * this.pixels;
    return [
      this.center[0] + (x - this.canvas.width / 2) / this.scale,
      this.center[1] - (y - this.middle) / this.scale,
    ];
  }

  /** Zoom by a factor about a point of the page that stays where it is. */
  zoomAt(factor, clientX, clientY) {
    const before = this.toWorld(clientX, clientY);
    this.zoom = Math.max(1, Math.min(this.zoom * factor, 4000));
    this.isMoved = true;
    const after = this.toWorld(clientX, clientY);
    this.center = [this.center[0] + before[0] - after[0], this.center[1] + before[1] - after[1]];
    this.keepInside();
  }

  /** Move by pixels of the page. */
  pan(dx, dy) {
    this.isMoved = true;
    this.center = [this.center[0] - (dx * this.pixels) / this.scale, this.center[1] + (dy * this.pixels) / this.scale];
    this.keepInside();
  }

  keepInside() {
    const [[left, bottom], [right, top]] = meta.box;
    this.center = [Math.max(left, Math.min(this.center[0], right)), Math.max(bottom, Math.min(this.center[1], top))];
    if (this.zoom === 1) this.center = [(left + right) / 2, (bottom + top) / 2];
  }

  /** Draw a frame.
   *  @param {object} frame from loadFrame
   *  @param {object} show field, its colors and range, force of the widest contacts (0: no contacts), selected grain or -1 */
  draw(frame, show) {
    const context = this.context, style = getComputedStyle(this.canvas);
    this.ink = (name) => style.getPropertyValue(name);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    const scale = this.scale;
    // The axis y points up: coordinates in meters from here on, lengths of lines too.
    context.setTransform(scale, 0, 0, -scale, this.canvas.width / 2 - this.center[0] * scale, this.middle + this.center[1] * scale);
    context.save();
    this.sides = sidesOf(frame);
    if (meta.period > 0) this.clipToPeriod();
    this.drawGrains(frame, show);
    if (!meta.isCell) this.drawWalls(frame.about.walls);
    if (show.widest > 0) this.drawContacts(frame, show.widest);
    this.drawSelected(frame, show.selected);
    context.restore();
    if (meta.period > 0) this.drawSeam();
    this.drawRuler();
  }

  clipToPeriod() {
    const far = 1e3 * (meta.box[1][1] - meta.box[0][1]);
    this.context.beginPath();
    if (meta.isCell) for (const corner of this.corners()) this.context.lineTo(...corner);
    else this.context.rect(0, meta.box[0][1] - far, meta.period, 2 * far);
    this.context.clip();
  }

  /** Corners of the cell, the first one again at the end. */
  corners() {
    const [width, height, tilt] = this.sides;
    return [[0, 0], [width, 0], [width + tilt, height], [tilt, height], [0, 0]];
  }

  /** The ends of the period, or sides of the cell: what leaves at one comes in at the other. */
  drawSeam() {
    const context = this.context, pixel = this.pixels / this.scale, far = 1e3 * (meta.box[1][1] - meta.box[0][1]);
    context.strokeStyle = this.ink("--soft");
    context.lineWidth = pixel;
    context.setLineDash([4 * pixel, 4 * pixel]);
    const [, , bottom, top] = this.visible();
    if (meta.isCell) this.strokeLine(...this.corners());
    else for (const x of [0, meta.period]) this.strokeLine([x, Math.max(bottom, -far)], [x, Math.min(top, far)]);
    context.setLineDash([]);
  }

  /** A line of a round length in the corner, below the picture. */
  drawRuler() {
    const context = this.context, pixel = this.pixels, length = roundDown((0.2 * this.canvas.width) / this.scale);
    const [unit, factor] = [["m", 1], ["mm", 1e3], ["µm", 1e6]].find(([, times]) => length * times >= 1) || ["m", 1];
    const [x, y, width] = [10 * pixel, this.canvas.height - 12 * pixel, length * this.scale];
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.font = `600 ${12 * pixel}px system-ui, sans-serif`;
    context.lineJoin = context.lineCap = "round";
    context.fillStyle = this.ink("--ink");
    for (const [color, line] of [["--paper", 5], ["--ink", 2]]) { // set off from grains of any color
      context.strokeStyle = this.ink(color);
      context.lineWidth = line * pixel;
      this.strokeLine([x, y], [x + width, y]);
      if (color === "--paper") context.strokeText(`${format(length * factor)} ${unit}`, x, y - 6 * pixel);
    }
    context.fillText(`${format(length * factor)} ${unit}`, x, y - 6 * pixel);
  }

  /** Call paint(x, y) for a disc and for its images that cross the sides. */
  withImages(x, y, reach, paint) {
    const [, height, tilt] = this.sides;
    this.withImagesOf(x, y, reach * Math.hypot(1, height > 0 ? tilt / height : 0), reach, paint);
  }

  /** The same for what reaches so far from its middle, along the lower side and upwards. */
  withImagesOf(x, y, across, upwards, paint) {
    paint(x, y);
    const [width, height, tilt] = this.sides;
    if (width <= 0) return;
    const along = height > 0 ? x - (tilt / height) * y : x;
    const ways = [0];
    if (height > 0 && y + upwards > height) ways.push(-1);
    if (height > 0 && y - upwards < 0) ways.push(1);
    for (const up of ways) {
      const [right, high] = [x + up * tilt, y + up * height];
      if (up) paint(right, high);
      if (along + across > width) paint(right - width, high);
      if (along - across < 0) paint(right + width, high);
    }
  }

  /** The nearest image of a way. */
  shortest(dx, dy) {
    const [width, height, tilt] = this.sides;
    const up = height > 0 ? Math.round(dy / height) : 0;
    const across = dx - up * tilt;
    return [width > 0 ? across - width * Math.round(across / width) : dx, dy - up * height];
  }

  /** Corners of what is visible [m], with some room. */
  visible() {
    const [x, y] = this.center, half = this.canvas.width / 2 / this.scale + this.largest;
    const above = this.middle / this.scale + this.largest, below = (this.canvas.height - this.middle) / this.scale + this.largest;
    return [x - half, x + half, y - below, y + above];
  }

  drawGrains(frame, show) {
    const { x, y } = frame, radii = this.radiiIn(frame), values = frame.values[show.field.name];
    const [left, right, bottom, top] = this.visible();
    const buckets = Array.from({ length: NONE + 2 }, () => []);
    const flow = meta.isCell && frame.values.velocity && frame.values["velocity-y"] && OF_FLOW[show.field.name];
    for (let k = 0; k < x.length; k++) {
      const own = values ? colorIndex(show.field, values[k], show.range) : -1;
      this.withImages(x[k], y[k], radii[k], (at, high) => {
        if (at < left || at > right || high < bottom || high > top) return;
        let color = own;
        if (flow && (at !== x[k] || high !== y[k])) {
          const [xx, yy, xy] = frame.about.gradient, [dx, dy] = [at - x[k], high - y[k]];
          const u = frame.values.velocity[k] + xx * dx + xy * dy, v = frame.values["velocity-y"][k] + yy * dy;
          color = colorIndex(show.field, flow(u, v), show.range);
        }
        buckets[color + 1].push(k, at, high);
      });
    }
    buckets.forEach((bucket, number) => {
      const color = { 0: this.ink("--unknown"), [NONE + 1]: this.ink("--paper") }[number] || show.colors[number - 1];
      if (bucket.length) this.fillGrains(frame, bucket, color);
    });
  }

  fillGrains(frame, bucket, color) {
    const context = this.context, radii = this.radiiIn(frame), isSmall = this.largest * this.scale < 1.5, least = (LEAST * this.pixels) / this.scale;
    context.fillStyle = color;
    if (!isSmall) context.beginPath();
    for (let k = 0; k < bucket.length; k += 3) {
      const a = Math.max(radii[bucket[k]], least), at = bucket[k + 1], high = bucket[k + 2];
      if (isSmall) {
        context.fillRect(at - a, high - a, 2 * a, 2 * a);
      } else {
        this.trace(frame, bucket[k], at, high, a);
      }
    }
    if (isSmall) return;
    context.fill();
    if (this.mean * this.scale > 4) {
      context.strokeStyle = this.ink("--edge");
      context.lineWidth = 0.6 * this.pixels / this.scale;
      context.stroke();
    }
  }

  /** Add the outline of a grain of a radius at a place to the path. */
  trace(frame, grain, x, y, radius) {
    const context = this.context;
    if (!this.looks[grain]) {
      context.moveTo(x + radius, y);
      context.arc(x, y, radius, 0, 2 * Math.PI);
      return;
    }
    const c = radius * Math.cos(frame.angle[grain]), s = radius * Math.sin(frame.angle[grain]);
    for (const ring of this.looks[grain]) {
      context.moveTo(x + c * ring[0] - s * ring[1], y + s * ring[0] + c * ring[1]);
      for (let k = 2; k < ring.length; k += 2) context.lineTo(x + c * ring[k] - s * ring[k + 1], y + s * ring[k] + c * ring[k + 1]);
      context.closePath();
    }
  }

  /** Whether a grain covers the point that lies so far from its center. */
  covers(frame, grain, dx, dy) {
    const context = this.context, size = 1000 / this.radiiIn(frame)[grain];
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.beginPath();
    this.trace(frame, grain, 0, 0, 1000);
    return context.isPointInPath(dx * size, dy * size);
  }

  drawWalls(poses) {
    const context = this.context;
    context.strokeStyle = this.ink("--wall");
    context.fillStyle = this.ink("--glued");
    for (const { wall, corners } of meta.solids) {
      const place = placing(poses[wall]);
      context.beginPath();
      for (const corner of corners) context.lineTo(...place(corner));
      context.fill();
    }
    const width = 2 * this.pixels / this.scale;
    for (const { wall, points, radius, normal, isGrain } of meta.shapes) {
      points.forEach((local, shape) => {
        const pose = poses[wall[shape]];
        const placed = local.map(placing(pose));
        context.lineWidth = width;
        if (isGrain) this.drawGlued(placed[0], radius[shape]);
        else if (radius) this.strokeCircle(placed[0], radius[shape]);
        else if (normal) this.drawEndless(placed[0], placing([0, 0, pose[2]])(normal[shape]));
        else this.strokeLine(...placed);
      });
    }
  }

  drawGlued([x, y], a) {
    const context = this.context;
    const wrapped = meta.period > 0 ? x - meta.period * Math.floor(x / meta.period) : x;
    context.lineWidth = 0.6 * this.pixels / this.scale;
    this.withImages(wrapped, y, a, (at, high) => {
      context.beginPath();
      context.arc(at, high, a, 0, 2 * Math.PI);
      context.fill();
      if (a * this.scale > 3) context.stroke();
    });
  }

  strokeCircle([x, y], a) {
    this.context.beginPath();
    this.context.arc(x, y, a, 0, 2 * Math.PI);
    this.context.stroke();
  }

  strokeLine(...corners) {
    this.context.beginPath();
    for (const corner of corners) this.context.lineTo(...corner);
    this.context.stroke();
  }

  /** The visible part of an endless wall. */
  drawEndless([x, y], [nx, ny]) {
    const far = 3 * Math.hypot(meta.box[1][0] - meta.box[0][0], meta.box[1][1] - meta.box[0][1]);
    this.strokeLine([x - far * ny, y + far * nx], [x + far * ny, y - far * nx]);
  }

  /** A line for every contact, its width proportional to its force, up to a largest force. */
  drawContacts(frame, force) {
    const { first, force: forces } = frame.contacts, context = this.context;
    const widest = 0.9 * this.mean, pixel = this.pixels / this.scale;
    const groups = new Map();
    for (let k = 0; k < first.length; k++) {
      const step = Math.ceil(Math.min(forces[k] / force, 1) * 40); // lines of nearly equal width are drawn at once
      if (!groups.has(step)) groups.set(step, []);
      groups.get(step).push(k);
    }
    // A rim in the color of the paper sets the lines off from grains of any color, if there is room for one.
    const isFine = this.mean < 4 * pixel;
    context.lineCap = isFine ? "butt" : "round";
    const coats = [[this.ink("--paper"), 1.5 * pixel], [this.ink("--contact"), 0]];
    for (const [color, rim] of isFine ? coats.slice(1) : coats) {
      context.strokeStyle = color;
      for (const [step, members] of groups) {
        const width = (step / 40) * widest;
        if (isFine && width < 0.25 * pixel) continue; // too weak to be seen
        context.lineWidth = Math.max(width, 0.4 * pixel) + rim;
        context.beginPath();
        for (const k of members) this.addContact(frame, k);
        context.stroke();
      }
    }
  }

  /** From center to center, through the point of contact where not all grains are discs; with a wall only to that point. */
  addContact(frame, k) {
    const { first, end: ends, arm } = frame.contacts, i = first[k], end = ends[k];
    const x = frame.x[i], y = frame.y[i], isWall = end >= meta.grains;
    const angle = ((end - meta.grains) / 1024) * 2 * Math.PI;
    const [dx, dy] = isWall
      ? [this.radiiIn(frame)[i] * Math.cos(angle), this.radiiIn(frame)[i] * Math.sin(angle)]
      : this.shortest(frame.x[end] - x, frame.y[end] - y);
    if (arm) {
      const [ax, ay] = [arm[0][k], arm[1][k]];
      this.addLine(x, y, ax, ay);
      if (!isWall) this.addLine(x + ax, y + ay, dx - ax, dy - ay);
    } else {
      this.addLine(x, y, dx, dy);
    }
  }

  /** A line so far from a point, with its images. */
  addLine(x, y, dx, dy) {
    const [, height, tilt] = this.sides, across = Math.abs(height > 0 ? dx - (tilt / height) * dy : dx) / 2;
    this.withImagesOf(x + dx / 2, y + dy / 2, across, Math.abs(dy) / 2, (middle, high) => {
      this.context.moveTo(middle - dx / 2, high - dy / 2);
      this.context.lineTo(middle + dx / 2, high + dy / 2);
    });
  }

  drawSelected(frame, grain) {
    if (!(grain >= 0 && grain < meta.grains)) return;
    const context = this.context;
    const a = Math.max(this.radiiIn(frame)[grain], 4 * this.pixels / this.scale);
    const outline = (at, high) => {
      context.beginPath();
      this.trace(frame, grain, at, high, a);
      context.stroke();
    };
    for (const [color, width] of [[this.ink("--paper"), 5], [this.ink("--accent"), 2.5]]) {
      context.strokeStyle = color;
      context.lineWidth = width * this.pixels / this.scale;
      this.withImages(frame.x[grain], frame.y[grain], a, outline);
    }
  }

  /** The grain at a point of the page, or -1. */
  findGrain(frame, clientX, clientY) {
    const [px, py] = this.toWorld(clientX, clientY);
    const radii = this.radiiIn(frame), slack = (4 * this.pixels) / this.scale; // small grains need not be hit exactly
    let found = -1, best = Infinity;
    this.sides = sidesOf(frame);
    for (let k = 0; k < frame.x.length; k++) {
      const way = this.shortest(px - frame.x[k], py - frame.y[k]), distance = Math.hypot(...way) - radii[k];
      if (distance < 0 && radii[k] > slack && !this.covers(frame, k, ...way)) continue;
      if (distance < Math.min(best, Math.max(0, slack - radii[k]))) [found, best] = [k, distance];
    }
    return found;
  }
}
