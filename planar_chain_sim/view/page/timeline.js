// The time of a log: play, pause, scrub, speed, loop, single ticks, jumps from event to event; the window of the charts.

import {element} from './controls.js';
import {colors} from './theme.js';

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10, 50];
const THUMB = 8;          // px, half of the slider's thumb
const BEFORE = 0.7;       // share of the charts' window that is past
const ROWS = 450;         // of a window of the charts
const JUMP = 0.05;        // s; beyond that the trail does not go on from where it was
const CALM = 120;         // ms without a jump, after which the charts of the new place are asked for
const BAD = new Set(['divergence', 'stopped', 'dropped_time', 'rejected', 'controller_loss', 'command_timeout']);

export class Timeline {
  // send(what, values); charts; drawing, whose trails are asked for after a jump
  constructor({send, charts, drawing}) {
    Object.assign(this, {send, charts, drawing});
    this.active = false;
    this.time = 0;
    this.playing = false;
    this.logs = [];
    this.marks = [];         // [time, kind]
    this.asked = null;       // window that has been asked for
    this.slider = element('time');
    this.slider.oninput = () => this.seek(Number(this.slider.value));
    element('speed').replaceChildren(...SPEEDS.map((speed) => new Option(`${speed}×`, speed, speed === 1, speed === 1)));
    element('back').onclick = () => this.tick(-1);
    element('next').onclick = () => this.send('event', {time: this.time, forward: true});
    element('previous').onclick = () => this.send('event', {time: this.time, forward: false});
    new ResizeObserver(() => this.drawMarks()).observe(element('marks'));
  }

  // A source has come; `active`: it is a log.
  show(active) {
    this.active = active;
    for (const each of document.querySelectorAll('.log')) each.hidden = !active;
    element('timeline').hidden = !active;
    element('step').textContent = active ? '›' : 'Step';
    element('step').setAttribute('aria-label', active ? 'one tick forward' : 'one tick');
    element('reset').textContent = active ? 'Start' : 'Reset';
    this.marks = [];
    this.asked = null;
    if (!active) this.playing = false;
  }

  // What the program says of the logs: name, first and last time, s, step, s.
  tell(logs) {
    const before = this.logs[0];
    this.logs = logs;
    this.first = Math.min(...logs.map(({first}) => first));
    this.last = Math.max(...logs.map(({last}) => last));
    this.step = logs[0].step;
    Object.assign(this.slider, {min: this.first, max: this.last});
    if (before?.name !== logs[0].name) this.time = this.first;
    this.time = Math.min(this.last, Math.max(this.first, this.time));
    this.label();
  }

  pause() {
    if (!this.playing && this.time >= this.last) this.seek(this.first);
    this.playing = !this.playing;
    this.before = performance.now();
    this.label();
  }

  label() {
    element('pause').textContent = this.playing ? 'Pause' : 'Play';
    element('pause').classList.toggle('on', !this.playing);
    document.body.classList.toggle('paused', !this.playing);
    this.slider.value = this.time;
    this.slider.setAttribute('aria-valuetext', `${this.time.toFixed(3)} s`);
  }

  // Before each request for a frame: time goes on.
  turn() {
    if (!this.active || !this.logs.length) return;
    const now = performance.now();
    if (this.playing) {
      this.time += Math.min(0.25, (now - this.before) / 1000) * Number(element('speed').value);
      if (this.time >= this.last) {
        this.playing = element('loop').checked;
        this.time = this.playing ? this.first : this.last;
      }
      this.label();
    }
    this.before = now;
    this.window();
    if (!this.playing && now - (this.moved ?? 0) > CALM) this.askTrail();
  }

  seek(time) {
    this.moved = performance.now();
    if (Math.abs(time - this.time) > JUMP) this.drawing.forget();
    this.time = Math.min(this.last, Math.max(this.first, time));
    this.label();
  }

  stop() {
    if (this.playing) this.pause();
  }

  // To the next or the last tick.
  tick(by) {
    this.stop();
    this.seek((Math.floor(this.time / this.step + 1e-6) + by) * this.step);
  }

  // An event has been found, or there is none.
  found(event) {
    if (!event) return false;
    this.stop();
    this.seek(event.tick * this.step);
    return true;
  }

  faster(by) {
    const speed = element('speed');
    speed.selectedIndex = Math.min(SPEEDS.length - 1, Math.max(0, speed.selectedIndex + by));
  }

  add(events) {
    this.marks.push(...events.map(({tick, kind}) => [tick * this.step, kind]));
    this.drawMarks();
  }

  drawMarks() {
    const canvas = element('marks'), {clientWidth: width, clientHeight: height} = canvas, ratio = devicePixelRatio || 1;
    if (!width || !this.active) return;
    Object.assign(canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
    const pen = canvas.getContext('2d');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const [time, kind] of this.marks) {
      const x = THUMB + (width - 2 * THUMB) * (time - this.first) / (this.last - this.first || 1);
      pen.fillStyle = BAD.has(kind) ? colors.fault : kind === 'command' ? colors.line : colors.faint;
      pen.fillRect(Math.round(x), kind === 'command' ? height - 5 : height - 8, 1.5, 8);
    }
  }

  // Move the charts' window along and ask for what will be in it.
  window() {
    const {charts, first, last, time} = this, whole = !Number.isFinite(charts.span) || charts.span >= last - first;
    const span = whole ? last - first : charts.span;
    let begin = Math.min(Math.max(first, time - BEFORE * span), last - span);
    if (charts.held && charts.fixed) begin = charts.begin;
    const end = begin + span, {asked} = this;
    if (!asked || asked.span !== span || (begin < asked.begin && asked.begin > first) || (end > asked.end && asked.end < last)) {
      const wanted = {begin: Math.max(first, begin - span), end: Math.min(last, end + span), count: (whole ? 2 : 3) * ROWS};
      if (!this.waiting && performance.now() - (this.moved ?? 0) > CALM && this.send('series', wanted)) {
        this.waiting = true;
        this.asked = {...wanted, span};
      }
    }
    charts.fix(charts.fixed ?? [], begin, end);
    charts.point(time);
  }

  // The answer: see scene.py.
  series(numbers, revision) {
    this.waiting = false;
    if (numbers[1] !== revision) {
      this.asked = null;
      return;
    }
    const tables = [];
    let at = 3;
    const take = (count) => numbers.subarray(at, at += count);
    for (let arm = 0; arm < numbers[2]; arm++) {
      const [rows, columns, exact] = take(3);
      tables.push({columns, exact, time: take(rows), low: take(rows * columns), high: take(rows * columns)});
    }
    this.charts.fix(tables, this.charts.begin, this.charts.end);
  }

  // Ask for the trail up to the state that is drawn, once.
  askTrail() {
    const point = this.drawing.trailPoint(), {trailLength, arms} = this.drawing, time = arms?.[0].time;
    if (!point || !trailLength || time === undefined) return;
    const key = [time, point.body, ...point.point.map((each) => each.toFixed(6)), trailLength].join();
    if (key === this.trailed || this.waiting) return;
    if (this.send('trail', {...point, begin: Math.max(this.first, time - trailLength), end: time})) this.trailed = key;
  }

  trail(numbers, revision) {
    if (numbers[1] !== revision) return;
    let at = 3;
    const take = (count) => numbers.subarray(at, at += count);
    for (let arm = 0; arm < numbers[2]; arm++) {
      const [count] = take(1), [time, x, y] = [take(count), take(count), take(count)];
      this.drawing.setTrail(arm, Array.from(time, (each, k) => ({time: each, x: x[k], y: y[k]})));
    }
  }

  // The connection was lost: nothing that was asked for comes any more.
  forget() {
    this.waiting = false;
    this.asked = null;
    this.trailed = '';
  }
}
