// What a page adds to its drawings where scripts run: values under the pointer, an enlarged view, downloads. A plot is an <svg> with
// data-x and data-y, the ranges of its axes; its lines are paths without a filling.
'use strict';
const make = (parent, tag, words = '', more = {}) => {
  const made = Object.assign(document.createElement(tag), { textContent: words }, more);
  parent.append(made);
  return made;
};
const number = value => String(+value.toPrecision(4));
// The value that lies at a share of an axis.
const value = (plot, axis, share) => {
  const [first, last] = plot.dataset[axis].split(' ').map(Number);
  return 'log' in plot.dataset ? first * (last / first) ** share : first + share * (last - first);
};
const values = (plot, { x, y }) =>
  [value(plot, 'x', x / plot.width.baseVal.value), value(plot, 'y', 1 - y / plot.height.baseVal.value)];
const lines = plot => [...plot.querySelectorAll('path[fill=none]')];
const points = line =>
  [...line.getAttribute('d').matchAll(/[ML]([-\d.]+) ([-\d.]+)/g)].map(([, x, y]) => ({ x: +x, y: +y }));
const outermost = svg => { while (svg.ownerSVGElement) svg = svg.ownerSVGElement; return svg; };

// Values under the pointer: those of the nearest point of a line, or else of the place itself.
const NEAR_PX = 12;
const tip = make(document.body, 'output', '', { id: 'tip', hidden: true });
const show = event => {
  const svg = event.target.closest?.('svg');
  tip.hidden = true;
  if (!svg) return;
  for (const plot of outermost(svg).querySelectorAll('svg[data-x]')) {
    // Of a child, for browsers differ in whether that of the plot counts its own place.
    const matrix = plot.firstElementChild.getScreenCTM();
    const here = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    const [width, height] = [plot.width.baseVal.value, plot.height.baseVal.value];
    if (here.x < 0 || here.y < 0 || here.x > width || here.y > height) continue;
    let nearest = { away: NEAR_PX / matrix.a, at: here, color: '' };
    for (const line of lines(plot)) {
      for (const at of points(line)) {
        const away = Math.hypot(at.x - here.x, at.y - here.y);
        if (away < nearest.away) nearest = { away, at, color: line.getAttribute('stroke') };
      }
    }
    const [x, y] = values(plot, nearest.at).map(number);
    tip.textContent = `${plot.dataset.xLabel}: ${x}\n${plot.dataset.yLabel}: ${y}`;
    tip.style.borderColor = nearest.color;
    tip.hidden = false;
    (svg.closest('dialog') ?? document.body).append(tip);
    const left = Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 4);
    const top = Math.min(event.clientY + 14, innerHeight - tip.offsetHeight - 4);
    tip.style.translate = `${Math.max(left, 0)}px ${Math.max(top, 0)}px`;
    return;
  }
};
for (const kind of ['pointermove', 'pointerdown']) document.addEventListener(kind, show);

// An enlarged view: the wheel and two fingers zoom, dragging moves, a double click shows all again. A narrow window begins with the left part, unshrunk.
const enlarge = drawn => {
  const dialog = make(document.body, 'dialog');
  const svg = drawn.cloneNode(true);
  const whole = drawn.getAttribute('viewBox').split(' ').map(Number);
  let view = [...whole];
  const set = next => svg.setAttribute('viewBox', (view = next).join(' '));
  svg.removeAttribute('width');
  svg.removeAttribute('height');
  dialog.append(svg);
  make(dialog, 'button', 'Close', { onclick: () => dialog.close() });
  dialog.onclose = () => { document.body.append(tip); dialog.remove(); };
  // Shows so many times as much, about a place that stays.
  const zoom = ({ clientX, clientY }, wanted) => {
    const factor = Math.min(wanted, whole[2] / view[2]);
    const at = new DOMPoint(clientX, clientY).matrixTransform(svg.getScreenCTM().inverse());
    set([at.x - factor * (at.x - view[0]), at.y - factor * (at.y - view[1]), factor * view[2], factor * view[3]]);
  };
  svg.onwheel = event => {
    event.preventDefault();
    zoom(event, 1.2 ** (event.deltaY / 100));
  };
  // The pointers that are down, where they were last.
  const down = new Map();
  const away = (one, other) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
  svg.onpointerdown = event => {
    svg.setPointerCapture(event.pointerId);
    down.set(event.pointerId, event);
  };
  svg.onpointerup = svg.onpointercancel = event => down.delete(event.pointerId);
  svg.onpointermove = event => {
    const before = down.get(event.pointerId);
    if (!before) return;
    down.set(event.pointerId, event);
    const other = [...down.values()].find(one => one.pointerId !== event.pointerId);
    if (other) return zoom(other, away(before, other) / Math.max(away(event, other), 1));
    const { a } = svg.getScreenCTM();
    set([view[0] - (event.clientX - before.clientX) / a, view[1] - (event.clientY - before.clientY) / a, view[2], view[3]]);
  };
  svg.ondblclick = () => set([...whole]);
  dialog.showModal();
  if (svg.clientWidth < whole[2]) set([whole[0], whole[1], svg.clientWidth, svg.clientHeight]);
};

// Downloads: the drawing, and its lines as a table: that which stands beside a chart, and of sheets what is drawn, to some ten-thousandths
// of an axis.
const save = (name, type, text) => {
  const link = Object.assign(document.createElement('a'), { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
const table = svg => {
  const quoted = words => `"${words.replaceAll('"', '""')}"`;
  const rows = ['plot,line,style,x,y'];
  for (const plot of svg.querySelectorAll('svg[data-x]')) {
    const { title, xLabel, yLabel } = plot.dataset;
    for (const line of lines(plot)) {
      const name = line.closest('[data-name]')?.dataset.name || line.getAttribute('stroke');
      const style = line.hasAttribute('stroke-dasharray') ? 'dashed' : 'solid';
      for (const at of points(line)) {
        const [x, y] = values(plot, at).map(value => +value.toPrecision(5));
        rows.push([quoted(`${title} (x: ${xLabel}; y: ${yLabel})`), quoted(name), style, x, y].join());
      }
    }
  }
  return rows.join('\n') + '\n';
};
for (const svg of document.querySelectorAll('section svg')) {
  if (svg.ownerSVGElement) continue;
  const name = (svg.querySelector('title')?.textContent || 'drawing').replace(/[^\p{L}\p{N}]+/gu, '_').slice(0, 60);
  const tools = make(document.createElement('div'), 'p', '', { className: 'tools' });
  svg.after(tools);
  make(tools, 'button', 'Enlarge', { onclick: () => enlarge(svg) });
  make(tools, 'button', 'SVG', { onclick: () => save(`${name}.svg`, 'image/svg+xml', svg.outerHTML) });
  const exact = svg.parentElement.querySelector('template')?.content.textContent;
  if (exact || [...svg.querySelectorAll('svg[data-x]')].some(plot => lines(plot).length)) {
    make(tools, 'button', 'CSV', { onclick: () => save(`${name}.csv`, 'text/csv', exact ?? table(svg)) });
  }
}
addEventListener('beforeprint', () => document.querySelectorAll('details').forEach(details => { details.open = true; }));
