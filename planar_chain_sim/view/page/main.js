// Puts the parts of the page together. `window.view` is for tests and the browser's console.

import {Camera} from './camera.js';
import {Charts} from './charts.js';
import {Connection} from './connection.js';
import {Controls, element} from './controls.js';
import {Drawing, trailChoices} from './drawing.js';
import {Events} from './events.js';
import {readFrame} from './frame.js';
import {Keys} from './keys.js';
import {Pointer} from './pointer.js';
import {changeTheme, followTheme} from './theme.js';
import {Timeline} from './timeline.js';

const SPANS = [2, 5, 10, 30, 60, 120, Infinity], LENGTHS = [0, 1, 3, 10, 30, 100];   // s
const COMPLAINT = 6000;   // ms for which a mistake is shown

const view = {scene: null, revision: -1, arms: null, status: null, source: '', frames: 0};
const camera = new Camera(), drawing = new Drawing(element('arm'), camera);
const send = (what, values) => connection.send(what, values);
const charts = new Charts(element('strips'), element('legend'), (time) => {
  timeline.stop();
  timeline.seek(time);
});
const timeline = new Timeline({send, charts, drawing});
const events = new Events(element('event-list'), {timeOf, jump: (tick) => {
  if (timeline.active) timeline.found({tick});
}});
const controls = new Controls({joints: element('joints'), settings: element('settings'), send});
const pointer = new Pointer(element('arm'), camera, drawing, {
  send, arms: () => view.arms, scene: () => view.scene?.[0], can: () => Boolean(view.status?.can.includes('pull')),
  choose: chooseTrail, changed: () => drawing.again()});
const keys = new Keys({
  more: () => controls.push(1), less: () => controls.push(-1), zero: () => controls.push(0),
  before: () => controls.turn(-1), after: () => controls.turn(1),
  slower: () => timeline.faster(-1), faster: () => timeline.faster(1),
}, () => controls.letGo());
let complaint = 0, step = NaN, early = [];   // events that came before the first frame, which tells what a tick is

const connection = new Connection({
  wanted: () => timeline.active ? {time: timeline.time} : {},
  turn: () => timeline.turn(),

  state(word) {
    document.body.classList.toggle('lost', word !== 'open');
    if (word === 'open') {
      if (view.status) say(view.status.sentence, view.status.fault);
      return;
    }
    say(word === 'lost' ? 'no connection: view has ended or is starting again; trying to connect' :
      'view does not answer', true);
    controls.letGo();
    if (word === 'silent') return;
    // Another program may answer next time: forget all that this one said.
    Object.assign(view, {scene: null, revision: -1, arms: null, status: null});
    pointer.letGo();
    controls.tell({can: [], values: {}});
    events.clear();
    early = [];
    timeline.forget();
  },

  news({scene, revision, source, status, events: fresh, refused, found}) {
    if (scene) show(scene, revision, source);
    if (status) tell(status);
    if (fresh) hear(fresh);
    if (found !== undefined && !timeline.found(found)) complain('there is no other event in this direction');
    if (refused) {
      timeline.waiting = false;   // it may be the answer to a question
      complain(refused);
    }
  },

  series: (numbers) => timeline.series(numbers, view.revision),
  trail: (numbers) => timeline.trail(numbers, view.revision),

  frame(numbers) {
    const arms = readFrame(numbers, view.scene, view.revision);
    if (!arms) return charts.draw();
    const [arm] = arms;
    if (arm.tick > 0) step = arm.time / arm.tick;
    view.arms = arms;
    view.frames += 1;
    if (early.length) hear(early.splice(0));
    pointer.follow();
    drawing.draw(view.scene, arms);
    if (!timeline.active) charts.add(arm);
    charts.draw();
    controls.follow(arm);
    if (timeline.active) events.mark(arm.tick);
    element('clock').textContent = `t = ${arm.time.toFixed(3)} s${
      Number.isFinite(arm.realTimeFactor) ? `   ${arm.realTimeFactor.toFixed(2)}×` : ''}`;
  },
});

function show(scene, revision, source) {
  const other = !view.scene || String(scene[0]?.joints.map(({name}) => name)) !==
    String(view.scene[0]?.joints.map(({name}) => name));
  Object.assign(view, {scene, revision, source, arms: null});
  name(scene.map((arm) => arm.name));
  timeline.show(source === 'log');
  keys.show(source);
  if (!scene.length) return;
  drawing.show(scene);
  if (other || timeline.active) charts.show(scene, timeline.active);
  controls.show(scene, source);
  element('arm').setAttribute('aria-label', `drawing of ${scene[0].name}, ${scene[0].joints.length} joints`);
  element('trail').replaceChildren(...trailChoices(scene[0]).map(({body, point, text}) => new Option(text, `${body}:${point}`)),
                                   new Option('the clicked point', 'point'));
  showTrail();
}

function tell(status) {
  view.status = status;
  say(status.sentence, status.fault);
  document.body.classList.toggle('paused', Boolean(status.paused));
  if (status.log) {
    timeline.tell(status.log);
    name(status.log.map((log, k) => k ? `${log.name} (pale)` : log.name));
    step = status.log[0].step;
    controls.tell({...status, can: ['pause', 'step', 'reset'], paused: true});
    return;
  }
  element('pause').textContent = status.paused ? 'Go on' : 'Pause';
  element('pause').classList.toggle('on', Boolean(status.paused));
  if (view.scene?.length) controls.tell(status);
}

function hear(fresh) {
  if (!view.arms) {
    early.push(...fresh);
    return;
  }
  events.add(fresh);
  if (timeline.active) timeline.add(fresh);
  for (const {kind, data} of fresh.slice(-20)) if (kind === 'stop_touched') drawing.light(data.joint);
}

function name(names) {
  document.title = element('name').textContent = element('name').title = names.join(' + ') || 'planar_chain_sim';
}

function say(sentence, fault) {
  if (element('sentence').textContent !== sentence) element('sentence').textContent = sentence;
  document.body.classList.toggle('fault', Boolean(fault));
}

function complain(sentence) {
  element('refused').textContent = sentence;
  element('refused').hidden = false;
  clearTimeout(complaint);
  complaint = setTimeout(() => { element('refused').hidden = true; }, COMPLAINT);
}

function timeOf(tick) {
  return tick * step;
}

function chooseTrail(point) {
  drawing.trailOf = point;
  drawing.forget();
  showTrail();
  drawing.again();
}

function showTrail() {
  const {body, point} = drawing.trailOf ?? {};
  element('trail').value = Array.isArray(point) ? 'point' : `${body}:${point}`;
}

element('pause').onclick = () => timeline.active ? timeline.pause() : send('pause', {value: !view.status?.paused});
element('step').onclick = () => timeline.active ? timeline.tick(1) : send('step');
element('reset').onclick = () => timeline.active ? timeline.seek(timeline.first) : send('reset');
element('fit').onclick = () => {
  camera.fit(drawing.reach ?? 1);
  drawing.again();
};
element('closer').onclick = () => pointer.zoom(1.25);
element('farther').onclick = () => pointer.zoom(0.8);
element('theme').onclick = changeTheme;
element('hold').onclick = () => {
  charts.held = !charts.held;
  element('hold').setAttribute('aria-pressed', String(charts.held));
  element('hold').classList.toggle('on', charts.held);
};
element('names').onchange = ({target}) => {
  drawing.names = target.checked;
  drawing.again();
};
element('trail').onchange = ({target}) => {
  const [body, point] = target.value.split(':');
  if (point) chooseTrail({body: Number(body), point});
};
element('trail-length').replaceChildren(...LENGTHS.map((length) => new Option(length ? `${length} s` : 'no trail', length)));
element('trail-length').value = drawing.trailLength;
element('trail-length').onchange = ({target}) => {
  drawing.trailLength = Number(target.value);
  drawing.again();
};
element('span').replaceChildren(...SPANS.map((span) => new Option(Number.isFinite(span) ? `${span} s` : 'all', span)));
element('span').value = charts.span;
element('span').onchange = ({target}) => {
  charts.span = Number(target.value);
  charts.stale = true;
};
followTheme(() => {
  drawing.again();
  charts.stale = true;
  timeline.drawMarks();
});
window.view = Object.assign(view, {camera, drawing, charts, controls, pointer, connection, timeline});
