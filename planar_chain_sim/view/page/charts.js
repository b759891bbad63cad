// Strip charts: position, velocity, effort, energy, real-time factor and lateness. Of a live run the last seconds, as
// they come; of a log a window of it, which the program has thinned to the least and the greatest value of each row.

import {roundStep, short} from './drawing.js';
import {colors} from './theme.js';

const FONT = '11px system-ui, sans-serif';
const MOST = 8192;        // rows that are kept
const LEFT = 46;          // px for the numbers
const FOOT = 15;          // px for the times, in one of the charts
const BUDGET = 5;         // ms for drawing charts in one frame
const PERIOD = 30;        // ms between two drawings of a chart
const TOLD = 8;           // values beside the mouse
const WIDE = {dashed: [5, 3], plain: []};

export class Charts {
  // at(time): the mouse was pressed at a time of a log
  constructor(place, legend, at) {
    Object.assign(this, {place, legend, at});
    this.span = 10;          // s
    this.held = false;
    this.hidden = new Set();   // joint names
    this.charts = [];
    this.mouse = null;       // {chart, x, y}
    this.turn = 0;
    this.clear();
  }

  // `past`: a log, of which nobody knows how late it was.
  show(scene, past) {
    const [arm] = scene, joints = arm.joints.map((joint, k) => ({
      name: joint.name, color: arm.bodies[joint.body].color, part: k,
      // the second joint of a body has its colour too
      dash: arm.joints.findIndex((other) => other.body === joint.body) < k ? WIDE.dashed : WIDE.plain}));
    const single = (name, color, dash = WIDE.plain) => ({name, color, dash});
    const n = joints.length, ink = () => colors.ink, accent = () => colors.accent;
    this.count = 3 * n + 5;
    const group = (title, lines, first, more = {}) => ({
      title, lines: lines.map((line, k) => ({...line, column: first + k})), low: 0, high: 1, ...more});
    this.charts = [
      group(`position, ${units(arm, 'rad', 'm')}`, joints, 0, {joints: true}),
      group(`velocity, ${units(arm, 'rad/s', 'm/s')}`, joints, n, {joints: true}),
      group(`effort, ${units(arm, 'N m', 'N')}`, joints, 2 * n, {joints: true}),
      group('energy, J', [single('kinetic', '#ce9729'), single('potential', '#326a99'),
                          single('sum', ink, WIDE.dashed)], 3 * n, {legend: true, foot: true}),
      ...past ? [] : [
        group('real-time factor', [single('factor', accent)], 3 * n + 3, {half: true, zero: true}),
        group('lateness, ms', [single('lateness', accent)], 3 * n + 4, {half: true, zero: true})],
    ];
    this.place.classList.toggle('past', past);
    this.columns = (state) => [...state.position, ...state.velocity, ...state.effort, state.kinetic, state.potential,
                               state.kinetic + state.potential, state.realTimeFactor, 1e3 * state.lateness];
    this.clear();
    this.place.replaceChildren(...this.charts.map((chart) => this.figure(chart)));
    this.showLegend(joints);
  }

  figure(chart) {
    const figure = document.createElement('figure'), caption = document.createElement('figcaption');
    const canvas = chart.canvas = document.createElement('canvas');
    figure.className = chart.half ? 'half' : '';
    caption.append(chart.title);
    if (chart.legend) caption.append(...chart.lines.map((line) => {
      const name = document.createElement('b');
      name.append(sample(line), line.name);
      return name;
    }));
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', `chart of ${chart.title}`);
    for (const name of ['pointermove', 'pointerdown']) {
      canvas.addEventListener(name, (event) => {
        this.mouse = {chart, x: event.offsetX, y: event.offsetY};
        if (this.fixed && (event.buttons & 1)) this.at(this.timeAt(event.offsetX, canvas.clientWidth));
        this.stale = true;
      });
    }
    canvas.addEventListener('pointerleave', () => {
      this.mouse = null;
      this.stale = true;
    });
    figure.append(caption, canvas);
    return figure;
  }

  // A chip for each joint: a click hides or shows it, with shift or twice it alone.
  showLegend(joints) {
    const chips = joints.map((joint) => {
      const chip = document.createElement('button');
      chip.append(sample(joint), joint.name);
      chip.title = `${joint.name}: click hides or shows it, double click shows it alone`;
      chip.onclick = ({shiftKey}) => shiftKey ? this.alone(joint.name) : this.toggle(joint.name);
      chip.ondblclick = () => this.alone(joint.name);
      return [joint.name, chip];
    });
    this.chips = new Map(chips);
    this.legend.replaceChildren(...this.chips.values());
    this.mark();
  }

  toggle(name) {
    if (!this.hidden.delete(name)) this.hidden.add(name);
    this.mark();
  }

  alone(name) {
    const others = [...this.chips.keys()].filter((other) => other !== name);
    const already = !this.hidden.has(name) && others.every((other) => this.hidden.has(other));
    this.hidden = new Set(already ? [] : others);
    this.mark();
  }

  mark() {
    for (const [name, chip] of this.chips) chip.setAttribute('aria-pressed', String(!this.hidden.has(name)));
    this.stale = true;
  }

  // Forget all rows.
  clear() {
    this.time = new Float64Array(MOST);
    this.values = new Float32Array(MOST * (this.count ?? 0));
    this.first = this.rows = 0;      // a ring
    this.fixed = null;               // of a log: [{time, low, high}, ...] of its arms
    this.now = NaN;
    this.stale = true;
  }

  // A state of a live run.
  add(state) {
    if (this.rows) {
      const last = this.time[(this.first + this.rows - 1) % MOST];
      if (state.time < last) this.clear();
      else if (state.time === last) return;
    }
    if (this.rows === MOST) {
      this.first = (this.first + 1) % MOST;
      this.rows -= 1;
    }
    const row = (this.first + this.rows) % MOST;
    this.time[row] = state.time;
    this.values.set(this.columns(state), row * this.count);
    this.rows += 1;
    if (!this.held) this.now = state.time;
    this.stale = true;
  }

  // The window [begin, end] of a log, s, with the rows of each of its arms; `now` is marked by a line.
  fix(fixed, begin, end) {
    Object.assign(this, {fixed, begin, end, stale: true});
  }

  point(time) {
    if (time !== this.now) Object.assign(this, {now: time, stale: true});
  }

  // Draw as many charts as there is time for; the others have their turn in the next frame.
  draw() {
    const begun = performance.now();
    if (this.stale && begun - (this.drawn ?? 0) >= PERIOD) {
      this.due = this.charts.length;
      this.stale = false;
      this.drawn = begun;
    }
    for (; this.due > 0 && performance.now() - begun < BUDGET; this.due -= 1) {
      this.chart(this.charts[this.turn = (this.turn + 1) % this.charts.length]);
    }
  }

  range() {
    return this.fixed ? [this.begin, this.end] : [this.now - this.span, this.now];
  }

  timeAt(x, width) {
    const [begin, end] = this.range();
    return begin + (end - begin) * Math.min(1, Math.max(0, (x - LEFT) / (width - LEFT - 6)));
  }

  // What is drawn: [{count, time(k), low(k, column), high(k, column)}, ...], each a table of rows.
  tables() {
    if (this.fixed) {
      return this.fixed.map(({time, low, high, columns}) => ({
        count: time.length, time: (k) => time[k], low: (k, c) => low[k * columns + c], high: (k, c) => high[k * columns + c],
        columns}));
    }
    const {first, time, values, count} = this, value = (k, c) => values[(first + k) % MOST * count + c];
    return [{count: this.rows, time: (k) => time[(first + k) % MOST], low: value, high: value, columns: count}];
  }

  chart(chart) {
    const {canvas} = chart, {clientWidth: width, clientHeight: height} = canvas, ratio = devicePixelRatio || 1;
    if (!width || !height) return;
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, {width: wide, height: high});
    const pen = canvas.getContext('2d'), [begin, end] = this.range();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const tables = this.tables().map((table) => ({...table, rows: within(table, begin, end)}));
    const lines = chart.lines.filter(({name}) => !chart.joints || !this.hidden.has(name));
    this.scale(chart, tables, lines);
    const x = (time) => LEFT + (width - LEFT - 6) * (time - begin) / (end - begin);
    const base = height - (chart.foot ? FOOT : 0);
    const y = (value) => base - 4 - (base - 9) * (value - chart.low) / (chart.high - chart.low);
    this.axes(pen, chart, x, y, width, base);
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, 0, width - LEFT, base);
    pen.clip();
    pen.lineJoin = 'round';
    tables.forEach((table, k) => {
      pen.globalAlpha = k ? 0.55 : 1;
      pen.lineWidth = (k ? 1 : 1.6) * (lines.length > 12 ? 0.75 : 1);
      for (const line of lines) {
        if (line.column >= table.columns) continue;
        pen.strokeStyle = typeof line.color === 'function' ? line.color() : line.color;
        pen.setLineDash(k ? [2, 3] : line.dash);
        curve(pen, table, line.column, x, y, ratio);
      }
    });
    pen.setLineDash([]);
    pen.globalAlpha = 1;
    if (this.fixed && this.now >= begin && this.now <= end) {
      pen.strokeStyle = colors.accent;
      pen.lineWidth = 1.5;
      vertical(pen, x(this.now), height);
    }
    pen.restore();
    if (this.mouse) this.tell(pen, chart, tables[0], lines, x, y, width, height);
  }

  // The range of values: it grows at once and shrinks slowly, so that the picture does not tremble.
  scale(chart, tables, lines) {
    let low = chart.zero ? 0 : Infinity, high = chart.zero ? 0 : -Infinity;
    for (const table of tables) {
      for (const {column} of lines) {
        if (column >= table.columns) continue;
        for (let k = table.rows[0]; k < table.rows[1]; k++) {
          const least = table.low(k, column), most = table.high(k, column);
          if (least < low) low = least;
          if (most > high) high = most;
        }
      }
    }
    if (!(low <= high)) [low, high] = [-1, 1];
    const size = Math.max(Math.abs(low), Math.abs(high)), flat = high - low <= 1e-6 * size;
    const room = flat ? 0.5 * size || 1 : 0.04 * (high - low);
    [low, high] = [chart.zero && low === 0 ? 0 : low - room, high + room];
    if (low < chart.low || high > chart.high || high - low < 0.7 * (chart.high - chart.low) || this.fixed) {
      Object.assign(chart, {low, high});
    }
  }

  axes(pen, chart, x, y, width, height) {
    const {low, high} = chart, step = roundStep((high - low) / Math.max(2, Math.floor(height / 24)));
    pen.strokeStyle = colors.grid;
    pen.fillStyle = colors.faint;
    pen.font = FONT;
    pen.textAlign = 'right';
    pen.lineWidth = 1;
    for (let k = Math.ceil(low / step); k * step <= high; k++) {
      const py = Math.round(y(k * step)) + 0.5;
      pen.beginPath();
      pen.moveTo(LEFT, py);
      pen.lineTo(width, py);
      pen.stroke();
      if (py > 6 && py < height - 2) pen.fillText(short(k * step, 4), LEFT - 5, py + 4);
    }
    const [begin, end] = this.range(), every = roundStep((end - begin) / Math.max(2, Math.floor(width / 90)));
    if (!(end > begin)) return;
    for (let k = Math.ceil(begin / every); k * every <= end; k++) {
      const px = Math.round(x(k * every)) + 0.5;
      vertical(pen, px, height);
      if (!chart.foot) continue;
      pen.textAlign = 'center';
      if (px > LEFT + 6 && px < width - 20) pen.fillText(short(k * every, 6), px, height + 11);
    }
    if (chart.foot) {
      pen.textAlign = 'right';
      pen.fillText('s', width, height + 11);
    }
  }

  // The values under the mouse; the line of the time is in all charts.
  tell(pen, chart, table, lines, x, y, width, height) {
    const time = this.timeAt(this.mouse.x, width);
    let row = nearest(table, time);
    if (row < 0) return;
    pen.strokeStyle = colors.faint;
    pen.lineWidth = 1;
    vertical(pen, Math.round(x(table.time(row))) + 0.5, height);
    if (this.mouse.chart !== chart) return;
    const told = lines.map((line) => ({line, low: table.low(row, line.column), high: table.high(row, line.column)}))
      .filter(({low}) => Number.isFinite(low))
      .map((each) => ({...each, away: Math.abs(y((each.low + each.high) / 2) - this.mouse.y)}))
      .sort((a, b) => a.away - b.away).slice(0, Math.min(TOLD, Math.floor((height - 4) / 13) - 1))
      .sort((a, b) => b.high - a.high);
    const texts = [[`${table.time(row).toFixed(3)} s`, null], ...told.map(({line, low, high}) => [
      `${line.name.length > 22 ? `${line.name.slice(0, 21)}…` : line.name}  ${short(low, 5)}${
        high - low > 1e-6 * Math.max(1, Math.abs(high)) ? ` … ${short(high, 5)}` : ''}`, line])];
    pen.font = FONT;
    const wide = Math.max(...texts.map(([text]) => pen.measureText(text).width)) + 26, tall = 13 * texts.length + 5;
    const px = this.mouse.x + wide + 16 < width ? this.mouse.x + 12 : Math.max(0, this.mouse.x - wide - 12);
    pen.globalAlpha = 0.94;
    pen.fillStyle = colors.panel;
    pen.fillRect(px, 1, wide, tall);
    pen.globalAlpha = 1;
    pen.strokeStyle = colors.line;
    pen.strokeRect(px + 0.5, 1.5, wide - 1, tall - 1);
    pen.textAlign = 'left';
    texts.forEach(([text, line], k) => {
      if (line) {
        pen.fillStyle = typeof line.color === 'function' ? line.color() : line.color;
        pen.fillRect(px + 6, 13 * k + 6, 9, 7);
      }
      pen.fillStyle = line ? colors.ink : colors.faint;
      pen.fillText(text, px + (line ? 20 : 6), 13 * k + 13);
    });
  }
}

// One line: where several rows fall on one column of pixels, the least and the greatest of them.
function curve(pen, {rows: [first, last], time, low, high}, column, x, y, ratio) {
  pen.beginPath();
  let at = NaN, least = 0, most = 0, end = 0, open = false;
  const finish = () => {
    if (!Number.isNaN(at) && most > least) {
      pen.lineTo(at, y(least));
      pen.lineTo(at, y(most));
      pen.lineTo(at, y(end));
    }
  };
  for (let k = first; k < last; k++) {
    const below = low(k, column), above = high(k, column);
    if (Number.isNaN(below)) {
      finish();
      [at, open] = [NaN, false];
      continue;
    }
    const px = Math.round(x(time(k)) * ratio) / ratio;
    if (px !== at) {
      finish();
      [at, least, most] = [px, below, above];
      if (open) pen.lineTo(px, y(below));
      else pen.moveTo(px, y(below));
      open = true;
    } else {
      if (below < least) least = below;
      if (above > most) most = above;
    }
    end = above;
  }
  finish();
  pen.stroke();
}

// The rows [first, last) of a window and one more on each side, so that lines reach the edges.
function within(table, begin, end) {
  return [Math.max(0, lowest(table, begin) - 1), Math.min(table.count, lowest(table, end) + 1)];
}

// The first row at a time or later.
function lowest({count, time}, wanted) {
  let low = 0, high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time(middle) < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

function nearest(table, wanted) {
  if (!table?.count) return -1;
  const after = Math.min(lowest(table, wanted), table.count - 1);
  return after && wanted - table.time(after - 1) < table.time(after) - wanted ? after - 1 : after;
}

function vertical(pen, x, height) {
  pen.beginPath();
  pen.moveTo(x, 0);
  pen.lineTo(x, height);
  pen.stroke();
}

// A short line as it is in the charts.
function sample({color, dash}) {
  const name = 'http://www.w3.org/2000/svg', svg = document.createElementNS(name, 'svg');
  const line = document.createElementNS(name, 'line');
  svg.setAttribute('viewBox', '0 0 18 6');
  svg.setAttribute('aria-hidden', 'true');
  for (const [key, value] of Object.entries({x1: 1, y1: 3, x2: 17, y2: 3, 'stroke-width': 3,
                                             stroke: typeof color === 'function' ? 'currentColor' : color,
                                             'stroke-dasharray': dash.join(' ')})) line.setAttribute(key, value);
  svg.append(line);
  return svg;
}

function units(arm, turning, sliding) {
  const kinds = new Set(arm.joints.map(({kind}) => kind));
  return kinds.size > 1 ? `${turning} or ${sliding}` : kinds.has('slide') ? sliding : turning;
}
