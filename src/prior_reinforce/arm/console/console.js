// The page over a workspace. It holds nothing: `S` is what the console last said, `L` what this tab
// is about to do (a mark that was not told yet, a zoom). After every verb and every event it asks for
// the state anew and draws all of it. Numbers are in the outcome's units; the map is in millimetres.
"use strict";

let S = null;
const L = { mark: null, zoom: 1, amending: 0, byHand: 0, voiding: 0, words: {}, typed: {}, columns: [], open: {}, skipped: [], connected: null, unreadable: "", busy: false, episode: "", question: null };
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
  complain(""); // what comes from now on, by an answer or an event, is of this
  draw();
  const late = name === "stop" && setTimeout(() => complain(UNANSWERED), ANSWERS);
  try {
    const answer = await request(`/api/${name}`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(name === "stop" ? {} : { seen: S.id, ...body }),
    });
    clearTimeout(late);
    L.busy = false;
    if (!answer.ok) {
      const problem = await problemOf(answer);
      complain(name === "stop" && answer.status !== 409 ? `Stop is refused (${problem}). Use the arm's own stop button.` : problem);
      await refresh();
      return false;
    }
    if (complaint === UNANSWERED) complain("");
    take(await answer.json());
    return true;
  } catch {
    clearTimeout(late);
    L.busy = false;
    complain(name === "stop" ? UNANSWERED : "no answer came: look at what the page says now, before anything is done again");
    lost();
    return false;
  }
}
// For so long, in ms, Stop may be on its way; a stop that the arm obeys is answered within a second.
const ANSWERS = 2500;
const UNANSWERED = "No answer to Stop. The arm may still be moving: use the arm's own stop button.";

// What moves the arm waits for so long, in ms, after something has changed and is on the screen: a
// tap before was meant for what stood in its place, even where it is handled only now.
const CALM = 1000;
let [calmAt, calms] = [0, 0];
function calm() {
  calmAt = Infinity;
  const latest = (calms += 1);
  requestAnimationFrame(() => requestAnimationFrame(() => {
    if (latest !== calms) return;
    calmAt = performance.now() + CALM;
    setTimeout(drawNews, CALM + 20);
  }));
}

// A button that is drawn again between a finger's coming down and its going up is not pressed: news
// waits until the finger is gone and its click has done what it does, or for two seconds.
const HELD = 2000;
let heldUntil = 0;
async function free() {
  while (performance.now() < heldUntil) await new Promise((go) => setTimeout(go, 20));
}
let drawing = false;
async function drawNews() {
  if (drawing) return;
  drawing = true;
  await free();
  drawing = false;
  draw();
}

async function refresh() {
  const answer = await request("/api/state").catch(() => null);
  if (!answer) { lost(); return; }
  if (!answer.ok) { cannotRead(await problemOf(answer)); return; }
  const state = await answer.json();
  await free(); // a verb says which state its button was drawn from
  take(state);
}

function take(state) {
  if (S && state.id < S.id && state.task === S.task) return;
  const before = S;
  S = state;
  L.unreadable = "";
  if (!before || before.id !== S.id || before.stopped !== S.stopped) {
    calm();
    L.voiding = 0;
    L.question = null;
    if (before && (numberOpen(before) !== numberOpen(S) || before.goals.length !== S.goals.length)) { L.mark = null; L.byHand = 0; L.words = {}; L.typed = {}; }
    const told = L.amending && S.trials[L.amending - 1];
    if (told && told.stage !== "told") L.amending = 0;
  }
  const trial = openTrial();
  if (!trial) motion = null;
  else if (!motion || motion.sha256 !== trial.sha256) fetchMotion(trial.number);
  if (S.step === "execute" && S.moved_by === "command" && !L.question) askToMove("trial");
  if (mapped() && touching() === "goal" && S.model !== reach.of) fetchReach();
  draw();
}

// Which goals can be reached; tried once a model, when a goal is to be touched.
let reach = { of: null, goals: [], refused: [] };
async function fetchReach() {
  const of = S.model;
  reach = { of, goals: [], refused: [] };
  const answer = await get("/api/reach");
  if (!answer || of !== reach.of) return;
  reach = { of, ...await answer.json() };
  drawNews();
}

async function fetchMotion(number) {
  const answer = await get(`/api/plans/${number}`);
  if (!answer) return;
  motion = await answer.json();
  playing = { at: 0, on: false };
  drawNews();
}

let beat = 0;
function lost() {
  if (L.connected === false) return;
  L.connected = false;
  L.unreadable = "";
  drawNews();
}
// The console answers, but what the page shows is of before, and nothing can be done by it.
function cannotRead(why) {
  L.unreadable = why;
  drawNews();
}
const current = () => L.connected && !L.unreadable;

// Server-sent events, by fetch: EventSource can carry no header.
async function listen() {
  for (let refused = false; ; refused = false) {
    const stop = new AbortController();
    const watch = setInterval(() => { if (Date.now() - beat > 12000) stop.abort(); }, 1000);
    try {
      beat = Date.now();
      const answer = await request("/api/events", { signal: stop.signal });
      refused = !answer.ok;
      if (refused) { complain(await problemOf(answer)); throw new Error("refused"); }
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
    if (!refused || L.connected !== null) lost(); // a page without the link was never connected
    await new Promise((go) => setTimeout(go, 700));
  }
}

function heard(message) {
  if ("unreadable" in message) cannotRead(message.unreadable);
  if (!S) { if ("id" in message) refresh(); return; }
  if ("error" in message) complain(message.error);
  // Drawn only if no newer state follows, or everything would be drawn twice.
  const stale = "id" in message && (L.unreadable || message.id !== S.id || message.stopped !== S.stopped);
  if ("output" in message && message.output !== S.output) { S.output = message.output; if (!stale) drawNews(); }
  if ("learning" in message) { S.learning = message.learning; if (message.learning) drawNews(); else refresh(); }
  if ("recordings" in message && !L.uploading) { clearTimeout(L.later); L.later = setTimeout(fetchRecordings, 300); }
  if ("camera" in message) fetchCamera();
  if (stale) refresh();
}

// --- words ------------------------------------------------------------------------------------

const $ = (id) => document.getElementById(id);
// A number as a person says it: in cm, ms, degrees, to a tenth of what counts as reached or finer.
const digit = (c) => (c.unit === "m" ? 0.1 : 10 ** (Math.floor(Math.log10(c.tolerance * c.factor)) - 1));
const number = (c, value) => +(Math.round((value * c.factor) / digit(c)) * digit(c)).toFixed(9);
const term = (c, value, words) => {
  const size = number(c, value);
  return words.length ? `${Math.abs(size)} ${c.shown} ${words[size >= 0 ? 0 : 1]}` : `${c.name} ${size} ${c.shown}`;
};
const sayPlace = (place) => S.components.map((c, i) => term(c, place[i], c.places)).join(", ");
const sayError = (error) =>
  S.components.filter((c, i) => number(c, error[i])).map((c) => term(c, error[S.components.indexOf(c)], c.words)).join(", ") || "on the goal";
const count = (n, what) => `${n} ${what}${n === 1 ? "" : "s"}`;
const minus = (a, b) => a.map((v, i) => v - b[i]);
const openTrial = () => (S ? S.open_trial : null);
const numberOpen = (state) => (state.open_trial ? state.open_trial.number : null);
const goalNow = () => (S && S.goals.length ? S.goals[S.goals.length - 1] : null);
const goalOf = (trial) => S.goals[trial.goal - 1];
// Lengths along x and y are on the map; each other number of an outcome has a ruler of its own.
const axis = (k) => (S ? S.components.findIndex((c) => c.axis === k) : -1);
const mapped = () => axis(0) >= 0 && axis(1) >= 0;
const ruled = () => (S ? S.components.map((_, i) => i).filter((i) => !mapped() || S.components[i].axis > 1) : []);
const xy = (outcome) => [outcome[axis(0)], outcome[axis(1)]];
// A mark may lack a number that nobody gave yet.
const onMap = () => L.mark && xy(L.mark).every((v) => v !== null);
const missing = () => S.components.filter((_, i) => !L.mark || L.mark[i] === null);
const marked = () => missing().length === 0;
const touchFirst = (what) => (mapped() && !(L.mark && xy(L.mark).some((v) => v !== null)) ? `Touch where ${what}` : `Enter the ${missing().map((c) => c.name).join(", ")}`);

// What a touch of the table means now.
function touching() {
  if (!S || !current()) return "";
  if (L.amending) return "amend";
  if (L.episode) return "episode";
  const trial = openTrial();
  if (S.step === "goal" || S.step === "reached") return "goal";
  if (S.step === "tell") return "tell";
  if (S.step === "execute" && trial && (!S.moved_by || L.byHand === trial.number)) return "tell";
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
  // Kept at the click: `toggle` comes later, and what is drawn in between would be closed again.
  const kept = (event) => { L.open[key] = !event.currentTarget.parentElement.open; };
  return h("details", { open: L.open[key] }, h("summary", { id: `sum-${key}`, onclick: kept }, title), ...children);
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
  if (L.unreadable) return "The workspace cannot be read";
  if (L.amending) return `Correct trial ${L.amending}`;
  if (L.episode) return `Where did ${L.episode} land?`;
  if (S.learning) return "Learning";
  const trial = openTrial();
  if (S.step === "execute") return touching() === "tell" ? `Trial ${trial.number}: throw, then touch` : `Trial ${trial.number} is ready`;
  if (S.step === "reached") return `Reached in ${count(goalNow().reached_after, "trial")}`;
  return TITLES[S.step];
}

function draw() {
  $("stop").classList.toggle("armed", Boolean(S && S.step === "executing" && current()));
  $("stop").classList.toggle("unreached", L.connected === false);
  if (!S) {
    if (L.connected === null || current()) return;
    $("now").textContent = title();
    fill("act", outOfReach());
    return;
  }
  document.title = `${title()} · ${S.task}`;
  $("now").textContent = title();
  const goal = goalNow();
  $("task").textContent = goal ? `${S.task} · goal ${goal.number}: ${sayPlace(goal.goal)}` : S.task;
  $("stage").hidden = !mapped();
  const pictured = inPicture();
  $("map").toggleAttribute("hidden", pictured);
  $("picture").toggleAttribute("hidden", !pictured || Boolean(stream));
  $("video").hidden = !pictured || !stream;
  announce(`${title()}. ${said()}`);
  drawMap();
  drawRulers();
  drawBar();
  drawAct();
  drawPlan();
  drawHistory();
  drawCamera();
  drawPicture();
  drawRecordings();
}

const said = () => {
  if (!marked()) return "";
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
  const points = shownOutcomes().map(xy);
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
    const centre = goal ? xy(goal.goal) : middle;
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
  if (touching() === "goal") {
    for (const place of reach.goals) {
      const [u, v] = uv(xy(place));
      parts.push(g("circle", { class: "reach", cx: u, cy: v, r: 5 * px }));
    }
    for (const place of reach.refused) {
      const [u, v] = uv(xy(place));
      parts.push(g("path", { class: "reach", d: `M${u - 4 * px} ${v - 4 * px}l${8 * px} ${8 * px}m0 ${-8 * px}l${-8 * px} ${8 * px}` }));
    }
  }
  for (const { outcome, name } of shownDemonstrations()) {
    const [u, v] = uv(xy(outcome));
    parts.push(g("rect", { class: "demo", x: u - 6 * px, y: v - 6 * px, width: 12 * px, height: 12 * px }));
    if (name) parts.push(g("text", { class: "ruler", x: u + 10 * px, y: v + 4 * px, size: 12 * px }, name));
  }
  for (const goal of S.goals) {
    const now = goal.number === S.goals.length;
    if (!now && (goal.told === 0 || S.goals.length - goal.number > 30)) continue;  // given up, or long ago
    const [u, v] = uv(xy(goal.goal));
    const [along, across] = xy(goal.tolerance);
    if (now) parts.push(g("ellipse", { class: "goal ring", cx: u, cy: v, rx: 1000 * across, ry: 1000 * along }));
    const r = (now ? 14 : 7) * px;
    parts.push(g("path", { class: now ? "goal" : "goal old", d: `M${u - r} ${v}H${u + r}M${u} ${v - r}V${v + r}` }));
  }
  const current = S.trials.filter((trial) => trial.outcome && trial.goal === S.goals.length).length;
  for (const trial of S.trials) {
    if (!trial.outcome) continue;
    const [u, v] = uv(xy(trial.outcome));
    const old = trial.goal !== S.goals.length;
    parts.push(g("circle", { class: `trial${old ? " old" : ""}${trial.hit ? " landed" : ""}${trial.vague ? " vague" : ""}`, cx: u, cy: v, r: (old ? 4 : 11) * px }));
    if (!old) parts.push(g("text", { class: "on", x: u, y: v + 5 * px, size: 13 * px }, `${trial.number}`));
  }
  const waiting = openTrial();
  if (waiting && waiting.stage !== "executed") {
    const [u, v] = uv(xy(waiting.condition));
    parts.push(g("circle", { class: "aim", cx: u, cy: v, r: 18 * px }));
  }
  if (motion && motion.links.length && waiting) {
    const links = motion.links[frameAt()].map(uv);
    parts.push(g("polyline", { class: "path", points: motion.links.map((frame) => uv(frame[frame.length - 1])).join(" ") }));
    parts.push(g("polyline", { class: "arm", points: links.join(" ") }));
    for (const [u, v] of links) parts.push(g("circle", { class: "joint", cx: u, cy: v, r: 4 * px }));
  }
  if (onMap()) {
    const [u, v] = uv(xy(L.mark));
    const goal = touchedGoal();
    if (goal) { const [a, b] = uv(xy(goal.goal)); parts.push(g("line", { class: "mark", x1: a, y1: b, x2: u, y2: v })); }
    parts.push(g("circle", { class: "mark", cx: u, cy: v, r: 22 * px }));
    parts.push(g("path", { class: "mark", d: `M${u - 34 * px} ${v}h${22 * px}M${u + 12 * px} ${v}h${22 * px}M${u} ${v - 34 * px}v${22 * px}M${u} ${v + 12 * px}v${22 * px}` }));
    parts.push(g("circle", { class: "mark dot", cx: u, cy: v, r: 3 * px }));
  }
  map.replaceChildren(...parts);
  map.classList.toggle("touch", Boolean(touching()));
  map.setAttribute("aria-label", `Table from above, ${S.shown.length} demonstrations, ${current} trials of this goal told. ` +
    (touching() ? `Arrow keys move the mark of ${touched()} by a centimetre, with Shift by a millimetre; Enter places it. ${said()}` : ""));
}
const touched = () => (touching() === "goal" ? "the goal" : "where it landed");

// A ruler for each number that is on no map: demonstrations, goal, trials and mark as they are there.
const HIGH = 116; // [px]
let rulers = [];
function drawRulers() {
  if (!rulers.length && ruled().length) {
    rulers = ruled().map((i) => ({ i, svg: g("svg", { class: "gauge", id: `ruler-${i}`, tabindex: 0, role: "application", "aria-roledescription": "ruler" }) }));
    $("rulers").append(...rulers.map(({ i, svg }) => h("div", {}, h("p", { class: "soft" }, `${S.components[i].name} [${S.components[i].shown}]`), svg)));
    for (const ruler of rulers) {
      const c = S.components[ruler.i];
      surface(ruler.svg, {
        active: () => Boolean(touching()),
        get: () => L.mark && L.mark[ruler.i] !== null && [ruler.at(L.mark[ruler.i]), HIGH / 2],
        set: (u) => setNumber(ruler.i, ruler.low + (u / ruler.svg.clientWidth) * ruler.span),
        begin: () => [ruler.at((touchedGoal() || goalNow() || { goal: shownOutcomes()[0] }).goal[ruler.i]), HIGH / 2],
        step: () => ((10 * digit(c)) / c.factor / ruler.span) * ruler.svg.clientWidth,
      });
    }
  }
  for (const ruler of rulers) drawRuler(ruler);
}
function drawRuler(ruler) {
  const [c, svg, i] = [S.components[ruler.i], ruler.svg, ruler.i];
  const width = svg.clientWidth;
  if (!width) return;
  const values = shownOutcomes().map((outcome) => outcome[i]);
  if (!values.length) values.push(0);
  const goal = touchedGoal() || goalNow();
  let [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = 0.2 * (high - low) + 4 * c.tolerance;
  [low, high] = [low - margin, high + margin];
  if (L.zoom > 1 && goal) [low, high] = [low, high].map((end) => goal.goal[i] + (end - goal.goal[i]) / L.zoom);
  if (L.zoom === 0) [low, high] = [low - margin, high + margin];
  Object.assign(ruler, { low, span: high - low, at: (value) => ((value - low) / (high - low)) * width });
  const [at, middle] = [ruler.at, HIGH / 2];
  const parts = [g("line", { class: "grid axis", x1: 0, x2: width, y1: middle, y2: middle })];
  const ten = 10 ** Math.floor(Math.log10(((high - low) * c.factor * 44) / width));
  const step = [1, 2, 5, 10].map((k) => k * ten).find((s) => (s / c.factor / (high - low)) * width > 44);
  for (let k = Math.ceil((low * c.factor) / step); k * step < high * c.factor; k += 1) {
    const x = at((k * step) / c.factor);
    parts.push(g("line", { class: "grid", x1: x, x2: x, y1: middle - 8, y2: HIGH - 18 }), g("text", { class: "ruler number", x, y: HIGH - 4, size: 13 }, +(k * step).toFixed(6)));
  }
  for (const { outcome } of shownDemonstrations()) parts.push(g("rect", { class: "demo", x: at(outcome[i]) - 6, y: middle - 6, width: 12, height: 12 }));
  if (goalNow()) {
    const { goal: place, tolerance } = goalNow();
    const x = at(place[i]);
    parts.push(g("rect", { class: "goal ring", x: at(place[i] - tolerance[i]), y: 14, width: Math.max(1, at(2 * tolerance[i]) - at(0)), height: HIGH - 44 }), g("path", { class: "goal", d: `M${x} 14V${HIGH - 30}` }));
  }
  for (const trial of S.trials) {
    if (!trial.outcome || trial.goal !== S.goals.length) continue;
    parts.push(g("circle", { class: `trial${trial.hit ? " landed" : ""}${trial.vague ? " vague" : ""}`, cx: at(trial.outcome[i]), cy: middle, r: 11 }), g("text", { class: "on", x: at(trial.outcome[i]), y: middle + 5, size: 13 }, `${trial.number}`));
  }
  const waiting = openTrial();
  if (waiting && waiting.stage !== "executed") parts.push(g("circle", { class: "aim", cx: at(waiting.condition[i]), cy: middle, r: 18 }));
  if (L.mark && L.mark[i] !== null) {
    const x = at(L.mark[i]);
    parts.push(g("circle", { class: "mark", cx: x, cy: middle, r: 22 }), g("path", { class: "mark", d: `M${x} 0v${middle - 12}M${x} ${middle + 12}V${HIGH}` }));
  }
  svg.setAttribute("viewBox", `0 0 ${width} ${HIGH}`);
  svg.replaceChildren(...parts);
  svg.classList.toggle("touch", Boolean(touching()));
  svg.setAttribute("aria-label", `${c.name} in ${c.shown}. ` + (touching() ? `Arrow keys move the mark of ${touched()} by ${number(c, (10 * digit(c)) / c.factor)} ${c.shown}, with Shift by a tenth of that; Enter places it. ${said()}` : ""));
}
function drawBar() {
  const waiting = openTrial();
  const legend = S.shown.length ? ["☐ demonstrations"] : [];
  if (touching() === "goal" && reach.goals.length) legend.push("○ within the arm's reach, × not");
  if (S.goals.length) legend.push("✛ goal, its tolerance around it");
  if (S.trials.some((trial) => trial.outcome && trial.goal === S.goals.length)) legend.push("● trials by number, green where they hit");
  if (S.trials.some((trial) => trial.vague && trial.goal === S.goals.length)) legend.push("◌ only its direction was seen");
  if (waiting && waiting.stage !== "executed") legend.push("dashed: where the next plan aims");
  $("legend").textContent = legend.join(" · ");
  fill("mapbar",
    mapped() && C && (C.picture || stream) && button("view", inPicture() ? "Map" : "Picture", () => { L.view = L.view === "picture" ? "map" : "picture"; draw(); }),
    button("nearer", "+", () => { L.zoom = Math.min(8, L.zoom ? L.zoom * 2 : 1); draw(); }, "", { "aria-label": "Nearer", disabled: L.zoom >= 8 }),
    button("farther", "−", () => { L.zoom = L.zoom > 1 ? L.zoom / 2 : 0; draw(); }, "", { "aria-label": "Farther", disabled: L.zoom === 0 }));
}
// All outcomes that have to be seen now; a goal that was mistyped and corrected is none of them.
const shownOutcomes = () => [
  ...shownDemonstrations().map(({ outcome }) => outcome),
  ...[goalNow(), touchedGoal()].filter(Boolean).map(({ goal }) => goal),
  ...S.trials.filter((trial) => trial.outcome && (trial.goal === S.goals.length || trial.number === L.amending)).map(({ outcome }) => outcome),
];

const anyMark = () => (L.mark ? [...L.mark] : S.components.map(() => null));
function setMark([x, y], measured = 0) {
  const mark = anyMark();
  [mark[axis(0)], mark[axis(1)]] = [x, y].map((v) => Math.round(v * 2000) / 2000);
  Object.assign(L, { mark, measured, words: {} });
  draw();
}
function setNumber(i, value) {
  const c = S.components[i];
  const mark = anyMark();
  mark[i] = number(c, value) / c.factor;
  Object.assign(L, { mark, measured: 0, words: {} });
  draw();
}
// A mark that is set by touching, dragged by the finger or moved by the keyboard, in an SVG's units.
function surface(svg, { active, get, set, begin, step }) {
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
    if (!mark) set(...begin());
    else if (way) set(mark[0] + size * way[0], mark[1] + size * way[1]);
    else if (document.querySelector("#act .big")) document.querySelector("#act .big").focus();
  });
  new ResizeObserver(() => { if (S) { fitted = ""; drawMap(); drawRulers(); drawPicture(); } }).observe(svg);
}

// --- the action -------------------------------------------------------------------------------

const telling = () => (L.amending ? "amend" : "tell");
const tellingOf = () => L.amending || numberOpen(S);

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
  const link = h("a", { href: URL.createObjectURL(await answer.blob()), download: `${S.task}-trial-${trial.number}.npz` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function chance(trial) {
  if (trial.p_hit === null) return null;
  return h("p", { class: "chance", id: "chance" }, `A hit is ${trial.chance} `, h("small", {}, trial.to_go && `${trial.to_go} trials to go`));
}
function surprise(trial) {
  const before = S.trials.slice(0, trial.number - 1).reverse().find((each) => each.stage === "told");
  if (!before || !before.surprise) return null;
  return h("div", { class: "ask", id: "surprise" }, `Trial ${before.number} is ${before.surprise.split(" (")[0]}. Mistyped? Or did the table, the ball or the arm change?`,
    h("div", { class: "row" },
      button("mistyped", `Mistyped: correct trial ${before.number}`, () => { L.amending = before.number; L.mark = null; draw(); }),
      button("changed", "Something changed", () => changed(trial.number))));
}
function fields() {
  const ahead = ["ahead of the base", "left of the base", "up"];
  return h("div", { class: "fields" }, S.components.map((c, i) => h("label", {}, `${c.axis < 3 ? ahead[c.axis] : c.name} [${c.shown}]`, h("input", {
    id: `field-${i}`, type: "text", inputmode: "decimal", autocomplete: "off", value: shownField(c, i),
    // At each key: drawn when the field is left, the field or button that is touched then would be gone.
    oninput: (event) => {
      L.typed[i] = event.target.value;
      const mark = anyMark();
      mark[i] = typedNumber(c, i);
      Object.assign(L, { mark, measured: 0, words: {} });
      draw();
    },
  }), typedRemark(c, i))));
}
// Why nothing is read, or what a comma is taken for.
const typedRemark = (c, i) => {
  const typed = (L.typed[i] || "").trim();
  const at = typedNumber(c, i);
  if (typed && at === null) return h("small", { class: "ask", id: `unread-${i}` }, `Type a number alone, in ${c.shown}`);
  return typed.includes(",") && L.mark && L.mark[i] === at ? h("small", { id: `read-${i}` }, `Read as ${number(c, at)} ${c.shown}`) : null;
};
const typedNumber = (c, i) => {
  const said = plainNumber(L.typed[i] || "");
  return said === null ? null : said / c.factor;
};
// A number as it is typed, with a comma too, and nothing beside it: no unit is guessed.
const plainNumber = (text) => {
  const said = text.trim().replace(",", ".");
  return said && Number.isFinite(+said) ? +said : null;
};
const metresOf = (text) => (plainNumber(text) === null ? null : plainNumber(text) / 100);
// As it was typed, unless the mark was moved since.
const shownField = (c, i) => {
  const at = L.mark ? L.mark[i] : null;
  if (typedNumber(c, i) === at) return L.typed[i] || "";
  return at === null ? "" : number(c, at);
};
// The paper's words: what an observer says of an error, by eye.
const SPOKEN = ["cm", "mm", "in", "ms", "deg"];
const spoken = () => S.components.every((c) => c.words.length && (SPOKEN.includes(c.shown) || S.components.length === 1));
const sizes = (c) => {
  const some = c.unit === "m" ? [2, 5, 10, 20] : [1, 2, 5, 10].map((k) => k * 10 * digit(c));
  return [...some.map((size) => -size).reverse(), 0, ...some];
};
const word = (c, size) => `${Math.abs(size)}${SPOKEN.includes(c.shown) ? c.shown : ""} ${c.words[size > 0 ? 0 : 1]}`;
// What was chosen in words; empty where a row has no choice yet, or all of them say "neither".
const inWords = () => {
  const said = S.components.map((c, i) => L.words[i] && word(c, L.words[i])).filter(Boolean).join(", ");
  return S.components.every((_, i) => L.words[i] !== undefined) ? said : "";
};
function byEye() {
  const missed = h("div", { class: "row" },
    button("missed", "Missed, not seen by how much", () => tell({ hit: false })),
    button("gone", "Lost: nobody saw where it went", () => tell({ error: "lost" })));
  if (!spoken()) return missed;
  const rows = S.components.map((c, i) => {
    const turned = c.axis === 1; // left is to the left
    const ends = turned ? c.words : [...c.words].reverse();
    const choose = (size) => { L.mark = null; L.words[i] = size; draw(); };
    return h("fieldset", {}, h("legend", {}, `${ends[0][0].toUpperCase()}${ends[0].slice(1)} or ${ends[1]} of the goal, in ${c.shown}`),
      h("div", { class: "scale" }, (turned ? sizes(c).reverse() : sizes(c)).map((size) => h("label", {}, `${Math.abs(size)}`,
        h("input", { type: "radio", name: `eye-${i}`, id: `eye-${i}-${size}`, "aria-label": size ? word(c, size) : "neither",
          checked: L.words[i] === size, onchange: () => choose(size) })))),
      h("div", { class: "ends" }, ends.map((end) => h("span", {}, end))));
  });
  return details("eye", "By eye, in words", rows, missed);
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
  const error = marked() && minus(L.mark, goalOf(trial).goal);
  const chosen = Object.keys(L.words).length > 0;
  const told = chosen ? inWords() : error && sayError(error);
  const said = chosen ? told : L.measured ? { error, sd: L.measured } : error;
  const first = chosen ? "Choose one in each row" : touchFirst("it landed");
  return [
    trial.warning && h("p", { class: "ask" }, `Executed, ${trial.warning}. If that spoiled it, it slipped.`),
    button("tell", told ? `${L.amending ? `Trial ${number} was` : "Report:"} ${told}` : first, () => tell({ error: said }), "big", { disabled: !told || L.busy }),
    h("div", { class: "row" }, button("hit", "Hit", () => tell({ hit: true }), "hit", { disabled: L.busy }), voider(number, L.amending ? "Void it" : "Slipped"),
      L.amending ? button("cancel", "Leave it as it is", () => { L.amending = 0; L.mark = null; draw(); }) : null),
    confirmVoid(number),
    byEye(),
    details("fields", "Type the place", fields()),
    !L.amending && S.output && details("said", "What the executor said", h("pre", { class: "output", tabindex: "0" }, S.output)),
  ];
}

// What is there to do where the page is of before.
function outOfReach() {
  if (L.connected) return [h("p", { class: "ask" }, L.unreadable), h("p", {}, "What is below may be old. The arm may be moving: watch it.")];
  return [h("p", { class: "danger", role: "alert" }, "The arm may still be moving. Stop on this page does NOT reach it: use the arm's own stop button."),
    h("p", {}, "What is below may be old. This page goes on by itself once the console answers; nothing is lost.")];
}
function drawAct() {
  const trial = openTrial();
  const off = { disabled: !current() || L.busy };
  const parts = [];
  if (!current()) parts.push(...outOfReach());
  else if (L.episode) parts.push(...episodePanel());
  else if (touching() === "tell" || touching() === "amend") {
    if (trial && S.step === "execute" && !L.amending) parts.push(chance(trial), surprise(trial), old(trial), button("download", `Download the plan of trial ${trial.number}`, () => download(trial)));
    parts.push(...tellPanel());
  } else if (S.learning) {
    parts.push(h("progress", { value: S.learning[0], max: 1, "aria-label": "learned so far" }), h("p", {}, `${Math.round(100 * S.learning[0])} %, ${Math.round(S.learning[1])} s left`));
  } else if (S.step === "import") parts.push(...importPanel());
  else if (S.step === "learn") parts.push(button("learn", `Learn from ${S.shown.length} demonstrations`, () => verb("learn"), "big", off));
  else if (touching() === "goal") parts.push(...goalPanel(off));
  else if (S.step === "ask") parts.push(button("ask", "Get the next plan", () => verb("ask"), "big", off));
  else if (S.step === "execute") {
    parts.push(chance(trial), surprise(trial), old(trial), trial.warning && h("p", { class: "ask" }, `Last time: ${trial.warning}.`), ...executePanel(trial, off),
      details("other", "Another way", h("div", { class: "row" },
        S.moved_by === "arm" && button("rehearse", "Rehearse at 20 % of its speed", () => askToMove("rehearsal", 0.2), "", off),
        button("download", "Download the plan", () => download(trial)),
        button("by-hand", "It was executed otherwise", () => { L.byHand = trial.number; draw(); }), voider(trial.number, "Void it")), confirmVoid(trial.number)));
  } else if (S.step === "executing") {
    parts.push(h("pre", { class: "output", tabindex: "0", "aria-label": "what the executor says" }, S.output || "started"),
      button("stop-2", "Stop the arm", () => verb("stop"), "big stop"));
  } else if (S.step === "settle") {
    parts.push(h("p", { class: "ask" }, trial.warning ? `Trial ${trial.number} was executed, ${trial.warning}.` : `Nobody wrote down how trial ${trial.number} ended. Look at the arm.`),
      h("div", { class: "row" },
        button("moved", "It moved, and the object flew", () => { L.amending = 0; S.step = "tell"; draw(); }),
        button("spoiled", "It moved: void the trial", () => voidTrial(trial.number, (trial.warning || "").replace("but aborted: ", "") || "the execution was cut off"), "bad"),
        button("still", "Nothing moved", () => verb("ask", { arm_did_not_move: true }))));
  }
  $("act").classList.toggle("tall", S.step === "import" && !L.episode);
  const far = current() && S.far && S.step !== "reached" && h("p", { class: "ask", id: "far" }, `${S.far}.`);
  fill("act", h("h2", { class: "unseen" }, "What to do"), far, ...parts);
}
// Before an arm moves, it is asked where it stands, and a person is asked what the command line asks.
async function askToMove(motion, speed = 1) {
  const trial = openTrial();
  const asked = { seen: S.id, stopped: S.stopped, trial: trial.number, sha256: trial.sha256, motion, speed };
  if (S.moved_by === "arm") { L.busy = true; draw(); }
  const question = await send("/api/question", "POST", JSON.stringify(asked));
  await free(); // it is drawn at once, and calm from then on
  L.busy = false;
  if (question && asked.seen === S.id && asked.stopped === S.stopped) {
    L.question = { ...question, asked: { ...asked, motion: question.motion, speed: question.motion === "rehearsal" ? speed : 1, stood: question.stood } };
    calm();
  }
  draw();
}
const MOVES = {
  trial: (n) => `Throw ${n} at FULL SPEED`,
  rehearsal: (n, speed) => `Rehearse ${n} at ${Math.round(100 * speed)} %`,
  approach: (n) => `Yes: move slowly to where trial ${n} begins`,
};
function executePanel(trial, off) {
  const question = L.question;
  if (S.moved_by === "arm" && (!question || question.refused)) {
    return [
      question && h("p", { class: "ask" }, `${question.arm}. It refuses the plan: ${question.refused}.`),
      button("prepare", L.busy ? "Asking the arm where it stands" : question ? "Ask the arm again" : `Prepare trial ${trial.number}`, () => askToMove("trial"), "big", off),
      h("p", { class: "soft" }, "The arm is asked where it stands, and whether it takes the plan. Nothing moves yet."),
    ];
  }
  const still = { disabled: off.disabled || !question || performance.now() < calmAt };
  const fast = !question || question.fast;
  const moves = MOVES[question ? question.motion : "trial"](trial.number, question ? question.asked.speed : 1);
  // Where the slow one has its button, the fast one has its No: a tap that was meant for one is not taken for the other.
  const yes = button("execute", moves, (event) => event.timeStamp >= calmAt && verb("execute", question.asked), fast ? "big full-speed" : "big", still);
  const no = S.moved_by === "arm" && h("div", { class: "row" }, button("not-now", "No, not now", () => { L.question = null; draw(); }));
  return [
    question && question.arm && h("p", {}, question.arm),
    h("p", { class: fast ? "ask full-speed" : "ask", id: "question" }, question ? question.question : ""),
    fast ? [no, yes] : [yes, no],
    h("p", { class: "soft" }, "The arm moves at once: keep clear. Stop on this page ends it; keep the arm's own stop button in your hand."),
  ];
}
const old = (trial) => trial.outdated && h("p", { class: "ask" }, "Planned before a correction: unless it was thrown, void it, and a newer plan comes.");

function goalPanel(off) {
  const goal = goalNow();
  return [
    S.step === "reached" && h("p", { class: "chance hit" }, `Goal ${goal.number} is reached: N = ${count(goal.demonstrations, "demonstration")} + ${count(goal.reached_after, "trial")} = ${goal.demonstrations + goal.reached_after}.`),
    button("goal", marked() ? `Aim at ${sayPlace(L.mark)}` : S.step === "reached" && !L.mark ? "Touch the next goal" : touchFirst("it should land"),
      () => setGoal({ goal: L.mark, new_hardware: L.changed || null }), "big", { disabled: !marked() || off.disabled }),
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
  const ends = column.limits || [low - 0.1 * (high - low) - 1e-6, high + 0.1 * (high - low) + 1e-6];
  const x = (value) => (100 * (value - ends[0])) / (ends[1] - ends[0]);
  const svg = g("svg", { viewBox: "0 0 100 10", preserveAspectRatio: "none", role: "img",
    "aria-label": `${column.name} from ${low.toFixed(2)} to ${high.toFixed(2)} ${column.unit}` + (column.limits ? `, limits ${column.limits.map((end) => end.toFixed(2)).join(" to ")}` : "") });
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
    h("p", { class: "soft" }, `Plan ${motion.sha256.slice(0, 12)}`));
}

// --- the history ------------------------------------------------------------------------------

const SHOWN = 12;
function sayTrial(trial) {
  if (!trial.hit) return trial.seen || trial.line;
  return trial.error ? `✓ hit, ${trial.seen}` : "✓ hit";
}
function drawHistory() {
  if (!S.trials.length) { fill("history"); return; }
  const trials = [...S.trials].reverse();
  const row = (trial) => h("li", {}, h("div", { class: "entry" }, h("b", {}, `${trial.number}`),
    h("span", { class: trial.hit ? "hit" : "" }, `${sayTrial(trial)}${trial.p_hit !== null && trial.stage === "told" ? ` (a hit was ${trial.chance})` : ""}`),
    trial.stage === "told" && button(`amend-${trial.number}`, "Correct", () => { L.amending = trial.number; L.mark = trial.outcome; draw(); (mapped() ? $("map") : rulers[0].svg).focus(); }, "plain", { "aria-label": `Correct trial ${trial.number}` }),
    trial.stage === "told" && L.voiding !== trial.number && button(`undo-${trial.number}`, "Void", () => { L.voiding = trial.number; draw(); }, "plain", { "aria-label": `Void trial ${trial.number}` })),
    trial.stage === "told" && !L.amending && confirmVoid(trial.number));
  const goals = (list) => list.flatMap((trial, i) => {
    const first = i === 0 || list[i - 1].goal !== trial.goal;
    return [first && h("li", { class: "soft" }, `Goal ${trial.goal}: ${sayPlace(goalOf(trial).goal)}${goalOf(trial).new_hardware ? ` (changed: ${goalOf(trial).new_hardware})` : ""}`), row(trial)];
  });
  fill("history", h("h2", { id: "history-title" }, "What happened"), S.left_out && h("p", { class: "soft" }, `${S.left_out}.`), h("ul", {}, goals(trials.slice(0, SHOWN))),
    trials.length > SHOWN && (L.open.all ? h("ul", {}, goals(trials.slice(SHOWN))) : button("all", `${trials.length - SHOWN} earlier trials`, () => { L.open.all = true; draw(); }, "plain")),
    S.report && h("p", {}, h("a", { href: S.report, target: "_blank", rel: "noopener" }, "The report: every goal, trial and plan")));
}

// --- recordings -------------------------------------------------------------------------------

let R = null;
async function fetchRecordings() {
  const answer = await get("/api/recordings");
  if (answer) { R = await answer.json(); drawNews(); }
}
const episodes = () => (R ? Object.entries(R.episodes).map(([name, outcome]) => ({ name, outcome })) : []);
const shownDemonstrations = () => {
  const placed = L.episode || S.step === "import" ? episodes().filter((e) => e.outcome) : [];
  return placed.length || L.episode ? placed : S.shown.map((outcome) => ({ outcome }));
};
const unplaced = () => episodes().filter((e) => !e.outcome && !L.skipped.includes(e.name));
// The files of a folder that was dropped, with those of the folders in it; nothing hidden.
async function walk(entry, path = "") {
  if (entry.name.startsWith(".")) return [];
  if (entry.isFile) return [[path + entry.name, await new Promise((done, failed) => entry.file(done, failed))]];
  const [reader, found] = [entry.createReader(), []];
  for (let some = [0]; some.length;) {
    some = await new Promise((done, failed) => reader.readEntries(done, failed)); // a hundred at a time
    for (const each of some) found.push(...await walk(each, `${path}${entry.name}/`));
  }
  return found;
}
async function dropped(items) {
  try {
    const entries = [...items].map((item) => item.webkitGetAsEntry()).filter(Boolean); // at once: the items are gone later
    await upload((await Promise.all(entries.map((entry) => walk(entry)))).flat());
  } catch (error) { complain(`the browser does not read what was dropped (${error.message}); choose the files instead`); }
}
async function upload(files) {
  for (const [name, file] of files) {
    if (file.size > 64e6) { complain(`${name} is larger than the page takes (64 MB); use: prior-reinforce import`); return; }
    L.uploading = name;
    draw();
    const answer = await request(`/api/recordings?name=${encodeURIComponent(name)}`, { method: "PUT", body: file }).catch(() => null);
    if (!answer || !answer.ok) { L.uploading = ""; complain(answer ? await problemOf(answer) : `${name} did not arrive; drop it again`); draw(); return; }
  }
  L.uploading = "";
  complain("");
  await fetchRecordings();
  nextEpisode();
}
function nextEpisode() {
  const next = unplaced()[0];
  touchFor(next ? next.name : "");
}
function touchFor(name) {
  L.episode = name;
  L.mark = name ? R.episodes[name] : null;
  draw();
  if (name) $("table").scrollIntoView({ block: "start" }); // on a phone the list is screens below it
}
async function placeEpisode(name, outcome) {
  const lengths = S.components.every((c) => c.unit === "m"); // one sd is of one unit
  const placed = await send("/api/place", "POST", JSON.stringify({ episode: name, outcome, sd: lengths ? L.measured || 0.02 : 0 }));
  if (!placed) return;
  R = placed;
  nextEpisode();
}
function importPanel() {
  const zone = h("label", { class: "drop", id: "drop" }, L.uploading ? `Receiving ${L.uploading}` : "Drop recordings or their folder here, or choose files",
    h("span", { class: "soft" }, "NPZ, CSV, LeRobot, HDF5, ROS bags, and outcomes.csv if you have one"),
    h("input", { type: "file", multiple: true, id: "files", onchange: (event) => upload([...event.target.files].map((file) => [file.name, file])) }));
  zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => { event.preventDefault(); dropped(event.dataTransfer.items); });
  if (!R || !R.files) return [zone];
  const [all, placed] = [episodes(), episodes().filter((e) => e.outcome).length];
  return [
    R.problem && h("p", { class: "ask" }, R.problem),
    R.recorded.length > 0 && columnPickers(),
    R.questions.length > 0 && h("div", { class: "ask" }, R.questions.map((what) => h("p", {}, what)),
      h("label", {}, h("input", { type: "checkbox", id: "confirmed", checked: L.confirmed, onchange: (event) => { L.confirmed = event.target.checked; draw(); } }), " Yes, so it is")),
    all.length > 0 && button("import", placed === all.length ? `Import ${placed} recordings` : placed === 0 ? `Say where each recording landed (0 of ${all.length})` : `Import the ${placed} of ${all.length} that have an outcome`,
      takeIn, "big", { disabled: !placed || (R.questions.length > 0 && !L.confirmed) || !current() || L.busy }),
    all.length > 0 && h("ul", {}, all.map((e) => h("li", { class: "entry" }, h("span", {}, `${e.name}: ${e.outcome ? sayPlace(e.outcome) : "not touched yet"}`),
      button(`place-${e.name}`, e.outcome ? "Correct" : "Touch", () => touchFor(e.name), "plain", { "aria-label": `Touch where ${e.name} landed` })))),
    R.text && details("preview", "What the recordings hold", h("pre", { class: "output", tabindex: "0" }, R.text)),
    zone, button("discard", "Forget these files", async () => { L.skipped = []; if (await send("/api/recordings", "DELETE")) fetchRecordings(); }, "plain"),
  ];
}
// Recordings whose columns have other names than the plan's: which is which is never guessed here.
function columnPickers() {
  const chosen = R.joints.map((_, i) => L.columns[i] || "");
  const each = R.joints.map((joint, i) => h("label", {}, joint, h("select", { id: `column-${i}`, onchange: (event) => { L.columns[i] = event.target.value; draw(); } },
    ["", ...R.recorded].map((name) => h("option", { value: name, selected: name === chosen[i] }, name || "choose")))));
  const use = async () => {
    const found = await send("/api/columns", "POST", JSON.stringify({ names: chosen }));
    if (found) { R = found; L.columns = []; nextEpisode(); }
  };
  return [h("div", { class: "fields" }, each), button("columns", "Use these columns", use, "big", { disabled: !chosen.every(Boolean) || new Set(chosen).size < chosen.length || !current() })];
}
async function takeIn() {
  if (await verb("take", { confirmed: Boolean(L.confirmed) })) { L.confirmed = false; L.open.recordings = false; draw(); }
}
function episodePanel() {
  const name = L.episode;
  return [
    button("place", marked() ? `It landed ${sayPlace(L.mark)}` : touchFirst("it landed"), () => placeEpisode(name, L.mark), "big", { disabled: !marked() }),
    h("p", { class: "soft" }, `${unplaced().length} of ${episodes().length} recordings have no outcome yet.`),
    h("div", { class: "row" }, button("skip", "Leave it out", () => { L.skipped.push(name); nextEpisode(); }),
      button("later", "Back to the list", () => touchFor(""))),
    details("fields", "Type the place", fields()),
  ];
}
function drawRecordings() {
  if (S.step === "import" || L.episode || !current()) { fill("recordings"); return; }
  fill("recordings", h("h2", { id: "recordings-title" }, "Demonstrations"),
    h("p", {}, `${S.shown.length} in use; ${S.generator ? `learned by ${S.generator}` : "not learned from yet"}.`),
    S.remarks.length > 0 && details("remarks", "What learning found", S.remarks.map((remark) => h("p", {}, remark))),
    S.step !== "learn" && !S.open_trial && button("learn-again", "Learn again", () => verb("learn"), "", { disabled: L.busy || Boolean(S.learning) }),
    details("recordings", "Bring in others", importPanel()));
}

// --- the camera -------------------------------------------------------------------------------

let C = null;
let stream = null;
let pictureUrl = "";
let box = null;
const inPicture = () => Boolean(L.view === "picture" && C && (C.picture || stream));
// Whose picture counts: of the trial that is corrected, or that waits to be told; 0, the latest.
const pictureOf = () => L.amending || numberOpen(S) || 0;
async function fetchCamera() {
  if (!S) return;
  const of = pictureOf();
  const answer = await get(`/api/camera?trial=${of}`);
  if (answer) seen(await answer.json(), of);
}
// A picture is shown, and may be touched, once it is there whole: before, no touch has a place in it.
async function seen(camera, of) {
  if (of !== pictureOf()) { fetchCamera(); return; }
  camera.for = of; // drawn only while that is still so
  if (!camera.picture) {
    [pictureUrl, box, L.calibrating] = ["", null, false];
    $("picture").replaceChildren();
  } else if (camera.picture !== (C && C.picture) || !pictureUrl) {
    const answer = await get(`/api/picture?trial=${of}`);
    if (!answer) return;
    const url = URL.createObjectURL(await answer.blob());
    const image = h("img", { src: url });
    await image.decode();
    if (pictureUrl) URL.revokeObjectURL(pictureUrl);
    [pictureUrl, L.wide, L.tall, box, L.found] = [url, image.naturalWidth, image.naturalHeight, null, []];
  }
  C = camera;
  drawNews();
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
  return onMap() && C.to_table ? toPixel(xy(L.mark)) : null;
};
function touchPixel(u, v) {
  if (L.calibrating) { L.pixels[L.at] = [u, v]; draw(); } else { box = box && moved(box, u, v); setMark(times(C.to_table, [u, v]), C.sd); }
}
const moved = ([l, t, r, b], u, v) => [u - (r - l) / 2, v - (b - t) / 2, u + (r - l) / 2, v + (b - t) / 2];
function drawPicture() {
  const svg = $("picture");
  if (!C || !pictureUrl || svg.hasAttribute("hidden")) return;
  const zoom = Math.max(1, L.zoom);
  const middle = pixelOfMark() || (C.to_table && goalNow() ? toPixel(xy(goalNow().goal)) : [L.wide / 2, L.tall / 2]);
  if (!L.window || L.window.zoom !== zoom || L.window.of !== C.picture) {
    const at = [0, 1].map((i) => Math.min(Math.max(middle[i] - [L.wide, L.tall][i] / zoom / 2, 0), [L.wide, L.tall][i] * (1 - 1 / zoom)));
    L.window = { zoom, of: C.picture, box: `${at[0]} ${at[1]} ${L.wide / zoom} ${L.tall / zoom}` };
  }
  svg.setAttribute("viewBox", L.window.box);
  const px = L.wide / zoom / Math.max(1, svg.clientWidth);
  const parts = [g("image", { href: pictureUrl, width: L.wide, height: L.tall })];
  const cross = ([u, v], kind, r) => g("path", { class: kind, d: `M${u - r} ${v}H${u + r}M${u} ${v - r}V${v + r}` });
  if (L.calibrating) {
    L.points.forEach((_, i) => {
      if (!L.pixels[i]) return;
      parts.push(cross(L.pixels[i], i === L.at ? "mark" : "aim", 18 * px), g("text", { x: L.pixels[i][0] + 8 * px, y: L.pixels[i][1] - 8 * px, size: 18 * px }, `${i + 1}`));
    });
  } else if (C.to_table) {
    const goal = touchedGoal() || goalNow();
    if (goal) {
      const [[x, y], [a, b]] = [xy(goal.goal), xy(goal.tolerance)];
      const ring = [...Array(25).keys()].map((i) => toPixel([x + a * Math.cos(i * Math.PI / 12), y + b * Math.sin(i * Math.PI / 12)]));
      parts.push(g("polygon", { class: "goal ring", points: ring.join(" ") }), cross(toPixel([x, y]), "goal", 10 * px));
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
  const of = pictureOf();
  const camera = await send(`/api/picture?trial=${of}`, "PUT", blob, "image/jpeg");
  if (!camera) return;
  stopCamera();
  L.view = "picture";
  seen(camera, of);
}
async function findTags() {
  const tags = await send(`/api/tags?trial=${pictureOf()}`, "GET");
  if (!tags) return;
  for (const [number, pixel] of Object.entries(tags)) if (number <= L.points.length) L.pixels[number - 1] = pixel;
  if (!Object.keys(tags).length) complain("no tag is seen in the picture");
  draw();
}
async function calibrate() {
  const known = L.points.map((point, i) => [point, L.pixels[i]]).filter(([, pixel]) => pixel);
  const of = pictureOf();
  const camera = await send("/api/calibrate", "POST", JSON.stringify({ points: known.map(([point]) => point), pixels: known.map(([, pixel]) => pixel), trial: of }));
  if (camera) { L.calibrating = false; L.fitted = camera.doubts; seen(camera, of); }
}
async function find(by) {
  const size = metresOf(L.size ?? "7");
  if (!(size > 0)) { complain(`its size "${L.size}" is no number of centimetres`); return; }
  const of = pictureOf();
  const found = await send("/api/find", "POST", JSON.stringify({ words: L.what || "the orange ball", size, round: L.round !== false, by, trial: of }));
  if (!found || of !== pictureOf()) return;
  [box, L.found] = [found.box, found.doubts];
  L.view = "picture";
  if (touching()) setMark(found.place, found.sd);
  else draw();
}
function drawCamera() {
  if (C && C.for !== pictureOf()) { C = null; fetchCamera(); }
  if (!C || !mapped() || !current()) { fill("camera"); return; }
  const secure = window.isSecureContext && navigator.mediaDevices;
  const taking = h("div", { class: "row" },
    stream ? button("take", "Take the picture", takePicture) : secure && button("start", "Use this device's camera", startCamera),
    stream && button("off", "Switch it off", stopCamera),
    h("label", { class: "button" }, "Choose or take a picture", h("input", { class: "unseen", type: "file", id: "photo", accept: "image/jpeg,image/png", capture: "environment",
      onchange: (event) => event.target.files.length && sendPicture(event.target.files[0]) })));
  const parts = [h("h2", { id: "camera-title" }, "Camera"), h("p", {}, C.summary ? `${C.summary[0].toUpperCase()}${C.summary.slice(1)}.` : "Not calibrated: touch known points of the table in a picture once, then where the object landed in every other."),
    !secure && h("p", { class: "soft" }, "A browser gives its camera to https and to 127.0.0.1 only; here, choose a picture."), taking];
  if (C.of && !pictureOf()) parts.push(h("p", { class: "soft" }, `This is the picture of ${C.of}.`));
  for (const doubt of new Set([...(L.fitted || []), ...C.doubts, ...(L.found || [])])) parts.push(h("p", { class: "ask" }, `${doubt[0].toUpperCase()}${doubt.slice(1)}${doubt.endsWith("?") ? "" : "."}`));
  if (C.picture && !L.calibrating) {
    parts.push(h("div", { class: "row" }, button("calibrate", C.to_table ? "Calibrate again" : "Calibrate", () => { L.calibrating = true; L.view = "picture"; L.points = C.points.map((p) => [...p]); L.texts = {}; L.pixels = []; L.at = 0; draw(); })));
    if (C.to_table) {
      parts.push(details("find", "Find the object in the picture",
        h("div", { class: "fields" }, h("label", {}, "What", h("input", { type: "text", id: "what", value: L.what || "the orange ball", oninput: (event) => { L.what = event.target.value; } })),
          h("label", {}, "Its size [cm]", h("input", { type: "text", inputmode: "decimal", id: "size", value: L.size ?? "7", oninput: (event) => { L.size = event.target.value; } })),
          h("label", {}, h("input", { type: "checkbox", id: "round", checked: L.round !== false, onchange: (event) => { L.round = event.target.checked; } }), " It is round")),
        h("div", { class: "row" }, button("colour", "By its colour", () => find("colour")), button("model", "By a model", () => find("model")))));
    }
  }
  if (L.calibrating) {
    const known = L.pixels.filter(Boolean).length;
    const unread = L.points.findIndex((point, i) => L.pixels[i] && point.includes(null));
    parts.push(h("h3", {}, "Touch each known point in the picture"),
      h("ul", {}, L.points.map((point, i) => h("li", { class: "entry" },
        button(`point-${i}`, `Point ${i + 1}${L.pixels[i] ? " ✓" : ""}`, () => { L.at = i; draw(); }, "", { "aria-pressed": String(i === L.at) }),
        h("span", { class: "fields" }, [0, 1].map((j) => h("label", {}, ["ahead [cm]", "left [cm]"][j], h("input", { type: "text", inputmode: "decimal", id: `known-${i}-${j}`, value: L.texts[`${i}-${j}`] ?? Math.round(point[j] * 1000) / 10,
          oninput: (event) => { point[j] = metresOf(L.texts[`${i}-${j}`] = event.target.value); draw(); } }))))))),
      h("div", { class: "row" }, button("more", "One more point", () => { L.points.push([0, 0]); L.at = L.points.length - 1; draw(); }), button("tags", "Find printed tags", findTags),
        h("a", { class: "button", href: "/tags.svg", target: "_blank", rel: "noopener" }, "Tags to print")),
      button("fit", known < 4 ? `${4 - known} more points` : unread >= 0 ? `Point ${unread + 1} is no number of centimetres` : `Keep the calibration of ${known} points`, calibrate, "big", { disabled: known < 4 || unread >= 0 }),
      button("no-calibration", "Leave it as it is", () => { L.calibrating = false; draw(); }, "plain"));
  }
  fill("camera", parts);
}

// --- begin ------------------------------------------------------------------------------------

document.addEventListener("DOMContentLoaded", () => {
  addEventListener("pointerdown", () => { heldUntil = performance.now() + HELD; }, true);
  for (const gone of ["pointerup", "pointercancel"]) addEventListener(gone, () => { heldUntil = performance.now() + 100; }, true);
  $("stop").addEventListener("click", () => verb("stop"));
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") { event.preventDefault(); verb("stop"); } });
  const begin = () => uv(xy((touchedGoal() || goalNow() || { goal: S.components.map((c) => [0.8, 0][c.axis]) }).goal));
  surface($("map"), { active: () => Boolean(touching()), get: () => onMap() && uv(xy(L.mark)), set: (u, v) => setMark([-v / 1000, -u / 1000]), begin, step: () => 10 });
  surface($("picture"), { active: () => Boolean(L.calibrating || (C && C.to_table && touching())), get: pixelOfMark, set: touchPixel, begin: () => [L.wide / 2, L.tall / 2], step: () => 10 });
  listen();
});
