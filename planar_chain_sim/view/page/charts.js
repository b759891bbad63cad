// Strip charts of the last seconds: positions, velocities, efforts, energy, real-time factor and lateness.

import {roundStep} from './drawing.js';

const SPAN = 10;       // s
const MOST = 1500;     // points

export class Charts {
  constructor(place) {
    this.place = place;
    this.rows = [];      // {time, values: [[...], ...]} by chart
  }

  show(scene) {
    this.rows = [];
    const arm = scene[0];
    const colors = arm.joints.map((joint) => arm.bodies[joint.body].color);
    this.charts = [
      {title: 'position, rad or m', lines: colors, pick: (state) => state.position},
      {title: 'velocity, rad/s or m/s', lines: colors, pick: (state) => state.velocity},
      {title: 'effort, N m or N', lines: colors, pick: (state) => state.effort},
      {title: 'energy, J: kinetic, potential, sum', lines: ['#d97314', '#448460', '#24292f'],
       pick: ({kinetic, potential}) => [kinetic, potential, kinetic + potential]},
      {title: 'real-time factor', lines: ['#0b6e99'], pick: (state) => [state.realTimeFactor]},
      {title: 'lateness, ms', lines: ['#0b6e99'], pick: (state) => [1e3 * state.lateness]},
    ];
    this.place.replaceChildren(...this.charts.map((chart) => {
      const figure = document.createElement('figure'), caption = document.createElement('figcaption');
      chart.canvas = document.createElement('canvas');
      caption.textContent = chart.title;
      figure.append(caption, chart.canvas);
      return figure;
    }));
  }

  add(state) {
    const last = this.rows[this.rows.length - 1];
    if (last && state.time < last.time) this.rows = [];
    if (last && state.time === last.time) return;
    this.rows.push({time: state.time, values: this.charts.map((chart) => Array.from(chart.pick(state)))});
    while (this.rows.length > MOST || this.rows[0].time < state.time - SPAN) this.rows.shift();
  }

  draw() {
    for (const [k, chart] of this.charts?.entries() ?? []) this.chart(chart, k);
  }

  chart({canvas, lines}, which) {
    const {clientWidth: width, clientHeight: height} = canvas, ratio = devicePixelRatio || 1;
    if (!width || !this.rows.length) return;
    if (canvas.width !== Math.round(width * ratio)) Object.assign(canvas, {width: Math.round(width * ratio),
                                                                           height: Math.round(height * ratio)});
    const pen = canvas.getContext('2d'), style = getComputedStyle(canvas);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    let low = Infinity, high = -Infinity;
    for (const {values} of this.rows) {
      for (const value of values[which]) {
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (!(low <= high)) return;
    if (high - low < 1e-9) [low, high] = [low - 1, high + 1];
    const end = this.rows[this.rows.length - 1].time, left = 44, step = roundStep((high - low) / 3);
    const x = (time) => left + (width - left - 4) * (1 + (time - end) / SPAN);
    const y = (value) => height - 4 - (height - 8) * (value - low) / (high - low);
    pen.strokeStyle = style.getPropertyValue('--line');
    pen.fillStyle = style.getPropertyValue('--faint');
    pen.font = '11px system-ui, sans-serif';
    pen.textAlign = 'right';
    pen.lineWidth = 1;
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
      pen.beginPath();
      pen.moveTo(left, y(value));
      pen.lineTo(width, y(value));
      pen.stroke();
      pen.fillText(+value.toPrecision(3), left - 4, y(value) + 4);
    }
    lines.forEach((color, line) => {
      pen.strokeStyle = color;
      pen.lineWidth = 1.5;
      pen.beginPath();
      for (const {time, values} of this.rows) if (!Number.isNaN(values[which][line])) pen.lineTo(x(time), y(values[which][line]));
      pen.stroke();
    });
  }
}
