// Joints and settings: what they are, and what may be changed.

import {short} from './drawing.js';

const REPEAT = 100;   // ms between two signs that a slider is still held
const WHY = {
  chain: 'this is not offered here', log: 'the run in a log cannot be changed',
  live: 'this robot does not offer this', '': 'no arm is shown yet'};

export class Controls {
  // send(what, values); places: elements for joints and settings
  constructor({joints, settings, send}) {
    Object.assign(this, {joints, settings, send});
    this.status = {can: [], values: {}};
    this.source = '';
    this.held = new Map();   // joint -> effort
    this.rows = [];
    this.values = new Map();
    this.chosen = -1;
    setInterval(() => {
      for (const [joint, value] of this.held) send('effort', {joint, value});
    }, REPEAT);
    for (const name of ['blur', 'pagehide']) window.addEventListener(name, () => this.letGo());
  }

  show(scene, source) {
    this.letGo();
    this.source = source;
    const [arm] = scene, head = document.createElement('div'), keep = this.rows[this.chosen]?.name;
    head.className = 'head';
    head.append(heading('Joints'), ...['position', 'effort while held'].map((text) => {
      const name = document.createElement('span');
      name.textContent = text;
      return name;
    }));
    this.rows = arm.joints.map((joint) => this.effort(joint, arm.bodies[joint.body].color));
    this.joints.replaceChildren(head, ...this.rows.map(({row}) => row));
    this.chosen = this.rows.findIndex(({name}) => name === keep);
    this.ownDamping = null;
    this.values = new Map();
    this.settings.replaceChildren(
      heading('Settings'),
      this.setting('gravity', 'gravity, m/s²', {min: -20, max: 20, step: 0.01},
                   (values) => values[1], (value, values) => [values[0], value]),
      this.setting('real_time_factor', 'real-time factor', {min: 0.05, max: 4, step: 0.05}),
      this.setting('damping', 'damping, × initial', {min: 0, max: 10, step: 0.1},
                   (values) => this.dampingFactor(values), (value) => this.ownDamping.map((each) => each * value)),
      this.setting('payload_mass', 'payload, kg', {min: 0, max: 10, step: 0.05}));
    this.tell(this.status);
  }

  effort(joint, color) {
    const row = document.createElement('div'), name = document.createElement('span'), swatch = document.createElement('i');
    const value = document.createElement('span'), slider = document.createElement('input');
    const output = document.createElement('output'), zero = document.createElement('button');
    row.className = 'control';
    name.className = 'name';
    swatch.className = 'swatch';
    swatch.style.background = color;
    name.append(swatch, joint.name);
    name.title = joint.name;
    value.className = 'value';
    const unit = joint.kind === 'slide' ? 'N' : 'N m';
    Object.assign(slider, {type: 'range', min: -joint.span, max: joint.span, step: joint.span / 200, value: 0});
    slider.setAttribute('aria-label', `effort of ${joint.name}`);
    slider.dataset.needs = zero.dataset.needs = 'effort';
    slider.dataset.title = `effort of ${joint.name}, ${unit}: acts while held, up to ${short(joint.span)} ${unit}`;
    zero.textContent = '0';
    zero.dataset.title = `no effort in ${joint.name} while held`;
    zero.setAttribute('aria-label', `no effort in ${joint.name}`);
    const hold = (number) => {
      if (slider.disabled) return;
      this.held.set(joint.name, number);
      slider.value = number;
      this.send('effort', {joint: joint.name, value: number});
    };
    const letGo = () => {
      if (!this.held.delete(joint.name)) return;
      slider.value = 0;
      this.send('effort', {joint: joint.name, value: null});
    };
    slider.oninput = () => hold(Number(slider.value));
    for (const end of ['change', 'pointerup', 'pointercancel', 'keyup', 'blur']) slider.addEventListener(end, letGo);
    zero.addEventListener('pointerdown', () => hold(0));
    for (const end of ['pointerup', 'pointercancel', 'pointerleave', 'blur']) zero.addEventListener(end, letGo);
    zero.addEventListener('click', () => {
      hold(0);
      letGo();
    });
    row.addEventListener('pointerdown', () => this.choose(this.rows.findIndex((each) => each.row === row), false));
    row.append(name, value, slider, output, zero);
    return {name: joint.name, row, value, output, hold, letGo, span: joint.span, unit: joint.kind === 'slide' ? 'm' : 'rad',
            last: [NaN, NaN]};
  }

  setting(name, text, limits, read = (value) => value, write = (value) => value) {
    const row = document.createElement('div'), title = document.createElement('span');
    const slider = document.createElement('input'), output = document.createElement('output');
    row.className = 'control';
    title.className = 'name';
    title.textContent = title.title = text;
    Object.assign(slider, {type: 'range', ...limits});
    slider.setAttribute('aria-label', text);
    slider.dataset.needs = name;
    slider.dataset.title = text;
    slider.oninput = () => {
      if (this.status.values[name] === undefined) return;
      output.textContent = short(Number(slider.value));
      this.send('set', {name, value: write(Number(slider.value), this.status.values[name])});
    };
    row.append(title, slider, output);
    this.values.set(name, {row, slider, output, read});
    return row;
  }

  // How many times its own damping a chain has; its own is that of the first value that was heard of it.
  dampingFactor(values) {
    if (!this.ownDamping || this.ownDamping.length !== values.length) this.ownDamping = values;
    const k = this.ownDamping.findIndex((each) => each > 0);
    return k < 0 ? 1 : values[k] / this.ownDamping[k];
  }

  // What can be done now; what cannot is grey and says why.
  tell(status) {
    this.status = status;
    for (const each of document.querySelectorAll('[data-needs]')) {
      const {needs} = each.dataset, can = status.can.includes(needs), wait = needs === 'step' && !status.paused;
      each.dataset.title ??= each.title;
      each.disabled = !can || wait;
      each.title = !can ? WHY[this.source] : wait ? 'one tick can be made only while paused' : each.dataset.title;
    }
    if (!status.can.includes('effort')) this.held.clear();
    for (const [name, {row, slider, output, read}] of this.values) {
      const known = status.values[name];
      row.classList.toggle('unknown', known === undefined);
      row.title = known === undefined ? slider.title : '';
      if (known === undefined) output.textContent = '–';
      if (known === undefined || document.activeElement === slider && slider.matches(':active')) continue;
      const value = read(known);
      if (name === 'damping' && !(this.ownDamping ?? []).some((each) => each > 0)) {
        Object.assign(slider, {disabled: true, title: 'no joint of this chain has damping'});
      }
      if (value > Number(slider.max)) slider.max = value;
      if (value < Number(slider.min)) slider.min = value;
      slider.value = value;
      output.textContent = short(value);
    }
  }

  // The numbers of the newest state.
  follow({position, effort}) {
    this.rows.forEach((row, k) => {
      const texts = [`${fixed(position[k])} ${row.unit}`, short(effort[k])];
      if (texts[0] !== row.last[0]) row.value.textContent = texts[0];
      if (texts[1] !== row.last[1]) row.output.textContent = texts[1];
      row.last = texts;
    });
  }

  // Choose a joint for the keys; by > 0: the next one, < 0: the one before.
  turn(by) {
    if (this.rows.length) this.choose((Math.max(this.chosen, by > 0 ? -1 : 0) + by + this.rows.length) % this.rows.length);
  }

  choose(index, scroll = true) {
    if (index !== this.chosen) this.rows[this.chosen]?.letGo();
    this.chosen = index;
    this.rows.forEach(({row}, k) => row.classList.toggle('chosen', k === index));
    if (scroll) this.rows[index]?.row.scrollIntoView({block: 'nearest'});
  }

  // A key that is held pushes harder and harder, up to the slider's end.
  push(way) {
    if (this.chosen < 0) this.turn(1);
    const row = this.rows[this.chosen];
    if (!row) return;
    const before = this.held.get(row.name) ?? 0;
    row.hold(way && Math.max(-1, Math.min(1, before / row.span + way * (before ? 0.025 : 0.1))) * row.span);
  }

  letGo() {
    for (const {letGo} of this.rows) letGo();
  }
}

export function element(id) {
  return document.getElementById(id);
}

// A number whose width does not change with its last digits.
export function fixed(value) {
  if (!Number.isFinite(value)) return '–';
  return (Math.abs(value) < 1e5 ? value.toFixed(3) : value.toExponential(2)).replace('-', '−');
}

function heading(text) {
  const title = document.createElement('h2');
  title.textContent = text;
  return title;
}
