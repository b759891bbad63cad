// Buttons, sliders and keys that change the run.

const REPEAT = 100;   // ms between two signs that a slider is still held

export class Controls {
  constructor(place, send) {
    Object.assign(this, {place, send});
    this.status = {can: [], values: {}};
    this.held = new Map();   // joint -> effort
    for (const name of ['step', 'reset']) element(name).onclick = () => send(name);
    element('pause').onclick = () => send('pause', {value: !this.status.paused});
    setInterval(() => {
      for (const [joint, value] of this.held) send('effort', {joint, value});
    }, REPEAT);
    for (const name of ['blur', 'pagehide']) window.addEventListener(name, () => this.letGo());
    document.addEventListener('keydown', (event) => this.key(event));
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || /INPUT|SELECT|TEXTAREA/.test(event.target.tagName)) return;
    const button = {' ': 'pause', p: 'pause', s: 'step', '.': 'step', r: 'reset', f: 'fit'}[event.key];
    if (!button || event.target.tagName === 'BUTTON' && event.key === ' ') return;
    event.preventDefault();
    if (!element(button).disabled) element(button).click();
  }

  show(scene) {
    this.letGo();
    this.efforts = scene[0].joints.map((joint) => this.effort(joint));
    this.settings = new Map();
    this.place.replaceChildren(heading('Efforts, sprung back when let go'), ...this.efforts.map(({row}) => row),
                               heading('Settings'),
                               this.setting('gravity', 'gravity, m/s²', {min: -30, max: 30, step: 0.01},
                                            (values) => values[1], (value, values) => [values[0], value]),
                               this.setting('real_time_factor', 'real-time factor', {min: 0.05, max: 4, step: 0.05}),
                               this.setting('damping', 'damping of all joints, times', {min: 0, max: 10, step: 0.1},
                                            () => 1, (value) => this.ownDamping.map((each) => each * value)),
                               this.setting('payload_mass', 'payload, kg', {min: 0, max: 10, step: 0.05}));
    this.tell(this.status);
  }

  effort(joint) {
    const row = line(joint.name), slider = document.createElement('input'), output = document.createElement('output');
    const zero = document.createElement('button');
    Object.assign(slider, {type: 'range', min: -joint.span, max: joint.span, step: joint.span / 200, value: 0});
    slider.setAttribute('aria-label', `effort of ${joint.name}`);
    slider.dataset.needs = zero.dataset.needs = 'effort';
    zero.textContent = '0';
    zero.setAttribute('aria-label', `no effort in ${joint.name}`);
    const hold = (value) => {
      this.held.set(joint.name, value);
      output.textContent = number(value);
      this.send('effort', {joint: joint.name, value});
    };
    const letGo = () => {
      if (!this.held.delete(joint.name)) return;
      slider.value = 0;
      output.textContent = '';
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
    row.append(slider, output, zero);
    return {row, letGo};
  }

  setting(name, text, limits, read = (value) => value, write = (value) => value) {
    const row = line(text), slider = document.createElement('input'), output = document.createElement('output');
    Object.assign(slider, {type: 'range', ...limits});
    slider.setAttribute('aria-label', text);
    slider.dataset.needs = name;
    slider.oninput = () => {
      output.textContent = number(Number(slider.value));
      this.send('set', {name, value: write(Number(slider.value), this.status.values[name])});
    };
    row.append(slider, output);
    if (name === 'damping') slider.value = 1;
    this.settings.set(name, {slider, output, read});
    return row;
  }

  tell(status) {
    this.status = status;
    for (const each of document.querySelectorAll('[data-needs]')) {
      each.disabled = !status.can.includes(each.dataset.needs) || each.dataset.needs === 'step' && !status.paused;
    }
    element('pause').textContent = status.paused ? 'Go on' : 'Pause';
    element('pause').classList.toggle('on', Boolean(status.paused));
    for (const [name, {slider, output, read}] of this.settings ?? []) {
      if (status.values[name] === undefined || document.activeElement === slider) continue;
      if (name === 'damping') {
        this.ownDamping ??= status.values.damping;
        continue;
      }
      slider.value = read(status.values[name]);
      output.textContent = number(read(status.values[name]));
    }
  }

  letGo() {
    for (const {letGo} of this.efforts ?? []) letGo();
  }
}

export function element(id) {
  return document.getElementById(id);
}

export function number(value) {
  return String(+value.toPrecision(4));
}

function line(text) {
  const row = document.createElement('div'), name = document.createElement('span');
  row.className = 'control';
  name.textContent = name.title = text;
  row.append(name);
  return row;
}

function heading(text) {
  const title = document.createElement('h2');
  title.textContent = text;
  return title;
}
