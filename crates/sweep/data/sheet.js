"use strict";
const sheet = JSON.parse(document.getElementById("sheet").textContent);
const element = (id) => document.getElementById(id);
const items = sheet.items.map(([n, status, place, values, metrics, reason]) => ({ n, status, place, values, metrics, reason }));
const PAGE = 120;
// Apart for all eyes: those of the charts of reports.
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333", "#773300", "#3300bb"];

// A value as the plan has it.
const words = (value) => {
  if (value === null) return "None";
  if (Array.isArray(value)) return "[" + value.map(words).join(", ") + "]";
  if (typeof value !== "object") return String(value);
  const entries = Object.entries(value);
  if (entries.length === 1 && /^\p{Lu}/u.test(entries[0][0])) {
    const inner = words(entries[0][1]);
    return entries[0][0] + (inner.startsWith("(") ? inner : "(" + inner + ")");
  }
  return "(" + entries.map(([key, own]) => key + ": " + words(own)).join(", ") + ")";
};
const short = (number) => String(Number(number.toPrecision(4)));

// What can be chosen: keys that are varied, then metrics.
const columns = [
  ...sheet.keys.map((name, i) => ({ name, of: (item) => item.values[i] })),
  ...sheet.metrics.map((name, i) => ({ name, of: (item) => item.metrics[i] ?? undefined })),
];
const varies = (column) => {
  let first;
  for (const item of items) {
    const value = column.of(item);
    if (value === undefined || value === first) continue;
    if (first !== undefined && words(value) !== words(first)) return true;
    first = value;
  }
  return false;
};
const fill = (id, options, chosen) => {
  element(id).replaceChildren(...options.map(([value, text]) => {
    const option = document.createElement("option");
    [option.value, option.textContent, option.selected] = [value, text, value === chosen];
    return option;
  }));
};
const named = (list) => list.map((column) => [column.name, column.name]);
const keyColumns = columns.slice(0, sheet.keys.length);
const metricColumns = columns.slice(sheet.keys.length);
const moving = metricColumns.filter(varies);
const still = metricColumns.filter((column) => !moving.includes(column));
const movingKeys = keyColumns.filter(varies);
const firstKey = (movingKeys[0] ?? keyColumns[0]).name;
fill("y", named([...moving, ...still]), (moving.find((column) => column.name.startsWith("mean_raw")) ?? moving.find((column) => column.name !== "exposure_time_s") ?? moving[0])?.name);
fill("x", named([...movingKeys, ...keyColumns.filter((column) => !movingKeys.includes(column)), ...moving]), firstKey);
fill("color", [["", "–"], ...named(keyColumns)], movingKeys[1]?.name ?? "");
fill("order", [["", "plan"], ...named(columns)], "");
fill("status", [["", "all"], ["done", "done"], ["refused", "refused"], ["missing", "missing"]], "");
const column = (id) => columns.find((own) => own.name === element(id).value);

// An axis with about so many ticks: numbers in proportion or by logarithms, else each word a place of its own.
const axis = (values, first, last, wantsLog, nTicks) => {
  const isNumeric = values.every((value) => typeof value === "number");
  if (!isNumeric) {
    const names = [...new Set(values.map(words))];
    const places = new Map(names.map((name, i) => [name, first + (last - first) * (i + 0.5) / names.length]));
    const every = Math.ceil(names.length / (2 * nTicks));
    return { at: (value) => places.get(words(value)), ticks: names.filter((_, i) => i % every === 0).map((name) => [places.get(name), name]) };
  }
  let least = Infinity, most = -Infinity;
  for (const value of values) { least = Math.min(least, value); most = Math.max(most, value); }
  if (wantsLog && least > 0 && most > least) {
    const [a, b] = [Math.log10(least), Math.log10(most)];
    const pad = 0.04 * (b - a);
    const at = (value) => first + (last - first) * (Math.log10(value) - a + pad) / (b - a + 2 * pad);
    const ticks = [];
    for (let decade = Math.floor(a); decade <= Math.ceil(b); decade++) {
      for (const digit of b - a > nTicks / 3 ? [1] : b - a > nTicks / 9 ? [1, 2, 5] : [1, 2, 3, 4, 5, 6, 7, 8, 9]) {
        const value = digit * 10 ** decade;
        if (value >= 10 ** (a - pad) && value <= 10 ** (b + pad)) ticks.push([at(value), short(value)]);
      }
    }
    return { at, ticks };
  }
  const pad = most > least ? 0.04 * (most - least) : Math.abs(most) * 0.5 || 1;
  [least, most] = [least - pad, most + pad];
  const at = (value) => first + (last - first) * (value - least) / (most - least);
  const raw = (most - least) / nTicks, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((own) => own >= raw);
  const ticks = [];
  for (let i = Math.ceil(least / step); i * step <= most; i++) ticks.push([at(i * step), short(i * step)]);
  return { at, ticks };
};

const svg = (name, attributes, text) => {
  const own = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) own.setAttribute(key, value);
  if (text !== undefined) own.textContent = text;
  return own;
};

const plot = () => {
  const [x, y, color] = [column("x"), column("y"), column("color")];
  element("plot").replaceChildren();
  if (!x || !y) return;
  const shown = items.filter((item) => x.of(item) !== undefined && typeof y.of(item) === "number");
  if (shown.length === 0) return;
  // One unit is a pixel of the page, so that words are as large as elsewhere in windows of any width.
  const width = Math.max(280, Math.min(1100, element("plot").clientWidth || 1100));
  const isNarrow = width < 620;
  const [left, top, bottom] = [isNarrow ? 64 : 90, 14, 52];
  const places = new Map(), colors = new Map();
  const groups = [];
  for (const item of color ? shown : []) {
    const group = words(color.of(item));
    if (!places.has(group)) places.set(group, groups.push(group) - 1);
    colors.set(item, group);
  }
  // The key: beside the plot, below it in narrow windows.
  const every = Math.ceil(groups.length / 20);
  const key = groups.filter((_, i) => i % every === 0);
  const right = key.length && !isNarrow ? 200 : 20;
  const keyHeight = key.length && isNarrow ? 18 * key.length + 8 : 0;
  const height = (isNarrow ? 280 : 420) + keyHeight, floor = height - keyHeight - bottom;
  const isLog = element("log").checked;
  const across = axis(shown.map(x.of), left, width - right, isLog, isNarrow ? 4 : 9);
  const up = axis(shown.map(y.of), floor, top, isLog, 6);
  const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${y.name} against ${x.name}${color ? `, colored by ${color.name}` : ""}: ${shown.length} items` });
  for (const [place, text] of across.ticks) {
    drawing.append(svg("line", { x1: place, x2: place, y1: top, y2: floor, stroke: "#e2e5ea" }));
    drawing.append(svg("text", { x: place, y: floor + 18, "text-anchor": "middle", fill: "#1d2330" }, text));
  }
  for (const [place, text] of up.ticks) {
    drawing.append(svg("line", { x1: left, x2: width - right, y1: place, y2: place, stroke: "#e2e5ea" }));
    drawing.append(svg("text", { x: left - 8, y: place + 4, "text-anchor": "end", fill: "#1d2330" }, text));
  }
  drawing.append(svg("rect", { x: left, y: top, width: width - right - left, height: floor - top, fill: "none", stroke: "#6b7280" }));
  drawing.append(svg("text", { x: (left + width - right) / 2, y: floor + bottom - 10, "text-anchor": "middle", fill: "#1d2330" }, x.name));
  const middle = (top + floor) / 2;
  drawing.append(svg("text", { x: 16, y: middle, "text-anchor": "middle", fill: "#1d2330", transform: `rotate(-90 16 ${middle})` }, y.name));
  const shade = (item) => {
    if (!color) return COLORS[0];
    const group = places.get(colors.get(item));
    if (groups.length <= COLORS.length) return COLORS[group];
    return `hsl(${250 - 250 * group / (groups.length - 1)} 65% 45%)`;
  };
  // One path a color, for a plan may have many thousand items; what is nearest to the pointer is searched for.
  const radius = shown.length > 1000 ? 2.5 : 4;
  const spots = shown.map((item) => [across.at(x.of(item)), up.at(y.of(item)), item]);
  const paths = new Map();
  for (const [cx, cy, item] of spots) {
    const color = shade(item);
    paths.set(color, (paths.get(color) ?? "") + `M${cx.toFixed(1)} ${cy.toFixed(1)}h0`);
  }
  const dots = svg("g", { fill: "none", "stroke-width": 2 * radius, "stroke-linecap": "round", "stroke-opacity": 0.75 });
  for (const [stroke, d] of paths) dots.append(svg("path", { d, stroke }));
  drawing.append(dots);
  const nearest = (event) => {
    const box = drawing.getBoundingClientRect(), scale = width / box.width;
    const [px, py] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    let found, least = 100;
    for (const [cx, cy, item] of spots) {
      const distance = (cx - px) ** 2 + (cy - py) ** 2;
      if (distance < least) [found, least] = [item, distance];
    }
    return found;
  };
  const tip = drawing.appendChild(svg("title", {}));
  drawing.addEventListener("mousemove", (event) => {
    const item = nearest(event);
    drawing.style.cursor = item ? "pointer" : "";
    tip.textContent = item ? [...caption(item), `${y.name}: ${short(y.of(item))}`].join("\n") : "";
  });
  drawing.addEventListener("click", (event) => {
    const item = nearest(event);
    if (item) choose(item);
  });
  key.forEach((group, row) => {
    const [across, place] = isNarrow ? [left, floor + bottom + 12 + 18 * row] : [width - right + 18, top + 12 + 18 * row];
    const one = shown.find((item) => colors.get(item) === group);
    drawing.append(svg("circle", { cx: across, cy: place - 4, r: 5, fill: shade(one) }));
    drawing.append(svg("text", { x: across + 12, y: place, fill: "#1d2330" }, group.length > 24 ? group.slice(0, 23) + "…" : group));
  });
  element("plot").append(drawing);
};

const caption = (item) => sheet.keys.map((key, i) => `${key}: ${typeof item.values[i] === "number" ? short(item.values[i]) : words(item.values[i])}`);
let listed = [], n_shown = 0;
const list = () => {
  const [order, status] = [column("order"), element("status").value];
  listed = items.filter((item) => !status || item.status === status);
  if (order) {
    const of = new Map(listed.map((item) => [item, order.of(item)]));
    const known = (item) => of.get(item) !== undefined;
    listed.sort((a, b) => {
      if (!known(a) || !known(b)) return known(b) - known(a) || a.n - b.n;
      const [v, w] = [of.get(a), of.get(b)];
      if (typeof v === "number" && typeof w === "number") return v - w || a.n - b.n;
      return words(v).localeCompare(words(w)) || a.n - b.n;
    });
  }
  n_shown = 0;
  element("pictures").replaceChildren();
  more();
};
const figure = (item) => {
  const own = document.createElement("figure");
  own.id = "item-" + item.n;
  const link = document.createElement("a");
  if (item.status === "done" && sheet.small) {
    link.href = item.place + "/" + sheet.large;
    const picture = document.createElement("img");
    [picture.loading, picture.alt, picture.src] = ["lazy", "item " + item.n, item.place + "/" + sheet.small];
    link.append(picture);
    link.addEventListener("click", (event) => {
      if (event.ctrlKey || event.metaKey || event.shiftKey) return;
      event.preventDefault();
      enlarge(item);
    });
  } else {
    const text = document.createElement("p");
    text.textContent = item.status === "refused" ? "refused: " + item.reason : item.status === "done" ? "no picture kept" : "missing";
    link.append(text);
  }
  const below = document.createElement("figcaption");
  const number = document.createElement("b");
  number.textContent = item.n;
  below.append(number);
  for (const line of caption(item)) below.append(document.createElement("br"), line);
  own.append(link, below);
  return own;
};
// A picture by itself: a click shows it as large as the window or pixel by pixel, the arrow keys go to the next.
const large = element("large");
let enlarged;
const enlarge = (item) => {
  enlarged = item;
  const picture = large.querySelector("img");
  [picture.src, picture.alt] = [item.place + "/" + sheet.large, "item " + item.n];
  large.querySelector("p").textContent = [item.n, ...caption(item)].join(" · ");
  if (!large.open) large.showModal();
};
const step = (by) => {
  const pictures = listed.filter((item) => item.status === "done");
  const next = pictures[pictures.indexOf(enlarged) + by];
  if (next) enlarge(next);
};
large.addEventListener("keydown", (event) => {
  const by = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
  if (by) { event.preventDefault(); step(by); }
});
large.addEventListener("click", (event) => {
  if (event.target === large) large.close();
  if (event.target.tagName === "IMG") large.classList.toggle("pixels");
});
const more = () => {
  const next = listed.slice(n_shown, n_shown + PAGE);
  element("pictures").append(...next.map(figure));
  n_shown += next.length;
  element("more").hidden = n_shown >= listed.length;
  element("shown").textContent = `${n_shown} of ${listed.length}`;
};
const choose = (item) => {
  if (!listed.includes(item)) { element("status").value = ""; list(); }
  while (n_shown <= listed.indexOf(item)) more();
  document.querySelectorAll("figure.chosen").forEach((own) => own.classList.remove("chosen"));
  const own = element("item-" + item.n);
  own.classList.add("chosen");
  own.scrollIntoView({ block: "center" });
};

for (const id of ["x", "y", "color", "log"]) element(id).addEventListener("change", plot);
for (const id of ["order", "status"]) element(id).addEventListener("change", list);
element("more").addEventListener("click", more);
let drawn = window.innerWidth;
window.addEventListener("resize", () => {
  if (window.innerWidth !== drawn) plot();
  drawn = window.innerWidth;
});
element("log").checked = (() => {
  const values = items.map(column("x").of).filter((value) => typeof value === "number" && value > 0);
  let least = Infinity, most = 0;
  for (const value of values) { least = Math.min(least, value); most = Math.max(most, value); }
  return values.length === items.length && most >= 20 * least;
})();
plot();
list();
