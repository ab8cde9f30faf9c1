// The page: shows each state that comes, sends wishes. What the array does is decided elsewhere.
const $ = (id) => document.getElementById(id);
const QUANTITIES = {
  temperature_c: "temperature, degC", current_a: "current, A", voltage_v: "voltage, V", power_w: "power, W",
  duty: "duty", phase: "austenite, 0..1", sum_a: "sum of currents, A",
};
const COLOURS = ["#4477aa", "#ee6677", "#228833", "#b8a01c", "#66ccee", "#aa3377", "#999999", "#ee7733", "#44bb99"];
const WARM = [[27, 17, 68], [86, 20, 125], [165, 44, 96], [225, 86, 53], [251, 155, 6], [252, 255, 164]];
const LOW_C = 20, HIGH_C = 120;
// Every row for ten minutes, one a second for an hour: as the server keeps them. A trace is drawn with so many points at most.
const RECENT_S = 600, HISTORY_S = 3600, THINNED_EVERY = 1000, MOST_DRAWN = 1500;

let socket = null, state = {}, shape = "", wishes = 0, drawn = [], held = new Set();
let list = kept(), own = null, played = "null", rowAt = null;
const waiting = new Map();
const past = { time_s: [], each: {}, sum_a: [] };
const KEPT = [...Object.keys(QUANTITIES).filter((name) => name !== "sum_a"), "measured_c", "low_c", "high_c"];
const OLD_S = 1; // what is older, beyond the time between two rows, is shown as old

function wish(what, silent = false) {
  if (!socket || socket.readyState !== WebSocket.OPEN) {
    tell("not connected: nothing was sent", true);
    return Promise.reject(new Error("not connected"));
  }
  const id = ++wishes;
  socket.send(JSON.stringify({ ...what, id }));
  return new Promise((done, refused) => waiting.set(id, { done, refused, silent }));
}

function ask(what) {
  return wish(what).catch((error) => { tell(error.message, true); throw error; });
}
const quietly = (what) => ask(what).catch(() => {});

function tell(text, bad = false) {
  if (!text) return;
  const item = document.createElement("li");
  item.textContent = `${new Date().toLocaleTimeString()}  ${text}`;
  item.className = bad ? "bad" : "";
  $("log").prepend(item);
  while ($("log").childElementCount > 200) $("log").lastChild.remove();
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => {
    for (const one of waiting.values()) one.refused(new Error("the connection was lost"));
    waiting.clear();
    newest = null;
    badge($("connection"), "page not connected", "bad");
    trouble("This page has lost its server. It tries again.");
    setTimeout(connect, 1000);
  };
}

// States that come faster than this machine can show them are kept for the plots; the newest is shown.
let newest = null;

function takeState(now) {
  rowAt = now.age_s === undefined ? null : performance.now() - 1000 * now.age_s;
  if (now.time_s !== undefined && now.time_s !== past.time_s.at(-1)) append(now);
  if (!newest) {
    requestAnimationFrame(() => {
      const now = newest;
      newest = null;
      if (now) show(now);
    });
  }
  newest = now;
}

function take(message) {
  if (message.kind === "state") takeState(message);
  else if (message.kind === "history") remember(message);
  else if (message.kind === "settings") showSettings(message.settings);
  else {
    const one = waiting.get(message.id);
    waiting.delete(message.id);
    if (message.kind === "done") { if (!one?.silent) tell(message.said); one?.done(message.said); }
    else if (one) one.refused(new Error(message.why));
    else tell(message.why, true);
  }
}

// By this page's own clock: nothing has to come for it to be said that nothing comes.
function showAge() {
  const age_s = rowAt === null ? 0 : (performance.now() - rowAt) / 1000;
  const old = age_s > OLD_S + (state.every_s ?? 0);
  document.body.classList.toggle("old", old);
  const words = old ? `What is shown is ${age_s < 100 ? Math.floor(age_s) : `${Math.floor(age_s / 60)} min`}${age_s < 100 ? " s" : ""} old.` : "";
  if ($("old").textContent !== words) $("old").textContent = words;
  $("old").hidden = !old;
  if (old && state.connected && socket.readyState === WebSocket.OPEN) badge($("connection"), "silent", "bad");
}
setInterval(showAge, 250);

function badge(where, text, kind) {
  where.textContent = text;
  where.className = `badge ${kind}`;
}

function trouble(text) {
  $("trouble").textContent = text;
  $("trouble").hidden = !text;
}

const shown = (value, digits, none = "–") => (value === null || value === undefined ? none : value.toFixed(digits));

function colour(celsius) {
  const at = Math.min(Math.max((celsius - LOW_C) / (HIGH_C - LOW_C), 0), 1) * (WARM.length - 1);
  const k = Math.min(Math.floor(at), WARM.length - 2);
  return WARM[k].map((one, c) => Math.round(one + (at - k) * (WARM[k + 1][c] - one)));
}

function show(now) {
  const before = state;
  state = now;
  const live = now.source !== "replay";
  $("name").textContent = now.name ?? "";
  document.title = `${now.name ?? ""} - Ninespring`;
  for (const one of document.querySelectorAll(".live")) one.hidden = !live;
  $("stop").hidden = !live; // Escape pauses a replay
  document.querySelector(".replay").hidden = live;
  badge($("connection"), now.connected ? { board: "connected", simulated: "simulated", replay: "replay" }[now.source] : "no board",
    now.connected ? "good" : "bad");
  trouble(now.connected ? "" : `${now.trouble || "looking for the board"}${live ? " - it is looked for again and again" : ""}`);
  if (now.said && now.said !== before.said) tell(now.said);
  if (!now.springs) return;
  if (shape !== `${now.rows}x${now.cols}`) build(now.rows, now.cols);
  if (now.time_s === undefined) return;

  $("time").textContent = shown(now.time_s, 1);
  $("sum").textContent = shown(now.sum_a, 2);
  $("supply").textContent = now.supply_limit_a ? `of ${shown(now.supply_limit_a, 1)} A` : "";
  const known = now.temperature_c.map((one) => one ?? -999);
  const hottest = known.indexOf(Math.max(...known));
  const unknown_s = Math.max(0, ...(now.unknown_s ?? []));
  $("hottest").textContent = unknown_s ? "not known" : `${shown(now.temperature_c[hottest], 1)} degC (${hottest + 1})`;
  badge($("state"), now.state === "ok" && unknown_s ? "not known yet" : now.state_words ?? now.state, now.state === "ok" && !unknown_s ? "good" : "bad");
  $("unknown").hidden = !unknown_s;
  $("unknown-s").textContent = unknown_s ? `${unknown_s} s` : "";
  $("cold").disabled = now.level.some((one) => one > 0);
  $("unlock").hidden = now.state !== "locked";
  $("supply-on").hidden = !live || !now.faults.includes("supply: off");
  for (let k = 0; k < now.springs; k++) showSpring(k, now);
  $("bounds-legend").hidden = !now.bounds_c?.some((one) => one);
  if (String(now.faults) !== String(before.faults)) {
    $("faults").replaceChildren(...now.faults.map((one) => {
      const item = document.createElement("li");
      item.textContent = one;
      return item;
    }));
  }
  if (live) {
    if (!held.has("policy")) $("policy").value = now.policy;
    if (!held.has("fan")) $("fan").value = Math.round(now.fan * 100);
    $("fan-shown").textContent = `${held.has("fan") ? $("fan").value : Math.round(now.fan * 100)} %`;
    $("record").textContent = now.recording ? "End recording" : "Record";
    $("recording").textContent = now.recording ? `recording ${now.recording.file}: ${now.recording.rows} rows` : "";
    showPlay(now.play);
    why();
  } else {
    $("pause").textContent = now.playing ? "Pause" : "Play";
    if (!held.has("speed")) $("speed").value = now.speed;
    Object.assign($("seek"), { min: now.begins_s, max: now.ends_s });
    if (!held.has("seek")) $("seek").value = now.time_s;
  }
}

function build(rows, cols) {
  shape = `${rows}x${cols}`;
  const count = rows * cols;
  drawn = Array(count).fill(false);
  const array = $("array"), draw = $("draw");
  $("why-spring").replaceChildren(...drawn.map((_, k) => new Option(k + 1)));
  array.style.gridTemplateColumns = `repeat(${cols}, minmax(0, 1fr))`;
  draw.style.gridTemplateColumns = `repeat(${cols}, auto)`;
  array.replaceChildren();
  draw.replaceChildren();
  for (const one of described.splice(0)) one.remove();
  for (let k = 0; k < count; k++) {
    const spring = document.createElement("button");
    for (const name of ["number", "level", "temperature", "bounds", "measured", "amps", "limits", "phase"]) {
      const part = document.createElement("span");
      part.className = name;
      spring.append(part);
    }
    spring.querySelector(".number").textContent = k + 1;
    spring.setAttribute("aria-label", `spring ${k + 1}`); // one name for ever; what changes is its description
    spring.setAttribute("aria-describedby", `spring-${k + 1}`);
    const description = document.createElement("span");
    description.id = `spring-${k + 1}`;
    description.hidden = true;
    described.push(description);
    spring.onclick = () => quietly({ do: "level", spring: k + 1, level: state.level[k] > 0 ? 0 : Number($("level").value) });
    array.append(spring);
    $("array-card").append(description);
    const cell = document.createElement("button");
    cell.setAttribute("aria-pressed", "false");
    cell.setAttribute("aria-label", `spring ${k + 1}`);
    cell.onclick = () => { drawn[k] = !drawn[k]; cell.setAttribute("aria-pressed", drawn[k]); };
    draw.append(cell);
  }
}

// What a screen reader says of a spring, once in five seconds: ten times a second nobody could listen.
const described = [];
function describe() {
  if (state.time_s !== undefined) for (const [k, one] of described.entries()) {
    const on = state.level[k] > 0 ? `on at ${Math.round(state.level[k])} percent` : "off";
    const unknown_s = state.unknown_s?.[k];
    const words = `${on}, ${unknown_s > 0 ? `temperature not known for ${unknown_s} seconds` : `${shown(state.temperature_c[k], 0)} degC`}`
      + (state.limits[k].length ? `, ${state.limits[k].join(", ")}` : "") + (document.body.classList.contains("old") ? ", old" : "");
    if (one.textContent !== words) one.textContent = words;
  }
}
setInterval(describe, 5000);

function showSpring(k, now) {
  const spring = $("array").children[k], celsius = now.temperature_c[k], on = now.level[k] > 0;
  const unknown = now.unknown_s?.[k] > 0;
  const part = (name) => spring.querySelector(`.${name}`);
  const [red, green, blue] = celsius === null ? [120, 120, 120] : colour(celsius);
  spring.style.background = `rgb(${red} ${green} ${blue})`;
  spring.style.color = red * 0.3 + green * 0.59 + blue * 0.11 > 110 ? "#111" : "#fff";
  spring.classList.toggle("on", on);
  spring.classList.toggle("unknown", unknown);
  spring.setAttribute("aria-pressed", on);
  part("level").textContent = on ? `${Math.round(now.level[k])} %` : "";
  part("temperature").textContent = unknown ? "?" : `${shown(celsius, 1)}°`;
  const [low, high] = now.bounds_c?.[k] ?? [];
  part("bounds").textContent = low === undefined ? "" : `${shown(low, 0)}…${shown(high, 0)}°`;
  part("measured").textContent = now.measured_c[k] == null ? "" : `${shown(now.measured_c[k], 1)}°`;
  part("amps").textContent = now.doing?.[k]?.startsWith("waits") ? `waits ${now.unknown_s[k]} s` : `${shown(now.current_a[k], 2)} A`;
  part("limits").textContent = now.limits[k].join("; ");
  part("phase").style.width = `${100 * (now.phase?.[k] ?? 0)}%`;
  if (spring.matches(":hover")) spring.title = `spring ${k + 1}: ${unknown ? "not known" : `${shown(celsius, 2)} degC`}, ${shown(now.current_a[k], 3)} A`
    + (low === undefined ? "" : `; surely ${shown(low, 1)} to ${shown(high, 1)} degC (99 %)`)
    + (now.measured_c[k] != null ? `, measured ${shown(now.measured_c[k], 2)} degC` : "")
    + (now.phase?.[k] != null ? `, ${shown(100 * now.phase[k], 0)} % austenite` : "")
    + (now.target_a?.[k] != null ? `, target ${shown(now.target_a[k], 3)} A` : "")
    + (now.doing?.[k] ? `; ${now.doing[k]}` : "")
    + (now.limits[k].length ? `; limited (${shown(now.cut_a?.[k], 2)} A less): ${now.limits[k].join("; ")}` : "");
}

// plots

function remember(history) {
  past.time_s = history.time_s;
  past.each = {};
  for (const name of KEPT) past.each[name] = history[name] ?? [];
  past.sum_a = past.time_s.map((_, row) => past.each.current_a.reduce((sum, one) => sum + (one[row] ?? 0), 0));
}

let appended = 0;

function thin() {
  const end = past.time_s.at(-1);
  let last = -Infinity;
  const keep = past.time_s.map((one) => {
    const kept = end - one <= RECENT_S || (end - one <= HISTORY_S && one - last >= 1);
    if (kept) last = one;
    return kept;
  });
  const left = (values) => values.filter((_, row) => keep[row]);
  for (const name of KEPT) past.each[name] = (past.each[name] ?? []).map(left);
  past.sum_a = left(past.sum_a);
  past.time_s = left(past.time_s);
}

function append(now) {
  const last = past.time_s.at(-1);
  if (last !== undefined && (now.time_s < last || now.springs !== past.each.current_a.length)) {
    past.time_s = [];
    past.each = {};
    past.sum_a = [];
  }
  past.time_s.push(now.time_s);
  past.sum_a.push(now.sum_a);
  const values = { ...now, low_c: now.bounds_c?.map((one) => one?.[0]), high_c: now.bounds_c?.map((one) => one?.[1]) };
  for (const name of KEPT) {
    const each = (past.each[name] ??= []);
    for (let k = 0; k < now.springs; k++) (each[k] ??= []).push(values[name]?.[k] ?? null);
  }
  if (++appended % THINNED_EVERY === 0) thin();
}

function plot(number) {
  const name = document.querySelector(`[data-plot="${number}"]`).value;
  const end = past.time_s.at(-1) ?? 0, begin = Math.max(end - Number($("window").value), past.time_s[0] ?? 0);
  const from = past.time_s.findIndex((one) => one >= begin);
  const stride = Math.ceil((past.time_s.length - from) / MOST_DRAWN);
  const drawnOf = (values) => values.filter((_, row) => row >= from && (row - from) % stride === 0);
  const time = drawnOf(past.time_s), traces = [];
  const line = (y, k, more = {}) => traces.push({
    x: time, y: drawnOf(y), mode: "lines", name: k === null ? "sum" : `${k + 1}`, legendgroup: `${k}`,
    line: { width: 1.6, color: k === null ? COLOURS[0] : COLOURS[k % COLOURS.length], ...more.line }, showlegend: !more.line,
  });
  if (name === "sum_a") line(past.sum_a, null);
  else (past.each[name] ?? []).forEach((one, k) => line(one, k));
  if (name === "temperature_c") {
    (past.each.high_c ?? []).forEach((high, k) => {
      const low = past.each.low_c[k];
      if (!high.some((value) => value !== null)) return;
      const band = { x: time, mode: "lines", legendgroup: `${k}`, showlegend: false, hoverinfo: "skip", line: { width: 0 } };
      traces.unshift({ ...band, y: drawnOf(low) },
        { ...band, y: drawnOf(high), fill: "tonexty", fillcolor: `${COLOURS[k % COLOURS.length]}${past.each.high_c.length > 3 ? "0f" : "24"}` });
    });
    (past.each.measured_c ?? []).forEach((one, k) => one.some((value) => value !== null) && line(one, k, { line: { dash: "dot" } }));
  }
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink"), grid = style.getPropertyValue("--line");
  window.Plotly?.react($(`plot${number}`), traces, {
    margin: { l: 52, r: 8, t: 8, b: 34 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size: 12 },
    xaxis: { title: { text: "s" }, range: [begin, end], gridcolor: grid, zerolinecolor: grid },
    yaxis: { title: { text: QUANTITIES[name] }, gridcolor: grid, zerolinecolor: grid },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" }, uirevision: name,
  }, { displaylogo: false, responsive: true, displayModeBar: false });
}

// settings

function showSettings(settings) {
  const body = $("settings");
  const edited = new Set([...body.querySelectorAll("input.changed")].map((one) => one.name));
  for (const one of settings) {
    let row = body.querySelector(`tr[data-name="${one.name}"]`);
    if (!row) row = newSetting(one);
    const input = row.querySelector("input");
    input.dataset.value = one.value;
    if (!edited.has(one.name) && input.dataset.asked === undefined) input.value = one.value;
    if (input.dataset.asked === undefined) input.classList.toggle("changed", input.value.trim() !== one.value);
  }
}

function newSetting(one) {
  const row = $("settings").insertRow();
  row.dataset.name = one.name;
  const [name, value, unit, range, what] = [0, 1, 2, 3, 4].map(() => row.insertCell());
  name.textContent = one.name;
  unit.textContent = one.unit ?? "";
  range.textContent = one.low === undefined ? "" : `${one.low} .. ${one.high}`;
  what.textContent = one.what ?? "";
  const input = document.createElement("input");
  input.name = one.name;
  input.inputMode = "decimal";
  input.setAttribute("aria-label", one.name);
  const words = document.createElement("span");
  words.className = "words";
  words.setAttribute("role", "status");
  value.append(input, words);
  // What was asked for last stands for the board's value until the board has answered: what is typed meanwhile is not lost.
  const known = () => input.dataset.asked ?? input.dataset.value;
  input.oninput = () => input.classList.toggle("changed", input.value.trim() !== known());
  const set = () => {
    const wanted = input.value.trim();
    if (wanted === known()) { // Enter commits twice, as a key and as a change
      if (input.dataset.asked === undefined && input.hasAttribute("aria-invalid")) {
        words.textContent = ""; // what was refused is gone
        input.removeAttribute("aria-invalid");
      }
      return;
    }
    input.dataset.asked = wanted;
    wish({ do: "set", name: one.name, value: wanted })
      .then((said) => {
        words.textContent = said;
        input.removeAttribute("aria-invalid");
        if (input.value.trim() === wanted) input.classList.remove("changed");
      })
      .catch((error) => {
        words.textContent = error.message;
        input.setAttribute("aria-invalid", "true");
      })
      .finally(() => {
        if (input.dataset.asked === wanted) delete input.dataset.asked;
      });
  };
  input.onkeydown = (event) => {
    if (event.key === "Enter") set();
  };
  input.onchange = set;
  return row;
}

// wishes

const pattern = (make) => Array.from({ length: state.springs }, (_, k) => (make(Math.floor(k / state.cols), k % state.cols) ? "1" : "0")).join("");
const MAKE = {
  checker: () => pattern((r, c) => (r + c) % 2 === 0),
  ring: () => pattern((r, c) => r === 0 || c === 0 || r === state.rows - 1 || c === state.cols - 1),
};
const drawing = () => drawn.map((one) => (one ? "1" : "0")).join("");

function stop() {
  wish({ do: "stop" }).catch((error) => tell(error.message, true)); // what was done, the server says
}

// The list of patterns outlives a reload of the page; what is played is the board's, and all pages show it.
function kept() {
  try {
    const list = JSON.parse(localStorage.getItem("patterns") ?? "[]");
    return Array.isArray(list) ? list.filter((one) => /^[01]{1,64}$/.test(one)) : [];
  } catch { return []; }
}

// A list as a link: `#patterns=111101111,101000101&every=20`. It is shown, and not played: who opens it plays it.
function fromLink() {
  const link = new URLSearchParams(location.hash.slice(1));
  const linked = (link.get("patterns") ?? "").split(",").filter((one) => /^[01]{1,64}$/.test(one));
  if (!linked.length) return;
  const every = Number(link.get("every"));
  if (every >= 0.5 && every <= 3600) $("seconds").value = every;
  if (list.length && String(list) !== String(linked)) {
    own = list;
    $("own").hidden = false;
  }
  list = linked;
  showList();
  tell(`${linked.length} pattern${linked.length > 1 ? "s" : ""} from the link: Play plays them`);
}

function share() {
  history.replaceState(null, "", `#patterns=${list.join(",")}&every=${$("seconds").value}`);
  const link = location.href;
  const said = () => tell(`the list as a link: ${link}`);
  navigator.clipboard?.writeText(link).then(() => tell(`copied: ${link}`), said) ?? said();
}

function showPlay(play) {
  const now = JSON.stringify(play ?? null);
  if (now === played) return;
  const before = JSON.parse(played);
  played = now;
  if (play && String(play.patterns) !== String(before?.patterns)) {
    list = [...play.patterns];
    $("seconds").value = play.seconds;
  }
  $("end-play").hidden = !play;
  showList();
}

function showList() {
  if (!own) try { localStorage.setItem("patterns", JSON.stringify(list)); } catch { /* a page without storage forgets */ }
  const play = JSON.parse(played);
  $("list").replaceChildren(...list.map((one, at) => {
    const item = document.createElement("li"), remove = document.createElement("button");
    item.textContent = one;
    if (play && play.at === at && String(play.patterns) === String(list)) {
      item.className = "now";
      item.setAttribute("aria-current", "true");
    }
    remove.textContent = "remove";
    remove.setAttribute("aria-label", `remove pattern ${at + 1}`);
    remove.onclick = () => { list.splice(at, 1); showList(); };
    item.append(remove);
    return item;
  }));
  $("play").disabled = !list.length;
  $("share").disabled = !list.length;
}

$("stop").onclick = stop;
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") { event.preventDefault(); stop(); }
}, true);
for (const one of document.querySelectorAll("[data-all]")) {
  one.onclick = () => quietly({ do: "all", level: one.dataset.all === "on" ? Number($("level").value) : 0 });
}
for (const one of document.querySelectorAll("[data-make]")) one.onclick = () => quietly({ do: "pattern", springs: MAKE[one.dataset.make]() });
$("apply").onclick = () => quietly({ do: "pattern", springs: drawing() });
$("share").onclick = share;
$("own").onclick = () => {
  list = own;
  own = null;
  $("own").hidden = true;
  showList();
};
addEventListener("hashchange", fromLink);
$("add").onclick = () => { list.push(drawing()); showList(); };
$("play").onclick = () => quietly({ do: "play", patterns: list, seconds: Number($("seconds").value) });
$("end-play").onclick = () => quietly({ do: "end_play" });
$("cold").onclick = () => quietly({ do: "cold" });
$("level").oninput = () => { $("level-shown").textContent = `${$("level").value} %`; };
$("policy").onchange = () => quietly({ do: "policy", policy: $("policy").value });
$("fan").onchange = () => quietly({ do: "fan", percent: Number($("fan").value) });
$("record").onclick = () => quietly({ do: state.recording ? "end_recording" : "record" });
$("clear").onclick = () => quietly({ do: "clear" });
$("unlock").onclick = () => quietly({ do: "unlock" });
$("supply-on").onclick = () => quietly({ do: "say", line: "supply on" });
$("save").onclick = () => quietly({ do: "say", line: "$save" });
$("pause").onclick = () => quietly({ do: "pause" });
$("speed").onchange = () => quietly({ do: "speed", speed: Number($("speed").value) });
$("seek").onchange = () => quietly({ do: "seek", time_s: Number($("seek").value) });
for (const name of ["fan", "policy", "speed", "seek"]) {
  const one = $(name);
  for (const begin of ["pointerdown", "keydown", "input"]) one.addEventListener(begin, () => held.add(name));
  for (const end of ["change", "blur"]) one.addEventListener(end, () => setTimeout(() => held.delete(name), 500));
}
$("console").onsubmit = (event) => {
  event.preventDefault();
  const line = $("line").value.trim();
  if (!line) return;
  tell(`> ${line}`);
  ask({ do: "say", line }).then((said) => { if (!said) tell("ok"); }, () => {});
  $("line").value = "";
};
// The board's own words; asked for again with each new sight of that spring, and as how long ago they were grows.
const WHY_AGAIN_S = 10;
let told = "";
function why() {
  const k = Number($("why-spring").value), asked = `${k} ${state.sights?.[k - 1]} ${Math.floor(state.time_s / WHY_AGAIN_S)}`;
  if (!$("why-card").open || !k || asked === told) return;
  told = asked;
  wish({ do: "say", line: `why ${k}` }, true)
    .then((said) => { if (k === Number($("why-spring").value)) $("why").textContent = said; })
    .catch((error) => { $("why").textContent = error.message; });
}
$("why-spring").onchange = why;
$("why-card").ontoggle = () => { told = ""; why(); };
$("find").oninput = () => {
  for (const row of $("settings").rows) row.hidden = !row.textContent.toLowerCase().includes($("find").value.toLowerCase());
};
for (const [at, select] of document.querySelectorAll("[data-plot]").entries()) {
  for (const [value, text] of Object.entries(QUANTITIES)) select.add(new Option(text, value));
  select.value = at === 0 ? "temperature_c" : "current_a";
}
// Plots take a fifth of this machine's time at most: stop and the newest state go first.
function plots() {
  const begun = performance.now();
  if (!document.hidden) { plot(0); plot(1); }
  setTimeout(plots, Math.max(500, 4 * (performance.now() - begun)));
}
showList();
fromLink();
plots();
connect();
