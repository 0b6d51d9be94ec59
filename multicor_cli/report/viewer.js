/* The controls of the interactive view. */

const $ = (id) => document.getElementById(id);

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** A number for people, with some digits. */
function format(value, digits = 4) {
  if (value === null || Number.isNaN(value)) return "–";
  const [mantissa, exponent] = value.toPrecision(digits).split("e");
  const size = Math.abs(value);
  if (exponent === undefined && (size >= 1e-3 || size === 0)) return tidy(mantissa);
  const [m, e] = value.toExponential(digits - 1).split("e");
  const power = Math.abs(Number(e)).toString().replace(/\d/g, (digit) => SUPERSCRIPTS[digit]);
  return `${tidy(m)}·10${Number(e) < 0 ? "⁻" : ""}${power}`;
}

/** Without zeros at the end, and with a real minus sign. */
function tidy(text) {
  const short = text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  return short.replace("-", "−");
}

const state = {
  number: 0, // of the frame wanted
  frame: null, // the frame shown
  isPlaying: false,
  field: meta.fields[0],
  selected: -1,
  picture: null,
  isIdle: true, // no drawing is waiting for its turn
};

// ---------------------------------------------------------------------------------------------------------------- drawing

function redraw() {
  if (!state.isIdle) return;
  state.isIdle = false;
  requestAnimationFrame(() => {
    state.isIdle = true;
    if (!state.frame || !state.picture) return;
    const values = state.frame.values[state.field.name];
    const range = $("range").value === "frame" && values ? frameRange(state.field, values) : state.field.range;
    const colors = makeColors(state.field.colors);
    const show = { field: state.field, range, colors, hasContacts: $("contacts").checked, selected: state.selected };
    state.picture.draw(state.frame, show);
    showBar(colors, range);
  });
}

function showBar(colors, range) {
  const { label, unit, scale, reference, name } = state.field;
  const isKnown = Boolean(state.frame.values[name]);
  const rise = reference === null ? { shift: 0, factor: 1, unit } : { shift: reference, factor: 1e3, unit: "mK" };
  const above = reference === null ? "" : ` above ${reference} K`;
  $("bar-label").textContent = `${label}${above} [${rise.unit}]${isKnown ? "" : " – not recorded in this frame"}`;
  $("bar-colors").style.background = `linear-gradient(to right, ${colors.filter((_, k) => k % 15 === 0).join(",")})`;
  const shares = [0, 0.25, 0.5, 0.75, 1];
  const value = (share) =>
    scale === "logarithmic" ? range[0] * (range[1] / range[0]) ** share : range[0] + share * (range[1] - range[0]);
  $("bar-ticks").replaceChildren(
    ...shares.map((share) => {
      const tick = document.createElement("span");
      tick.textContent = format((value(share) - rise.shift) * rise.factor, 3);
      return tick;
    }),
  );
}

async function showFrame(number) {
  state.number = Math.max(0, Math.min(number, meta.frames.length - 1));
  const wanted = state.number;
  const frame = await loadFrame(wanted);
  if (wanted !== state.number) return; // another one was asked for meanwhile
  state.frame = frame;
  const { index, time, step, stage } = frame.about;
  $("scrub").value = wanted;
  const place = `frame ${index} of 0–${meta.frameCount - 1}`;
  $("scrub").setAttribute("aria-valuetext", `${place}, ${format(time)} seconds`);
  $("where").textContent = `${place} · t = ${format(time)} s · step ${step}${stage ? ` · ${stage}` : ""}`;
  $("contact-note").textContent = contactNote(frame);
  showValues();
  redraw();
}

function contactNote(frame) {
  if (!$("contacts").checked) return "";
  if (!frame.contacts.known) return "the contacts of this frame are not in the file";
  const all = frame.about.contactCount, shown = frame.contacts.force.length;
  return shown < all ? `the ${shown} strongest of ${all} contacts` : `${all} contacts carry a force`;
}

// ----------------------------------------------------------------------------------------------------------------- values

/** Names and values of a grain. */
function valuesOf(grain) {
  const { frame, picture } = state;
  const rows = [["grain", String(grain)]];
  if (meta.group.length) rows.push(["group", meta.groups[meta.group[grain]]]);
  rows.push(["radius", `${format(picture.radii[grain])} m`]);
  rows.push(["x, y", `${format(frame.x[grain])}, ${format(frame.y[grain])} m`]);
  for (const field of meta.fields) {
    const values = frame.values[field.name];
    const digits = field.unit === "K" ? 8 : 4;
    rows.push([field.label, values ? `${format(values[grain], digits)} ${field.unit}` : "–"]);
  }
  return rows;
}

function fillList(list, rows) {
  list.replaceChildren(
    ...rows.flatMap(([name, value]) => {
      const term = document.createElement("dt"), text = document.createElement("dd");
      term.textContent = name;
      text.textContent = value;
      return [term, text];
    }),
  );
}

function showValues() {
  const isChosen = state.selected >= 0 && state.selected < meta.grains && state.frame;
  $("chosen").hidden = !isChosen;
  if (isChosen) fillList($("chosen"), valuesOf(state.selected));
}

function select(grain) {
  state.selected = grain;
  $("grain").value = grain >= 0 ? grain : "";
  showValues();
  redraw();
}

function showTip(event) {
  const tip = $("tip");
  const grain = state.frame ? state.picture.findGrain(state.frame, event.clientX, event.clientY) : -1;
  tip.hidden = grain < 0;
  if (grain < 0) return;
  fillList(tip, valuesOf(grain));
  const area = $("stage").getBoundingClientRect();
  const x = event.clientX - area.left, y = event.clientY - area.top;
  tip.style.left = `${x < area.width / 2 ? x + 14 : Math.max(0, x - tip.offsetWidth - 14)}px`;
  tip.style.top = `${Math.max(0, Math.min(y + 12, area.height - tip.offsetHeight))}px`;
}

// ---------------------------------------------------------------------------------------------------------------- playing

function setPlaying(isPlaying) {
  if (isPlaying === state.isPlaying) return;
  state.isPlaying = isPlaying;
  $("play").textContent = isPlaying ? "❚❚ Pause" : "▶ Play";
  $("play").setAttribute("aria-pressed", String(isPlaying));
  if (!isPlaying) return;
  const first = state.number === meta.frames.length - 1 ? showFrame(0) : Promise.resolve();
  first.then(() => requestAnimationFrame((now) => advance(now, now)));
}

/** Go on to the next frame when it is time; the next one is never asked for before this one is there. */
async function advance(now, last) {
  if (!state.isPlaying) return;
  const interval = 1000 / Number($("speed").value);
  if (now - last >= interval) {
    const next = state.number + 1;
    if (next >= meta.frames.length && !$("loop").checked) {
      setPlaying(false);
      return;
    }
    await showFrame(next % meta.frames.length);
    last = Math.max(last + interval, now - interval);
  }
  requestAnimationFrame((later) => advance(later, last));
}

function stepTo(number) {
  setPlaying(false);
  showFrame(number);
}

// --------------------------------------------------------------------------------------------------------------- pointers

const pointers = new Map();
let moved = 0;

function zoomCenter(factor) {
  const frame = $("canvas").getBoundingClientRect();
  zoom(factor, frame.left + frame.width / 2, frame.top + frame.height / 2);
}

function zoom(factor, x, y) {
  state.picture.zoomAt(factor, x, y);
  afterMove();
}

function pan(dx, dy) {
  state.picture.pan(dx, dy);
  afterMove();
}

function afterMove() {
  // At the smallest zoom a finger scrolls the page; enlarged it moves the picture.
  $("canvas").style.touchAction = state.picture.zoom > 1 ? "none" : "pan-y";
  redraw();
}

function spread() {
  const [a, b] = [...pointers.values()];
  return { distance: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
}

function onPointerMove(event) {
  const before = pointers.get(event.pointerId);
  if (!before) {
    showTip(event);
    return;
  }
  const start = pointers.size === 2 ? spread() : null;
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  moved += Math.hypot(event.clientX - before.x, event.clientY - before.y);
  if (start) {
    const now = spread();
    state.picture.pan(now.x - start.x, now.y - start.y);
    zoom(now.distance / Math.max(start.distance, 1), now.x, now.y);
  } else if (moved > 4) {
    $("tip").hidden = true;
    pan(event.clientX - before.x, event.clientY - before.y);
  }
}

function onPointerUp(event) {
  const isTap = pointers.size === 1 && moved <= 4;
  pointers.delete(event.pointerId);
  if (isTap && state.frame) select(state.picture.findGrain(state.frame, event.clientX, event.clientY));
}

function listenToPointers(canvas) {
  canvas.addEventListener("pointerdown", (event) => {
    if (!pointers.size) moved = 0;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", onPointerMove);
  canvas.addEventListener("pointerup", onPointerUp);
  canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => ($("tip").hidden = true));
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (state.picture.zoom === 1 && event.deltaY > 0) return; // nothing to zoom out of: the page scrolls
      event.preventDefault();
      zoom(Math.exp(-0.0015 * event.deltaY * (event.deltaMode ? 30 : 1)), event.clientX, event.clientY);
    },
    { passive: false },
  );
}

// --------------------------------------------------------------------------------------------------------------- keyboard

const KEYS = {
  " ": () => setPlaying(!state.isPlaying),
  ArrowLeft: () => stepTo(state.number - 1),
  ArrowRight: () => stepTo(state.number + 1),
  Home: () => stepTo(0),
  End: () => stepTo(meta.frames.length - 1),
  "+": () => zoomCenter(1.25),
  "-": () => zoomCenter(0.8),
  0: () => fit(),
  c: () => $("contacts").click(),
};
const PANS = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const act = event.shiftKey && PANS[event.key] ? () => pan(...PANS[event.key]) : KEYS[event.key];
  if (!act) return;
  event.preventDefault();
  act();
}

function fit() {
  state.picture.fit();
  afterMove();
}

// ------------------------------------------------------------------------------------------------------------------ start

function toggleTheme() {
  const root = document.documentElement;
  const isDark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = isDark ? "light" : "dark";
  redraw();
}

function listen() {
  $("play").addEventListener("click", () => setPlaying(!state.isPlaying));
  $("back").addEventListener("click", () => stepTo(state.number - 1));
  $("next").addEventListener("click", () => stepTo(state.number + 1));
  $("scrub").addEventListener("input", () => stepTo(Number($("scrub").value)));
  $("field").addEventListener("change", () => {
    state.field = meta.fields[Number($("field").value)];
    redraw();
  });
  $("range").addEventListener("change", redraw);
  $("contacts").addEventListener("change", () => {
    $("contact-note").textContent = contactNote(state.frame);
    redraw();
  });
  $("grain").addEventListener("input", () => {
    const text = $("grain").value;
    state.selected = text === "" ? -1 : Number(text);
    showValues();
    redraw();
  });
  $("zoom-in").addEventListener("click", () => zoomCenter(1.5));
  $("zoom-out").addEventListener("click", () => zoomCenter(1 / 1.5));
  $("fit").addEventListener("click", fit);
  $("canvas").addEventListener("keydown", onKey);
  listenToPointers($("canvas"));
  window.addEventListener("resize", () => {
    state.picture.resize();
    redraw();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

async function start() {
  $("theme").addEventListener("click", toggleTheme);
  try {
    state.picture = new Picture($("canvas"), await loadRadii());
    $("scrub").max = meta.frames.length - 1;
    $("grain").max = meta.grains - 1;
    $("field").replaceChildren(...meta.fields.map((field, k) => new Option(field.label, k)));
    listen();
    await showFrame(meta.frames.length - 1);
    afterMove();
  } catch (error) {
    $("trouble").textContent = error.message;
    $("trouble").hidden = false;
  }
}

start();
