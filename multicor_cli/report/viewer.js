/* The controls of the interactive view. */

const $ = (id) => document.getElementById(id);

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

/** Draw when the browser is ready for it. */
function redraw() {
  if (!state.isIdle) return;
  state.isIdle = false;
  requestAnimationFrame(() => {
    state.isIdle = true;
    draw();
  });
}

function draw() {
  if (!state.frame || !state.picture) return;
  const { field, frame, selected } = state, isOneFrame = $("range").value === "frame";
  const values = frame.values[field.name];
  const range = isOneFrame && values ? frameRange(field, values) : field.range;
  const colors = makeColors(field.colors);
  const widest = $("contacts").checked ? widestForce(frame, isOneFrame) : 0;
  state.picture.draw(frame, { field, range, colors, widest, selected });
  showBar(field, colors, range, isOneFrame, Boolean(values));
  $("contact-note").textContent = $("contacts").checked ? contactNote(frame, widest) : "";
}

/** The force of the widest lines [N]: four times the mean. */
function widestForce({ contacts }, isOneFrame) {
  const { force } = contacts;
  return 4 * (isOneFrame && force.length ? force.reduce((a, b) => a + b, 0) / force.length : meta.meanForce);
}

async function showFrame(number) {
  state.number = Math.max(0, Math.min(number, meta.frames.length - 1));
  // The view of one frame may be too narrow for the others; one that someone has chosen stays.
  if (state.frame && !state.picture.isMoved && state.picture.zoom > 1) {
    state.picture.fit();
    afterMove();
  }
  const wanted = state.number;
  const frame = await loadFrame(wanted);
  if (wanted !== state.number) return; // another one was asked for meanwhile
  state.frame = frame;
  const { index, time, step, stage } = frame.about;
  $("scrub").value = wanted;
  const place = `frame ${index} of 0–${meta.frameCount - 1}`;
  $("scrub").setAttribute("aria-valuetext", `${place}, ${format(time)} seconds`);
  $("where").textContent = `${place} · t = ${format(time)} s · step ${step}`;
  $("stage-name").textContent = stage;
  showValues();
  if (pointed) showTip(pointed);
  redraw();
}

function contactNote(frame, widest) {
  if (!frame.contacts.known) return "the contacts of this frame are not in the file";
  const all = frame.about.contactCount, shown = frame.contacts.force.length;
  const count = shown < all ? `the ${shown} strongest of ${all} contacts` : `${all} contacts carry a force`;
  return shown ? `${count}; the widest lines stand for ${format(widest, 2)} N and more` : count;
}

// ----------------------------------------------------------------------------------------------------------------- values

/** Names and values of a grain. */
function valuesOf(grain) {
  const { frame, picture } = state;
  const rows = [["grain", String(grain)]];
  if (meta.group.length) rows.push(["group", meta.groups[meta.group[grain]]]);
  const isDisc = !picture.looks[grain];
  rows.push([isDisc ? "radius" : "reach from the center", `${format(picture.radiiIn(frame)[grain])} m`]);
  rows.push(["x, y", `${formatKnown("x", frame.x[grain], 6)}, ${formatKnown("y", frame.y[grain], 6)} m`]);
  if (!isDisc) rows.push(["angle", `${formatKnown("angle", frame.angle[grain], 4)} rad`]);
  for (const field of meta.fields) {
    const values = frame.values[field.name];
    const digits = field.unit === "K" ? 9 : 4;
    rows.push([field.label, values ? `${formatKnown(field.name, values[grain], digits)} ${field.unit}` : "–"]);
  }
  return rows;
}

function fillList(list, rows) {
  list.replaceChildren(
    ...rows.map(([name, value]) => {
      const term = document.createElement("dt"), text = document.createElement("dd"), pair = document.createElement("div");
      term.textContent = name;
      text.textContent = value;
      pair.append(term, text);
      return pair;
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

let pointed = null; // where in the window values are told of what is there

function showTip({ clientX, clientY }) {
  pointed = { clientX, clientY };
  const tip = $("tip");
  const grain = state.frame ? state.picture.findGrain(state.frame, clientX, clientY) : -1;
  tip.hidden = grain < 0;
  if (grain < 0) return;
  fillList(tip, valuesOf(grain));
  const area = $("stage").getBoundingClientRect();
  const x = clientX - area.left, y = clientY - area.top;
  const left = x < area.width / 2 ? x + 14 : x - tip.offsetWidth - 14;
  tip.style.left = `${Math.max(0, Math.min(left, area.width - tip.offsetWidth))}px`;
  tip.style.top = `${Math.max(0, Math.min(y + 12, area.height - tip.offsetHeight))}px`;
}

function hideTip() {
  pointed = null;
  $("tip").hidden = true;
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
    loadFrame((next + 1) % meta.frames.length).catch(() => {}); // ahead of its turn; what fails is told when it is shown
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
  // Where everything is in view a finger scrolls the page; enlarged it moves the picture.
  $("canvas").style.touchAction = state.picture.zoom > state.picture.home ? "none" : "pan-y";
  if (pointed) showTip(pointed);
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
  const held = pointers.size === 2 ? spread() : null;
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  moved += Math.hypot(event.clientX - before.x, event.clientY - before.y);
  if (held) {
    const now = spread();
    hideTip();
    state.picture.pan(now.x - held.x, now.y - held.y);
    zoom(now.distance / Math.max(held.distance, 1), now.x, now.y);
  } else if (moved > 4) {
    hideTip();
    pan(event.clientX - before.x, event.clientY - before.y);
  }
}

function onPointerUp(event) {
  const isTap = pointers.size === 1 && moved <= 4;
  pointers.delete(event.pointerId);
  if (!isTap || !state.frame) return;
  select(state.picture.findGrain(state.frame, event.clientX, event.clientY));
  showTip(event); // a finger does not hover
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
  canvas.addEventListener("pointerleave", (event) => {
    if (event.pointerType !== "touch") hideTip();
  });
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (state.picture.zoom <= state.picture.home && event.deltaY > 0) return; // nothing to zoom out of: the page scrolls
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

/** Show all of the frame shown; once more: of all frames. */
function fit() {
  const { picture, frame } = state, isFitted = !picture.isMoved && picture.zoom > 1;
  picture.fit(isFitted ? meta.box : frame.about.box);
  afterMove();
}

// ------------------------------------------------------------------------------------------------------------------ start

function toggleTheme() {
  const root = document.documentElement;
  const isDark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = isDark ? "light" : "dark";
  redraw();
}

/** Paper is white. */
function listenToPrinting() {
  const root = document.documentElement;
  let before;
  window.addEventListener("beforeprint", () => {
    before = root.dataset.theme;
    root.dataset.theme = "light";
    draw();
  });
  window.addEventListener("afterprint", () => {
    if (before) root.dataset.theme = before;
    else delete root.dataset.theme;
    draw();
  });
}

/** Whether a quantity differs among nearly all grains of the frame shown. */
function differs({ name, range }) {
  const values = (state.frame.values[name] || new Float64Array(1)).toSorted(), last = values.length - 1;
  return values[Math.round(0.99 * last)] - values[Math.round(0.01 * last)] > 0.02 * (range[1] - range[0]);
}

/** The first quantity that differs among nearly all grains of the frame shown, or else in the course of the run. */
function chooseField() {
  const changes = ({ name }) => meta.codes[name].high > meta.codes[name].low;
  return meta.fields.find(differs) || meta.fields.find(changes) || meta.fields[0];
}

function tellTrouble(error) {
  $("trouble").textContent = error.message;
  $("trouble").hidden = false;
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
  $("contacts").addEventListener("change", redraw);
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
  listenToPrinting();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

async function start() {
  $("theme").addEventListener("click", toggleTheme);
  try {
    state.picture = new Picture($("canvas"), await loadRadii(), await loadLooks());
    $("scrub").max = meta.frames.length - 1;
    $("grain").max = meta.grains - 1;
    for (const id of ["play", "back", "next", "scrub"]) $(id).disabled = meta.frames.length === 1;
    await showFrame(meta.frames.length - 1);
    state.field = chooseField();
    state.picture.fit(state.frame.about.box);
    $("field").replaceChildren(...meta.fields.map((field, k) => new Option(field.label, k, false, field === state.field)));
    listen();
    afterMove();
  } catch (error) {
    tellTrouble(error);
  }
}

window.addEventListener("unhandledrejection", (event) => tellTrouble(event.reason));
start();
