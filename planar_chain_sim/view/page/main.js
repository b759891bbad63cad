// Puts the parts of the page together. `window.view` is for tests and the browser's console.

import {Camera} from './camera.js';
import {Charts} from './charts.js';
import {Connection} from './connection.js';
import {Controls, element} from './controls.js';
import {Drawing, trailChoices} from './drawing.js';
import {Events} from './events.js';
import {readFrame} from './frame.js';
import {Pointer} from './pointer.js';

const view = {scene: null, revision: -1, arms: null, status: null, source: '', frames: 0};
const camera = new Camera(), drawing = new Drawing(element('arm'), camera);
const charts = new Charts(element('charts')), events = new Events(element('event-list'));
const send = (what, values) => connection.send(what, values);
const controls = new Controls(element('controls'), send);
const pointer = new Pointer(element('arm'), camera, drawing, {
  send, arms: () => view.arms, scene: () => view.scene?.[0], can: () => Boolean(view.status?.can.includes('pull'))});
let complaint = 0;

const connection = new Connection({
  open(is) {
    if (!is) say('no connection to view: it has ended, or is starting again', true);
  },

  news({scene, revision, source, status, events: fresh, refused}) {
    if (scene) show(scene, revision, source);
    if (status) {
      view.status = status;
      say(status.sentence, status.fault);
      if (view.scene) controls.tell(status);
    }
    if (fresh) events.add(fresh);
    if (refused) {
      element('refused').textContent = refused;
      element('refused').hidden = false;
      clearTimeout(complaint);
      complaint = setTimeout(() => { element('refused').hidden = true; }, 6000);
    }
  },

  frame(numbers) {
    const arms = readFrame(numbers, view.scene, view.revision);
    if (!arms) return;
    view.arms = arms;
    view.frames += 1;
    pointer.follow();
    drawing.draw(view.scene, arms);
    charts.add(arms[0]);
    charts.draw();
    element('clock').textContent = `t = ${arms[0].time.toFixed(3)} s`;
  },
});

function show(scene, revision, source) {
  Object.assign(view, {scene, revision, source, arms: null});
  document.title = element('name').textContent = scene.map((arm) => arm.name).join(', ') || 'planar_chain_sim';
  if (!scene.length) return;
  drawing.show(scene);
  charts.show(scene);
  controls.show(scene);
  const choice = element('trail');
  choice.replaceChildren(...trailChoices(scene[0]).map(([value, text]) => {
    const option = document.createElement('option');
    Object.assign(option, {value, textContent: text});
    return option;
  }));
  choice.value = drawing.trailOf = drawing.trailOf || `${scene[0].bodies.length - 1}:end`;
}

function say(sentence, fault) {
  element('sentence').textContent = sentence;
  element('sentence').classList.toggle('fault', Boolean(fault));
}

element('fit').onclick = () => camera.fit(drawing.reach ?? 1);
element('trail').onchange = ({target}) => {
  drawing.trailOf = target.value;
  drawing.trails = drawing.trails.map(() => []);
};
window.view = Object.assign(view, {camera, drawing, charts, controls, pointer, connection});
