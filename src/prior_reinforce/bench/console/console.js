// The page over a workspace. It holds nothing: `S` is what the console last said, `L` what this tab
// is about to do (a mark that was not told yet, a zoom). After every verb and every event it asks for
// the state anew and draws all of it. Lengths are metres, as everywhere; the map is in millimetres.
"use strict";

let S = null;
const L = { mark: null, zoom: 1, amending: 0, byHand: 0, voiding: 0, words: {}, open: {}, connected: false, busy: false, episode: "" };
let motion = null;
let playing = { at: 0, on: false };

// --- talking to the console -------------------------------------------------------------------

const secret = () => {
  const given = location.hash.slice(1);
  if (given) {
    localStorage.setItem("secret", given);
    history.replaceState(null, "", location.pathname);
  }
  return localStorage.getItem("secret") || "";
};
const SECRET = secret();

const request = (path, options = {}) =>
  fetch(path, { ...options, headers: { ...options.headers, authorization: `Bearer ${SECRET}` }, credentials: "omit" });

const problemOf = async (answer) => {
  try { return (await answer.json()).error; } catch { return `the console answers ${answer.status}`; }
};

// What can be asked again at any time; null where nothing came.
async function get(path) {
  try {
    const answer = await request(path);
    if (answer.ok) return answer;
    complain(await problemOf(answer));
  } catch { lost(); }
  return null;
}

// A verb is sent once: what came of it where no answer arrived, the next state says.
async function verb(name, body = {}) {
  if (L.busy && name !== "stop") return false;
  L.busy = name !== "stop";
  draw();
  try {
    const answer = await request(`/api/${name}`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(name === "stop" ? {} : { seen: S.id, ...body }),
    });
    L.busy = false;
    if (!answer.ok) {
      complain(await problemOf(answer));
      await refresh();
      return false;
    }
    complain("");
    take(await answer.json());
    return true;
  } catch {
    L.busy = false;
    complain("no answer came: look at what the page says now, before anything is done again");
    lost();
    return false;
  }
}

// What moves the arm waits for so long, in ms, after something has changed: a second tap was meant for
// the button that stood in its place.
const CALM = 1000;
let calmAt = 0;

async function refresh() {
  const answer = await get("/api/state");
  if (answer) take(await answer.json());
}

function take(state) {
  if (S && state.id < S.id && state.name === S.name) return;
  const before = S;
  S = state;
  if (!before || before.id !== S.id) {
    calmAt = performance.now() + CALM;
    setTimeout(draw, CALM + 20);
    L.voiding = 0;
    if (before && (before.open !== S.open || before.goals.length !== S.goals.length)) { L.mark = null; L.byHand = 0; L.words = {}; }
    const told = L.amending && S.trials[L.amending - 1];
    if (told && told.stage !== "told") L.amending = 0;
  }
  const trial = openTrial();
  if (!trial) motion = null;
  else if (!motion || motion.plan !== trial.plan) fetchMotion(trial.number);
  draw();
}

async function fetchMotion(number) {
  const answer = await get(`/api/plans/${number}`);
  if (!answer) return;
  motion = await answer.json();
  playing = { at: 0, on: false };
  draw();
}

let beat = 0;
function lost() {
  if (!L.connected) return;
  L.connected = false;
  draw();
}

// Server-sent events, by fetch: EventSource can carry no header.
async function listen() {
  for (;;) {
    const stop = new AbortController();
    const watch = setInterval(() => { if (Date.now() - beat > 12000) stop.abort(); }, 1000);
    try {
      beat = Date.now();
      const answer = await request("/api/events", { signal: stop.signal });
      if (!answer.ok) { complain(await problemOf(answer)); throw new Error("refused"); }
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      L.connected = true;
      if (S) S.id = -1; // whatever it says now counts, even where a journal was restored from a copy
      await refresh();
      fetchRecordings();
      fetchCamera();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        beat = Date.now();
        if (!L.connected) { L.connected = true; refresh(); } // one request was lost, not the console
        const parts = (rest + value).split("\n\n");
        rest = parts.pop();
        for (const part of parts) heard(JSON.parse(part.replace(/^data: /, "")));
      }
    } catch { /* say so, and try again */ }
    clearInterval(watch);
    lost();
    await new Promise((go) => setTimeout(go, 700));
  }
}

function heard(message) {
  if (!S) return;
  if ("error" in message) complain(message.error);
  if ("output" in message) { S.output = message.output; draw(); }
  if ("learning" in message) { S.learning = message.learning; if (message.learning) draw(); else refresh(); }
  if ("recordings" in message && !L.uploading) { clearTimeout(L.later); L.later = setTimeout(fetchRecordings, 300); }
  if ("camera" in message) fetchCamera();
  if ("id" in message && message.id !== S.id) refresh();
}

// --- words ------------------------------------------------------------------------------------

const $ = (id) => document.getElementById(id);
const WORDS = [["long", "short"], ["left", "right"], ["high", "low"]];
const PLACES = [["ahead", "behind"], ["left", "right"], ["up", "down"]];
const cm = (length) => `${Math.round(Math.abs(length) * 1000) / 10} cm`;
const terms = (values, words) => values.map((v, i) => `${cm(v)} ${words[i][Math.round(v * 1000) >= 0 ? 0 : 1]}`);
const units = (values) => values.map((v, i) => `${S.outcome_names[i]} ${+v.toPrecision(4)} ${S.outcome_units[i]}`).join(", ");
const sayPlace = (place) => (S.in_words ? terms(place, PLACES).join(", ") : units(place));
const sayError = (error) => {
  if (!S.in_words) return units(error);
  return terms(error, WORDS).filter((term) => !term.startsWith("0 ")).join(", ") || "on the goal";
};
const minus = (a, b) => a.map((v, i) => v - b[i]);
const openTrial = () => (S && S.open ? S.trials[S.open - 1] : null);
const goalNow = () => (S && S.goals.length ? S.goals[S.goals.length - 1] : null);
const goalOf = (trial) => S.goals[trial.goal - 1];
const mapped = () => S && S.in_words && S.outcome_names.length >= 2;

// What a touch of the table means now.
function touching() {
  if (!S || !L.connected) return "";
  if (L.amending) return "amend";
  if (L.episode) return "episode";
  const trial = openTrial();
  if (S.step === "goal" || S.step === "reached") return "goal";
  if (S.step === "tell") return "tell";
  if (S.step === "execute" && trial && (!S.executor || L.byHand === trial.number)) return "tell";
  return "";
}
const touchedGoal = () => {
  if (touching() === "amend") return goalOf(S.trials[L.amending - 1]);
  return touching() === "tell" ? goalNow() : null;
};

let complaint = "";
function complain(text) {
  complaint = text;
  $("alert").textContent = text;
  $("alert").hidden = !text;
}
let announced = "";
function announce(text) {
  if (text !== announced) { announced = text; $("live").textContent = text; }
}

// --- drawing ----------------------------------------------------------------------------------

function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "class") element.className = value;
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false && child !== ""));
  return element;
}
function g(tag, props = {}, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(props)) {
    if (key === "size") element.style.fontSize = `${value}px`;
    else element.setAttribute(key, value);
  }
  if (text !== "") element.textContent = text;
  return element;
}
const button = (id, text, onclick, kind = "", props = {}) => h("button", { id, type: "button", class: kind, onclick, ...props }, text);
function details(key, title, ...children) {
  const element = h("details", { open: L.open[key] }, h("summary", { id: `sum-${key}` }, title), ...children);
  element.addEventListener("toggle", () => { L.open[key] = element.open; });
  return element;
}
// Replace what a place holds, and leave the focus where it was.
function fill(id, ...children) {
  const place = $(id);
  const focused = place.contains(document.activeElement) ? document.activeElement : null;
  const at = focused && focused.selectionStart !== undefined && focused.type === "text" ? focused.selectionStart : null;
  place.replaceChildren(...children.flat(Infinity).filter(Boolean));
  place.hidden = !place.childNodes.length;
  if (focused && focused.id && $(focused.id)) {
    $(focused.id).focus({ preventScroll: true });
    if (at !== null) $(focused.id).setSelectionRange(at, at);
  } else if (focused && id === "act") $("now").scrollIntoView({ block: "nearest" });
}

const TITLES = {
  import: "Bring in recordings", learn: "Learn the motion", goal: "Touch a goal", ask: "Get the next plan",
  executing: "The arm is moving", settle: "Did the arm move?", tell: "Touch where it landed",
};
function title() {
  if (!L.connected) return "Connection lost";
  if (L.amending) return `Correct trial ${L.amending}`;
  if (L.episode) return `Where did ${L.episode} land?`;
  if (S.learning) return "Learning";
  const trial = openTrial();
  if (S.step === "execute") return touching() === "tell" ? `Trial ${trial.number}: throw, then touch` : `Trial ${trial.number} is ready`;
  if (S.step === "reached") return `Reached in ${goalNow().told === 1 ? "1 trial" : `${goalNow().told} trials`}`;
  return TITLES[S.step];
}

function draw() {
  if (!S) return;
  document.title = `${title()} · ${S.name}`;
  $("now").textContent = title();
  const goal = goalNow();
  $("task").textContent = goal ? `${S.name} · goal ${goal.number}: ${goal.said}` : S.name;
  $("stop").classList.toggle("armed", S.step === "executing");
  $("table").hidden = !mapped();
  const pictured = L.view === "picture" && C;
  $("map").toggleAttribute("hidden", Boolean(pictured));
  $("picture").toggleAttribute("hidden", !pictured || Boolean(stream));
  $("video").hidden = !pictured || !stream;
  announce(`${title()}. ${said()}`);
  drawMap();
  drawAct();
  drawPlan();
  drawHistory();
  drawPicture();
  drawRecordings();
  drawCamera();
}

const said = () => {
  if (!L.mark) return "";
  const goal = touchedGoal();
  return goal ? sayError(minus(L.mark, goal.goal)) : sayPlace(L.mark);
};

// --- the map ----------------------------------------------------------------------------------

let view = { x: 0, y: 0, w: 1, h: 1 };
let fitted = "";

function fitMap() {
  const box = $("map").getBoundingClientRect();
  if (!box.width || !box.height) return;
  const goal = touchedGoal() || goalNow();
  const points = shownDemonstrations().map((d) => d.outcome);
  for (const each of S.goals) points.push(each.goal);
  for (const trial of S.trials) if (trial.outcome && (trial.goal === S.goals.length || trial.number === L.amending)) points.push(trial.outcome);
  if (L.zoom === 0 || points.length < 2) points.push([0, 0], [0.6, 0.4], [0.6, -0.4], [1.2, 0]);
  let [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
  for (const [x, y] of points) {
    if (Math.hypot(x, y) > 20) continue;
    low = [Math.min(low[0], x), Math.min(low[1], y)];
    high = [Math.max(high[0], x), Math.max(high[1], y)];
  }
  const margin = 0.12 + 0.1 * Math.max(high[0] - low[0], high[1] - low[1]);
  let middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  let size = [high[0] - low[0] + 2 * margin, high[1] - low[1] + 2 * margin];
  if (L.zoom > 1) {
    const centre = goal ? goal.goal : middle;
    middle = [0, 1].map((i) => centre[i] + (middle[i] - centre[i]) / L.zoom ** 2);
    size = size.map((s) => s / L.zoom);
  }
  let [width, height] = [1000 * size[1], 1000 * size[0]];
  const top = -1000 * middle[0] - height / 2;
  if (width / height < box.width / box.height) width = (height * box.width) / box.height;
  else height = (width * box.height) / box.width;
  // Where there is room to spare, it shows more of the way to the arm.
  view = { x: -1000 * middle[1] - width / 2, y: top, w: width, h: height };
  $("map").setAttribute("viewBox", `${view.x} ${view.y} ${view.w} ${view.h}`);
}

const uv = ([x, y]) => [-1000 * y, -1000 * x];

function drawMap() {
  if (!mapped()) return;
  const map = $("map");
  const what = [S.id, L.zoom, L.amending, map.clientWidth, map.clientHeight, touching()].join();
  if (what !== fitted) { fitMap(); fitted = what; }
  const px = view.w / Math.max(map.clientWidth, 1);
  const parts = [];
  const step = [10, 20, 50, 100, 200, 500].find((s) => s / px > 58) || 1000;
  for (let u = Math.ceil(view.x / step) * step; u < view.x + view.w; u += step) {
    parts.push(g("line", { class: u ? "grid" : "grid axis", x1: u, x2: u, y1: view.y, y2: view.y + view.h }));
    parts.push(g("text", { class: "ruler", x: u + 3 * px, y: view.y + view.h - 5 * px, size: 12 * px }, u ? `${Math.abs(u) / 10} ${u < 0 ? "left" : "right"}` : "0"));
  }
  for (let v = Math.ceil(view.y / step) * step; v < view.y + view.h; v += step) {
    parts.push(g("line", { class: v ? "grid" : "grid axis", x1: view.x, x2: view.x + view.w, y1: v, y2: v }));
    parts.push(g("text", { class: "ruler", x: view.x + 4 * px, y: v - 4 * px, size: 12 * px }, `${-v / 10} cm`));
  }
  for (const { outcome, name } of shownDemonstrations()) {
    const [u, v] = uv(outcome);
    parts.push(g("rect", { class: "demo", x: u - 6 * px, y: v - 6 * px, width: 12 * px, height: 12 * px }));
    if (name) parts.push(g("text", { class: "ruler", x: u + 10 * px, y: v + 4 * px, size: 12 * px }, name));
  }
  for (const goal of S.goals) {
    const now = goal.number === S.goals.length;
    if (!now && S.goals.length - goal.number > 30) continue;
    const [u, v] = uv(goal.goal);
    if (now) parts.push(g("ellipse", { class: "goal ring", cx: u, cy: v, rx: 1000 * goal.tolerance[1], ry: 1000 * goal.tolerance[0] }));
    const r = (now ? 14 : 7) * px;
    parts.push(g("path", { class: now ? "goal" : "goal old", d: `M${u - r} ${v}H${u + r}M${u} ${v - r}V${v + r}` }));
  }
  const current = S.trials.filter((trial) => trial.outcome && trial.goal === S.goals.length).length;
  for (const trial of S.trials) {
    if (!trial.outcome) continue;
    const [u, v] = uv(trial.outcome);
    const old = trial.goal !== S.goals.length;
    parts.push(g("circle", { class: `trial${old ? " old" : ""}${trial.hit ? " landed" : ""}`, cx: u, cy: v, r: (old ? 4 : 11) * px }));
    if (!old) parts.push(g("text", { class: "on", x: u, y: v + 5 * px, size: 13 * px }, `${trial.number}`));
  }
  const waiting = openTrial();
  if (waiting && waiting.stage !== "executed") {
    const [u, v] = uv(waiting.condition);
    parts.push(g("circle", { class: "aim", cx: u, cy: v, r: 18 * px }));
  }
  if (motion && motion.links.length && waiting) {
    const links = motion.links[frameAt()].map(uv);
    parts.push(g("polyline", { class: "path", points: motion.links.map((frame) => uv(frame[frame.length - 1])).join(" ") }));
    parts.push(g("polyline", { class: "arm", points: links.join(" ") }));
    for (const [u, v] of links) parts.push(g("circle", { class: "joint", cx: u, cy: v, r: 4 * px }));
  }
  if (L.mark) {
    const [u, v] = uv(L.mark);
    const goal = touchedGoal();
    if (goal) { const [a, b] = uv(goal.goal); parts.push(g("line", { class: "mark", x1: a, y1: b, x2: u, y2: v })); }
    parts.push(g("circle", { class: "mark", cx: u, cy: v, r: 22 * px }));
    parts.push(g("path", { class: "mark", d: `M${u - 34 * px} ${v}h${22 * px}M${u + 12 * px} ${v}h${22 * px}M${u} ${v - 34 * px}v${22 * px}M${u} ${v + 12 * px}v${22 * px}` }));
    parts.push(g("circle", { class: "mark dot", cx: u, cy: v, r: 3 * px }));
  }
  map.replaceChildren(...parts);
  map.classList.toggle("touch", Boolean(touching()));
  const what2 = { goal: "the goal", tell: "where it landed", amend: "where it landed", episode: "where it landed" }[touching()];
  map.setAttribute("aria-label", `Table from above, ${S.demonstrations.length} demonstrations, ${current} trials of this goal told. ` +
    (what2 ? `Arrow keys move the mark of ${what2} by a centimetre, with Shift by a millimetre; Enter places it. ${said()}` : ""));
  const legend = ["☐ demonstrations"];
  if (S.goals.length) legend.push("✛ goal, its tolerance around it");
  if (current) legend.push("● trials by number, green where they hit");
  if (waiting && waiting.stage !== "executed") legend.push("dashed: where the next plan aims");
  $("legend").textContent = legend.join(" · ");
  fill("mapbar",
    C && (C.picture || stream || C.to_table) && button("view", L.view === "picture" ? "Map" : "Picture", () => { L.view = L.view === "picture" ? "map" : "picture"; draw(); }),
    button("nearer", "+", () => { L.zoom = Math.min(8, L.zoom ? L.zoom * 2 : 1); draw(); }, "", { "aria-label": "Nearer", disabled: L.zoom >= 8 }),
    button("farther", "−", () => { L.zoom = L.zoom > 1 ? L.zoom / 2 : 0; draw(); }, "", { "aria-label": "Farther", disabled: L.zoom === 0 }));
}

const rest = () => { // further components of an outcome, such as its height
  const from = L.mark || (touchedGoal() || goalNow() || S.demonstrations.map((d) => ({ goal: d.outcome }))[0] || { goal: [] }).goal;
  return S.outcome_names.slice(2).map((_, i) => from[i + 2] || 0);
};
function setMark(place, measured = 0) {
  L.measured = measured;
  L.mark = [...place.slice(0, 2).map((v) => Math.round(v * 2000) / 2000), ...(place.length > 2 ? place.slice(2) : rest())];
  draw();
}
// A mark that is set by touching, dragged by the finger or moved by the keyboard, in an SVG's units.
function surface(svg, { active, get, set, step }) {
  const at = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  let hold = null;
  svg.addEventListener("pointerdown", (event) => {
    if (!active() || !event.isPrimary) return;
    event.preventDefault();
    svg.focus({ preventScroll: true });
    svg.setPointerCapture(event.pointerId);
    const [point, mark] = [at(event), get()];
    // Near the mark it is dragged as it was taken hold of, so that the finger need not hide it.
    const near = mark && Math.hypot(point.x - mark[0], point.y - mark[1]) * svg.getScreenCTM().a < 40;
    hold = { from: point, mark: near ? mark : [point.x, point.y], moved: !near, x: event.clientX, y: event.clientY };
    if (!near) set(point.x, point.y);
  });
  svg.addEventListener("pointermove", (event) => {
    if (!hold || (!hold.moved && Math.hypot(event.clientX - hold.x, event.clientY - hold.y) < 4)) return;
    hold.moved = true;
    const point = at(event);
    set(hold.mark[0] + point.x - hold.from.x, hold.mark[1] + point.y - hold.from.y);
  });
  svg.addEventListener("pointerup", (event) => {
    const point = at(event);
    if (hold && !hold.moved) set(point.x, point.y);
    hold = null;
  });
  svg.addEventListener("pointercancel", () => { hold = null; });
  svg.addEventListener("keydown", (event) => {
    const way = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] }[event.key];
    if (!active() || (!way && event.key !== "Enter")) return;
    event.preventDefault();
    const mark = get();
    const size = step() * (event.shiftKey ? 0.1 : 1);
    if (!mark) set(...(svg.id === "map" ? uv((touchedGoal() || goalNow() || { goal: [0.8, 0] }).goal) : [C.width / 2, C.height / 2]));
    else if (way) set(mark[0] + size * way[0], mark[1] + size * way[1]);
    else if (document.querySelector("#act .big")) document.querySelector("#act .big").focus();
  });
  new ResizeObserver(() => { if (S) { fitted = ""; drawMap(); drawPicture(); } }).observe(svg);
}

// --- the action -------------------------------------------------------------------------------

const sdOf = () => (L.measured ? { sd: L.measured } : {});
const telling = () => (L.amending ? "amend" : "tell");
const tellingOf = () => L.amending || S.open;

async function tell(body) {
  const trial = tellingOf();
  const name = telling();
  if (!(await verb(name, { trial, ...body }))) return;
  L.amending = 0; L.mark = null; L.words = {}; L.measured = 0; L.byHand = 0;
  draw();
  goOn();
}
// What the operator would press next anyway: the next plan, which moves nothing.
async function goOn() {
  if (S.step === "ask") await verb("ask");
}
async function voidTrial(number, reason) {
  L.voiding = 0;
  if (await verb("void", { trial: number, reason })) goOn();
}
async function setGoal(body) {
  const done = await verb("goal", body);
  if (done) { L.mark = null; L.changed = undefined; goOn(); }
  return done;
}
async function changed(trial) {
  const goal = goalNow().goal;
  if (await verb("void", { trial, reason: "something changed on the hardware before it" })) setGoal({ goal, new_hardware: "changed, as a surprise showed" });
}
async function download(trial) {
  const answer = await get(`/api/plans/${trial.number}/file`);
  if (!answer) return;
  const link = h("a", { href: URL.createObjectURL(await answer.blob()), download: `${S.name}-trial-${trial.number}.npz` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function chance(trial) {
  if (trial.p_hit === null) return null;
  const togo = trial.expected_trials === null ? "" : `${trial.expected_trials.toFixed(1)} trials to go`;
  return h("p", { class: "chance", id: "chance" }, `${Math.round(100 * trial.p_hit)} % chance to hit `, h("small", {}, togo));
}
function surprise(trial) {
  if (!trial.surprise) return null;
  const about = trial.surprising;
  return h("div", { class: "ask", id: "surprise" }, `${about ? `Trial ${about} is ` : ""}${trial.surprise}. Mistyped? Or did the table, the ball or the arm change?`,
    h("div", { class: "row" },
      about && button("mistyped", `Mistyped: correct trial ${about}`, () => { L.amending = about; L.mark = null; draw(); }),
      button("changed", "Something changed", () => changed(trial.number))));
}
function fields() {
  const factor = S.in_words ? 100 : 1;
  const unit = (i) => (S.in_words ? "cm" : S.outcome_units[i]);
  const words = (i) => (S.in_words ? ["ahead of the base", "left of the base", "up"][i] : S.outcome_names[i]);
  const inputs = S.outcome_names.map((_, i) => h("input", {
    id: `field-${i}`, type: "text", inputmode: "decimal", autocomplete: "off",
    value: L.mark ? `${Math.round(L.mark[i] * factor * 100) / 100}` : "",
    onchange: () => {
      const values = inputs.map((input) => parseFloat(input.value.replace(",", ".")) / factor);
      if (values.every(Number.isFinite)) { L.mark = values; draw(); }
    },
  }));
  return h("div", { class: "fields" }, inputs.map((input, i) => h("label", {}, `${words(i)} [${unit(i)}]`, input)));
}
const SIZES = [-20, -10, -5, -2, 0, 2, 5, 10, 20];
function byEye() {
  const rows = S.outcome_names.map((name, i) => h("fieldset", {}, h("legend", {}, { 0: "Short or long", 1: "Left or right", 2: "Low or high" }[i] + " of the goal, in cm"),
    h("div", { class: "scale" }, (i === 1 ? [...SIZES].reverse() : SIZES).map((size) => h("label", {}, `${Math.abs(size)}`,
      h("input", { type: "radio", name: `eye-${i}`, id: `eye-${i}-${size}`, "aria-label": size ? `${Math.abs(size)} cm ${WORDS[i][size > 0 ? 0 : 1]}` : "neither",
        checked: L.words[i] === size, onchange: () => { L.words[i] = size; draw(); } })))),
    h("div", { class: "ends" }, h("span", {}, WORDS[i][i === 1 ? 0 : 1]), h("span", {}, WORDS[i][i === 1 ? 1 : 0]))));
  const said = S.outcome_names.map((_, i) => L.words[i]);
  const words = said.map((size, i) => size && `${Math.abs(size)}cm ${WORDS[i][size > 0 ? 0 : 1]}`).filter(Boolean).join(", ");
  const complete = said.every((size) => size !== undefined) && words;
  return details("eye", "By eye, in words", rows, h("div", { class: "row" },
    button("say", complete ? `Say: ${words}` : "Choose one in each row", () => tell({ words }), "", { disabled: !complete }),
    button("missed", "Missed, not seen by how much", () => tell({ hit: false }))));
}
function voider(number, word) {
  if (L.voiding !== number) return button("slipped", word, () => { L.voiding = number; draw(); }, "bad");
  return null;
}
function confirmVoid(number) {
  if (L.voiding !== number) return null;
  return h("div", { class: "ask", role: "group", "aria-label": `Void trial ${number}` }, `Trial ${number} counts for nothing then, for good.`,
    h("div", { class: "row" },
      ["it slipped", "the arm stopped", "nobody saw it"].map((why, i) => button(`void-${i}`, `Void: ${why}`, () => voidTrial(number, why), "bad")),
      button("keep", "Keep it", () => { L.voiding = 0; draw(); })));
}
function tellPanel() {
  const number = tellingOf();
  const trial = S.trials[number - 1];
  const told = L.mark && sayError(minus(L.mark, goalOf(trial).goal));
  return [
    trial.warning && h("p", { class: "ask" }, `Executed, ${trial.warning}. If that spoiled it, it slipped.`),
    button("tell", told ? `${L.amending ? `Trial ${number} was` : "It landed"} ${told}` : "Touch the table where it landed", () => tell({ outcome: L.mark, ...sdOf() }), "big", { disabled: !L.mark || L.busy }),
    h("div", { class: "row" }, button("hit", "Hit", () => tell({ hit: true }), "hit", { disabled: L.busy }), voider(number, L.amending ? "Void it" : "Slipped"),
      L.amending ? button("cancel", "Leave it as it is", () => { L.amending = 0; L.mark = null; draw(); }) : null),
    confirmVoid(number),
    S.in_words && byEye(),
    details("fields", "Type the place", fields()),
  ];
}

function drawAct() {
  const trial = openTrial();
  const off = { disabled: !L.connected || L.busy };
  const still = { disabled: off.disabled || performance.now() < calmAt };
  const parts = [];
  if (!L.connected) parts.push(h("p", {}, "What is below may be old. This page goes on by itself once the console answers; nothing is lost."));
  else if (L.episode) parts.push(...episodePanel());
  else if (touching() === "tell" || touching() === "amend") {
    if (trial && S.step === "execute" && !L.amending) parts.push(chance(trial), surprise(trial), old(trial), button("download", `Download the plan of trial ${trial.number}`, () => download(trial)));
    parts.push(...tellPanel());
  } else if (S.learning) {
    parts.push(h("progress", { value: S.learning.done, max: 1, "aria-label": "learned so far" }), h("p", {}, `${Math.round(100 * S.learning.done)} %, ${Math.round(S.learning.seconds_left)} s left`));
  } else if (S.step === "import") parts.push(...importPanel());
  else if (S.step === "learn") parts.push(button("learn", `Learn from ${S.demonstrations.length} demonstrations`, () => verb("learn"), "big", off));
  else if (touching() === "goal") parts.push(...goalPanel(off));
  else if (S.step === "ask") parts.push(button("ask", "Get the next plan", () => verb("ask"), "big", off));
  else if (S.step === "execute") {
    parts.push(chance(trial), surprise(trial), old(trial), trial.warning && h("p", { class: "ask" }, `Last time ${trial.warning}.`),
      button("execute", `Execute trial ${trial.number}`, () => verb("execute", { trial: trial.number, plan: trial.plan }), "big", still),
      h("p", { class: "soft" }, "The arm moves at once: keep clear, and the stop button in your hand."),
      details("other", "Another way", h("div", { class: "row" },
        S.approaches && button("approach", "Go to its start, slowly", () => verb("execute", { trial: trial.number, plan: trial.plan, motion: "approach" }), "", still),
        S.approaches && button("rehearse", "Rehearse at 20 % of its speed", () => verb("execute", { trial: trial.number, plan: trial.plan, motion: "rehearsal", speed: 0.2 }), "", still),
        button("download", "Download the plan", () => download(trial)),
        button("by-hand", "It was executed otherwise", () => { L.byHand = trial.number; draw(); }), voider(trial.number, "Void it")), confirmVoid(trial.number)));
  } else if (S.step === "executing") {
    parts.push(h("pre", { class: "output", tabindex: "0", "aria-label": "what the executor says" }, S.output || "started"),
      button("stop-2", "Stop the arm", () => verb("stop"), "big stop"));
  } else if (S.step === "settle") {
    parts.push(h("p", {}, trial.warning ? `Trial ${trial.number} was executed, ${trial.warning}.` : `Nobody wrote down how trial ${trial.number} ended. Look at the arm.`),
      h("div", { class: "row" },
        button("moved", "It moved, and the object flew", () => { L.amending = 0; S.step = "tell"; draw(); }),
        button("spoiled", "It moved: void the trial", () => voidTrial(trial.number, "the execution was cut off"), "bad"),
        button("still", "Nothing moved", () => verb("ask", { arm_did_not_move: true }))));
  }
  $("act").classList.toggle("tall", S.step === "import" && !L.episode);
  fill("act", h("h2", { class: "unseen" }, "What to do"), ...parts);
}
const old = (trial) => trial.outdated && h("p", { class: "ask" }, "Planned before a correction: unless it was thrown, void it, and a newer plan comes.");

function goalPanel(off) {
  const goal = goalNow();
  return [
    S.step === "reached" && h("p", { class: "chance hit" }, `Goal ${goal.number} is reached: N = ${S.demonstrations.length} + ${goal.told}.`),
    button("goal", L.mark ? `Aim at ${sayPlace(L.mark)}` : S.step === "reached" ? "Touch the next goal" : "Touch the table where it shall land",
      () => setGoal({ goal: L.mark, new_hardware: L.changed || null }), "big", { disabled: !L.mark || off.disabled }),
    S.step === "reached" && h("div", { class: "row" }, button("again", "Throw at it once more", () => verb("ask"), "", off)),
    details("fields", "Type the place", fields()),
    S.goals.length > 0 && details("changed", "Something changed since the last trial", h("label", {}, "What: another ball, a new gripper",
      h("input", { id: "what-changed", type: "text", value: L.changed || "", oninput: (event) => { L.changed = event.target.value; } }))),
  ];
}

// --- the plan ---------------------------------------------------------------------------------

const frameAt = () => Math.min(motion.times.length - 1, Math.round(playing.at * (motion.times.length - 1)));
function play() {
  playing.on = !playing.on;
  if (!playing.on) { drawPlan(); return; }
  if (playing.at >= 1) playing.at = 0;
  const length = 1000 * motion.times[motion.times.length - 1];
  let then = performance.now();
  const tick = (now) => {
    if (!playing.on || !motion) return;
    playing.at = Math.min(1, playing.at + (now - then) / length);
    then = now;
    if (playing.at >= 1) playing.on = false;
    drawMap(); drawPlan();
    if (playing.on) requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
  drawPlan();
}
function side() {
  const all = motion.links.flat();
  const [low, high] = [[0, 2].map((i) => Math.min(...all.map((p) => p[i]))), [0, 2].map((i) => Math.max(...all.map((p) => p[i])))];
  const w = Math.max(high[0] - low[0], 0.2) + 0.2;
  const tall = Math.max(high[1] - low[1], 0.2) + 0.2;
  const svg = g("svg", { class: "side", viewBox: `${1000 * (low[0] - 0.1)} ${-1000 * (high[1] + 0.1)} ${1000 * w} ${1000 * tall}`, role: "img", "aria-label": "The arm from its right side, moving as planned" });
  const at = (p) => [1000 * p[0], -1000 * p[2]];
  svg.append(g("line", { class: "grid axis", x1: -9000, x2: 9000, y1: 0, y2: 0 }),
    g("polyline", { class: "path", points: motion.links.map((frame) => at(frame[frame.length - 1])).join(" ") }),
    g("polyline", { class: "arm", points: motion.links[frameAt()].map(at).join(" ") }));
  for (const p of motion.links[frameAt()]) svg.append(g("circle", { class: "joint", cx: at(p)[0], cy: at(p)[1], r: 14 }));
  return svg;
}
function joint(column) {
  const [low, high] = [Math.min(...column.values), Math.max(...column.values)];
  const ends = column.low === null ? [low - 0.1 * (high - low) - 1e-6, high + 0.1 * (high - low) + 1e-6] : [column.low, column.high];
  const x = (value) => (100 * (value - ends[0])) / (ends[1] - ends[0]);
  const svg = g("svg", { viewBox: "0 0 100 10", preserveAspectRatio: "none", role: "img",
    "aria-label": `${column.name} from ${low.toFixed(2)} to ${high.toFixed(2)} ${column.unit}` + (column.low === null ? "" : `, limits ${column.low.toFixed(2)} to ${column.high.toFixed(2)}`) });
  svg.append(g("rect", { class: "limit", x: 0, y: 4, width: 100, height: 2 }), g("rect", { class: "range", x: x(low), y: 2, width: Math.max(0.6, x(high) - x(low)), height: 6 }),
    g("rect", { class: "pose", x: x(column.values[frameAt()]) - 0.5, y: 0, width: 1, height: 10 }));
  const value = column.values[frameAt()];
  return [h("span", {}, column.name), svg, h("span", {}, `${value.toFixed(2)} ${column.unit}`)];
}
const MARKS = { pass: "✓ ok", warn: "! warns", refuse: "✗ refuses", unchecked: "– not checked" };
function drawPlan() {
  const trial = openTrial();
  if (!motion || !trial) { fill("plan"); return; }
  fill("plan", h("h2", { id: "plan-title" }, `Plan of trial ${motion.trial}`),
    h("p", {}, `Aims at ${sayPlace(trial.condition)}; ${motion.verdict}.`),
    motion.links.length ? side() : null,
    h("div", { class: "play" }, button("play", playing.on ? "Pause" : "Play", play),
      h("input", { type: "range", id: "when", min: 0, max: 1000, value: Math.round(1000 * playing.at), "aria-label": "Moment of the motion",
        "aria-valuetext": `${motion.times[frameAt()].toFixed(2)} s`, oninput: (event) => { playing.on = false; playing.at = event.target.value / 1000; drawMap(); drawPlan(); } }),
      h("span", {}, `${motion.times[frameAt()].toFixed(2)} s`)),
    details("joints", "Joints beside their limits", h("div", { class: "joints" }, motion.columns.map(joint))),
    motion.checks.length ? details("gate", "What the gate says", h("ul", { class: "checks" }, motion.checks.map((line) => h("li", {}, h("b", { class: line.status }, MARKS[line.status]), h("span", {}, `${line.check}: ${line.text}`))))) : null,
    h("p", { class: "soft" }, `Plan ${motion.plan.slice(0, 12)}`));
}

// --- the history ------------------------------------------------------------------------------

const SHOWN = 12;
function drawHistory() {
  if (!S.trials.length) { fill("history"); return; }
  const trials = [...S.trials].reverse();
  const row = (trial) => h("li", {}, h("div", { class: "entry" }, h("b", {}, `${trial.number}`),
    h("span", { class: trial.hit ? "hit" : "" }, `${trial.hit ? "✓ hit · " : ""}${trial.said}${trial.p_hit !== null && trial.stage === "told" ? ` · ${Math.round(100 * trial.p_hit)} % was said` : ""}`),
    trial.stage === "told" && button(`amend-${trial.number}`, "Correct", () => { L.amending = trial.number; L.mark = trial.outcome; draw(); $("map").focus(); }, "plain", { "aria-label": `Correct trial ${trial.number}` }),
    trial.stage === "told" && L.voiding !== trial.number && button(`undo-${trial.number}`, "Void", () => { L.voiding = trial.number; draw(); }, "plain", { "aria-label": `Void trial ${trial.number}` })),
    trial.stage === "told" && !L.amending && confirmVoid(trial.number));
  const goals = (list) => list.flatMap((trial, i) => {
    const first = i === 0 || list[i - 1].goal !== trial.goal;
    return [first && h("li", { class: "soft" }, `Goal ${trial.goal}: ${goalOf(trial).said}${goalOf(trial).new_hardware ? ` (changed: ${goalOf(trial).new_hardware})` : ""}`), row(trial)];
  });
  fill("history", h("h2", { id: "history-title" }, "What happened"), h("ul", {}, goals(trials.slice(0, SHOWN))),
    trials.length > SHOWN && (L.open.all ? h("ul", {}, goals(trials.slice(SHOWN))) : button("all", `${trials.length - SHOWN} earlier trials`, () => { L.open.all = true; draw(); }, "plain")),
    S.report && h("p", {}, h("a", { href: S.report, target: "_blank", rel: "noopener" }, "The report: every goal, trial and plan")));
}

// --- recordings -------------------------------------------------------------------------------

let R = null;
async function fetchRecordings() {
  const answer = await get("/api/recordings");
  if (answer) { R = await answer.json(); draw(); }
}
const shownDemonstrations = () => {
  const touched = R && (L.episode || S.step === "import") ? R.episodes.filter((e) => e.outcome) : [];
  return touched.length || L.episode ? touched : S.demonstrations;
};
const unplaced = () => (R ? R.episodes.filter((e) => !e.outcome && !(L.skipped || []).includes(e.name)) : []);
async function upload(files) {
  for (const file of files) {
    if (file.size > 64e6) { complain(`${file.name} is larger than the page takes (64 MB); use: prior-reinforce import`); return; }
    L.uploading = file.name;
    draw();
    const name = file.webkitRelativePath || file.name;
    const answer = await request(`/api/recordings?name=${encodeURIComponent(name)}`, { method: "PUT", body: file }).catch(() => null);
    if (!answer || !answer.ok) { L.uploading = ""; complain(answer ? await problemOf(answer) : `${file.name} did not arrive; drop it again`); draw(); return; }
  }
  L.uploading = "";
  complain("");
  await fetchRecordings();
  nextEpisode();
}
function nextEpisode() {
  const next = unplaced()[0];
  L.episode = next && mapped() ? next.name : "";
  L.mark = null;
  draw();
}
async function placeEpisode(name, outcome) {
  const body = JSON.stringify({ episode: name, outcome, sd: outcome ? L.measured || 0.02 : 0 });
  const answer = await request("/api/outcome", { method: "POST", body, headers: { "content-type": "application/json" } }).catch(() => null);
  if (!answer || !answer.ok) { complain(answer ? await problemOf(answer) : "no answer came; touch it again"); return; }
  R = await answer.json();
  nextEpisode();
}
function importPanel() {
  const zone = h("label", { class: "drop", id: "drop" }, L.uploading ? `Receiving ${L.uploading}` : "Drop recordings here, or choose them",
    h("span", { class: "soft" }, "NPZ, CSV, Excel, LeRobot, HDF5, ROS bags, and outcomes.csv if you have one"),
    h("input", { type: "file", multiple: true, id: "files", onchange: (event) => upload([...event.target.files]) }));
  zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => { event.preventDefault(); upload([...event.dataTransfer.files]); });
  if (!R || !R.files) return [zone];
  const placed = R.episodes.filter((e) => e.outcome).length;
  return [
    R.problem && h("p", { class: "ask" }, R.problem),
    R.questions.length > 0 && h("div", { class: "ask" }, R.questions.map((what) => h("p", {}, what)),
      h("label", {}, h("input", { type: "checkbox", id: "confirmed", checked: L.confirmed, onchange: (event) => { L.confirmed = event.target.checked; draw(); } }), " Yes, so it is")),
    R.episodes.length > 0 && button("import", placed === R.episodes.length ? `Import ${placed} recordings` : `Import the ${placed} of ${R.episodes.length} that have an outcome`,
      takeIn, "big", { disabled: !placed || (R.questions.length > 0 && !L.confirmed) || !L.connected || L.busy }),
    R.episodes.length > 0 && h("ul", {}, R.episodes.map((e) => h("li", { class: "entry" }, h("span", {}, `${e.name}: ${e.outcome ? sayPlace(e.outcome) : "not touched yet"}`),
      mapped() && button(`place-${e.name}`, e.outcome ? "Correct" : "Touch", () => { L.episode = e.name; L.mark = e.outcome; draw(); }, "plain", { "aria-label": `Touch where ${e.name} landed` })))),
    R.text && details("preview", "What the recordings hold", h("pre", { class: "output", tabindex: "0" }, R.text)),
    zone, button("discard", "Forget these files", async () => { L.skipped = []; if (await send("/api/recordings", "DELETE")) fetchRecordings(); }, "plain"),
  ];
}
async function takeIn() {
  if (await verb("import", { confirmed: Boolean(L.confirmed) })) { L.confirmed = false; L.open.recordings = false; L.picture = Date.now(); draw(); }
}
function episodePanel() {
  const name = L.episode;
  return [
    button("place", L.mark ? `It landed ${sayPlace(L.mark)}` : "Touch the table where it landed", () => placeEpisode(name, L.mark), "big", { disabled: !L.mark }),
    h("p", { class: "soft" }, `${unplaced().length} of ${R.episodes.length} recordings have no outcome yet.`),
    h("div", { class: "row" }, button("skip", "Leave it out", () => { L.skipped = [...(L.skipped || []), name]; nextEpisode(); }),
      button("later", "Back to the list", () => { L.episode = ""; L.mark = null; draw(); })),
    details("fields", "Type the place", fields()),
  ];
}
function drawRecordings() {
  if (S.step === "import" || L.episode || !L.connected) { fill("recordings"); return; }
  fill("recordings", h("h2", { id: "recordings-title" }, "Demonstrations"),
    h("p", {}, `${S.demonstrations.length} in use; ${S.model ? `learned by ${S.model}` : "not learned from yet"}.`),
    S.remarks.length > 0 && details("remarks", "What learning found", S.remarks.map((remark) => h("p", {}, remark))),
    S.step !== "learn" && !S.open && button("learn-again", "Learn again", () => verb("learn"), "", { disabled: L.busy || Boolean(S.learning) }),
    details("recordings", "Bring in others", importPanel()));
}

// --- the camera -------------------------------------------------------------------------------

let C = null;
let stream = null;
let pictureUrl = "";
let box = null;
async function fetchCamera() {
  const answer = await get("/api/camera");
  if (answer) seen(await answer.json());
}
async function seen(camera) {
  const before = C;
  C = camera;
  if (C.picture && (!before || before.picture !== C.picture || !pictureUrl)) {
    const answer = await get("/api/picture");
    if (answer) {
      if (pictureUrl) URL.revokeObjectURL(pictureUrl);
      pictureUrl = URL.createObjectURL(await answer.blob());
      box = null;
    }
  }
  draw();
}
async function send(path, method, body, type = "application/json") {
  const answer = await request(path, { method, body, headers: { "content-type": type } }).catch(() => null);
  if (answer && answer.ok) { complain(""); return answer.json(); }
  complain(answer ? await problemOf(answer) : "no answer came; try again");
  return null;
}
const times = (m, [x, y]) => {
  const [a, b, c] = m.map((row) => row[0] * x + row[1] * y + row[2]);
  return [a / c, b / c];
};
function inverse([[a, b, c], [d, e, f], [p, q, r]]) {
  return [[e * r - f * q, c * q - b * r, b * f - c * e], [f * p - d * r, a * r - c * p, c * d - a * f], [d * q - e * p, b * p - a * q, a * e - b * d]];
}
const toPixel = (place) => times(inverse(C.to_table), place);
const pixelOfMark = () => {
  if (L.calibrating) return L.pixels[L.at] || null;
  return L.mark && C.to_table ? toPixel(L.mark) : null;
};
function touchPixel(u, v) {
  if (L.calibrating) { L.pixels[L.at] = [u, v]; draw(); } else { box = box && moved(box, u, v); setMark(times(C.to_table, [u, v]), C.sd); }
}
const moved = ([l, t, r, b], u, v) => [u - (r - l) / 2, v - (b - t) / 2, u + (r - l) / 2, v + (b - t) / 2];
function drawPicture() {
  const svg = $("picture");
  if (!C || !pictureUrl || svg.hasAttribute("hidden")) return;
  const zoom = Math.max(1, L.zoom);
  const middle = pixelOfMark() || (C.to_table && goalNow() ? toPixel(goalNow().goal) : [C.width / 2, C.height / 2]);
  if (!L.window || L.window.zoom !== zoom || L.window.of !== C.picture) {
    const at = [0, 1].map((i) => Math.min(Math.max(middle[i] - [C.width, C.height][i] / zoom / 2, 0), [C.width, C.height][i] * (1 - 1 / zoom)));
    L.window = { zoom, of: C.picture, box: `${at[0]} ${at[1]} ${C.width / zoom} ${C.height / zoom}` };
  }
  svg.setAttribute("viewBox", L.window.box);
  const px = C.width / zoom / Math.max(1, svg.clientWidth);
  const parts = [g("image", { href: pictureUrl, width: C.width, height: C.height })];
  const cross = ([u, v], kind, r) => g("path", { class: kind, d: `M${u - r} ${v}H${u + r}M${u} ${v - r}V${v + r}` });
  if (L.calibrating) {
    L.points.forEach((_, i) => {
      if (!L.pixels[i]) return;
      parts.push(cross(L.pixels[i], i === L.at ? "mark" : "aim", 18 * px), g("text", { x: L.pixels[i][0] + 8 * px, y: L.pixels[i][1] - 8 * px, size: 18 * px }, `${i + 1}`));
    });
  } else if (C.to_table) {
    const goal = touchedGoal() || goalNow();
    if (goal) {
      const ring = [...Array(25).keys()].map((i) => toPixel([goal.goal[0] + goal.tolerance[0] * Math.cos(i * Math.PI / 12), goal.goal[1] + goal.tolerance[1] * Math.sin(i * Math.PI / 12)]));
      parts.push(g("polygon", { class: "goal ring", points: ring.join(" ") }), cross(toPixel(goal.goal), "goal", 10 * px));
    }
    const mark = pixelOfMark();
    if (box) parts.push(g("rect", { class: "box", x: box[0], y: box[1], width: box[2] - box[0], height: box[3] - box[1] }));
    if (mark) parts.push(g("circle", { class: "mark", cx: mark[0], cy: mark[1], r: 22 * px }), cross(mark, "mark", 8 * px));
  }
  svg.replaceChildren(...parts);
  svg.classList.toggle("touch", Boolean(L.calibrating || (C.to_table && touching())));
  svg.setAttribute("aria-label", L.calibrating ? `Picture of the table. Touch known point ${L.at + 1}, or move its mark by the arrow keys.`
    : `Picture of the table, ${C.to_table ? `calibrated. ${said()}` : "not calibrated"}`);
}
async function startCamera() {
  try {
    stream = await navigator.mediaDevices.getUserMedia({ video: { width: { ideal: 1920 }, height: { ideal: 1080 }, facingMode: "environment" }, audio: false });
    $("video").srcObject = stream;
    await $("video").play();
    L.view = "picture";
  } catch (error) { stream = null; complain(`the browser gives no camera (${error.message}); choose a picture instead`); }
  draw();
}
function stopCamera() {
  if (stream) for (const track of stream.getTracks()) track.stop();
  stream = null;
  draw();
}
async function takePicture() {
  const video = $("video");
  const canvas = h("canvas", { width: video.videoWidth, height: video.videoHeight });
  canvas.getContext("2d").drawImage(video, 0, 0);
  sendPicture(await new Promise((done) => canvas.toBlob(done, "image/jpeg", 0.95)));
}
async function sendPicture(blob) {
  const camera = await send("/api/picture", "PUT", blob, "image/jpeg");
  if (!camera) return;
  stopCamera();
  L.view = "picture";
  seen(camera);
}
async function findTags() {
  const tags = await send("/api/tags", "GET");
  if (!tags) return;
  for (const tag of tags) if (tag.number <= L.points.length) L.pixels[tag.number - 1] = tag.pixel;
  if (!tags.length) complain("no tag is seen in the picture");
  draw();
}
async function calibrate() {
  const known = L.points.map((point, i) => [point, L.pixels[i]]).filter(([, pixel]) => pixel);
  const camera = await send("/api/calibrate", "POST", JSON.stringify({ points: known.map(([point]) => point), pixels: known.map(([, pixel]) => pixel) }));
  if (camera) { L.calibrating = false; seen(camera); }
}
async function find(by) {
  const found = await send("/api/find", "POST", JSON.stringify({ words: L.what || "the orange ball", size: (L.size || 7) / 100, by }));
  if (!found) return;
  box = found.box;
  L.view = "picture";
  if (touching()) setMark(found.place, C.sd);
  else draw();
}
function drawCamera() {
  if (!C || !mapped() || !L.connected) { fill("camera"); return; }
  const secure = window.isSecureContext && navigator.mediaDevices;
  const taking = h("div", { class: "row" },
    stream ? button("take", "Take the picture", takePicture) : secure && button("start", "Use this device's camera", startCamera),
    stream && button("off", "Switch it off", stopCamera),
    h("label", { class: "button" }, "Choose or take a picture", h("input", { class: "unseen", type: "file", id: "photo", accept: "image/jpeg,image/png", capture: "environment",
      onchange: (event) => event.target.files.length && sendPicture(event.target.files[0]) })));
  const parts = [h("h2", { id: "camera-title" }, "Camera"), h("p", {}, C.summary ? `${C.summary[0].toUpperCase()}${C.summary.slice(1)}.` : "Not calibrated: touch known points of the table in a picture once, then where the object landed in every other."),
    !secure && h("p", { class: "soft" }, "A browser gives its camera to https and to 127.0.0.1 only; here, choose a picture."), taking];
  if (C.picture && !L.calibrating) {
    parts.push(h("div", { class: "row" }, button("calibrate", C.to_table ? "Calibrate again" : "Calibrate", () => { L.calibrating = true; L.view = "picture"; L.points = C.points.map((p) => [...p]); L.pixels = []; L.at = 0; draw(); })));
    if (C.to_table) {
      parts.push(details("find", "Find the object in the picture",
        h("div", { class: "fields" }, h("label", {}, "What", h("input", { type: "text", id: "what", value: L.what || "the orange ball", oninput: (event) => { L.what = event.target.value; } })),
          h("label", {}, "Its size [cm]", h("input", { type: "text", inputmode: "decimal", id: "size", value: L.size || 7, oninput: (event) => { L.size = parseFloat(event.target.value) || 7; } }))),
        h("div", { class: "row" }, button("colour", "By its colour", () => find("colour")), button("model", "By a model", () => find("model")))));
    }
  }
  if (L.calibrating) {
    const known = L.pixels.filter(Boolean).length;
    parts.push(h("h3", {}, "Touch each known point in the picture"),
      h("ul", {}, L.points.map((point, i) => h("li", { class: "entry" },
        button(`point-${i}`, `Point ${i + 1}${L.pixels[i] ? " ✓" : ""}`, () => { L.at = i; draw(); }, "", { "aria-pressed": String(i === L.at) }),
        h("span", { class: "fields" }, [0, 1].map((j) => h("label", {}, ["ahead [cm]", "left [cm]"][j], h("input", { type: "text", inputmode: "decimal", id: `known-${i}-${j}`, value: Math.round(point[j] * 1000) / 10,
          onchange: (event) => { const value = parseFloat(event.target.value.replace(",", ".")); if (Number.isFinite(value)) L.points[i][j] = value / 100; } }))))))),
      h("div", { class: "row" }, button("more", "One more point", () => { L.points.push([0, 0]); L.at = L.points.length - 1; draw(); }), button("tags", "Find printed tags", findTags),
        button("sheet", "Tags to print", async () => { const answer = await get("/api/tags/sheet"); if (answer) h("a", { href: URL.createObjectURL(await answer.blob()), download: "tags.png" }).click(); })),
      button("fit", known < 4 ? `${4 - known} more points` : `Keep the calibration of ${known} points`, calibrate, "big", { disabled: known < 4 }),
      button("no-calibration", "Leave it as it is", () => { L.calibrating = false; draw(); }, "plain"));
  }
  fill("camera", parts);
}

// --- begin ------------------------------------------------------------------------------------

document.addEventListener("DOMContentLoaded", () => {
  $("stop").addEventListener("click", () => verb("stop"));
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") { event.preventDefault(); verb("stop"); } });
  surface($("map"), { active: () => Boolean(touching()), get: () => L.mark && uv(L.mark), set: (u, v) => setMark([-v / 1000, -u / 1000]), step: () => 10 });
  surface($("picture"), { active: () => Boolean(L.calibrating || (C && C.to_table && touching())), get: pixelOfMark, set: touchPixel, step: () => 10 });
  listen();
});
