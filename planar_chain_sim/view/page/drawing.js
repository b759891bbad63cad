// Draws the arms on the canvas: grid, base, slides, stops, springs, bodies, mass centres, trails, wrenches, pulls.

import {colors} from './theme.js';

const FONT = '12px system-ui, sans-serif';
const MOST = 6000;       // points of a trail
const GAP = 0.5;         // s; a step of time longer than that is no motion
const GLOW = 400;        // ms for which a touched stop stays lit
const TOUCH = 1e-4;      // of max(1, |stop|): as near to it is on it
const GHOST = 0.45;      // opacity of the second arm

export class Drawing {
  constructor(canvas, camera) {
    Object.assign(this, {canvas, camera});
    this.pen = canvas.getContext('2d');
    this.trails = [];
    this.trailOf = null;     // {body, point: [x, y] in its frame, m}
    this.trailLength = 3;    // s
    this.pull = null;        // {body, from: [x, y], to: [x, y]} m
    this.hover = null;       // index of the body under the mouse
    this.names = false;
    this.touched = new Map();   // 'arm:joint:stop' -> when, ms
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.canvas, ratio = devicePixelRatio || 1;
    const {camera} = this, shrunk = Math.min(width, height) / Math.min(camera.width, camera.height);
    Object.assign(camera, {width, height});
    Object.assign(this.canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
    if (camera.touched) camera.scale *= shrunk || 1;
    else if (this.reach) camera.fit(this.reach);
    this.again();
  }

  // Draw what was drawn last.
  again() {
    if (this.scene && this.arms) this.draw(this.scene, this.arms);
  }

  // Other arms. The camera stays where it is unless they are of another size.
  show(scene) {
    const trailed = this.scene?.[0]?.bodies[this.trailOf?.body]?.name;
    if (!this.trailOf || scene[0].bodies[this.trailOf.body]?.name !== trailed) this.trailOf = endOf(scene[0]);
    this.scene = scene;
    this.arms = null;
    this.hover = null;
    this.touched.clear();
    this.forget();
    const reach = Math.max(...scene.map((arm) => arm.reach));
    if (reach !== this.reach) {
      this.reach = reach;
      this.camera.fit(reach);
    }
    this.many = Math.max(...scene.map((arm) => arm.bodies.length)) > 12;
  }

  // Begin the trails anew.
  forget() {
    this.trails = (this.scene ?? []).map(() => []);
  }

  draw(scene, arms) {
    this.arms = arms;
    const {pen, camera, canvas} = this, ratio = canvas.width / Math.max(camera.width, 1);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, camera.width, camera.height);
    pen.lineJoin = 'round';
    this.grid();
    this.base();
    arms.forEach((state, k) => this.trail(state, k));
    for (let k = arms.length - 1; k >= 0; k--) {   // the first one on top
      pen.globalAlpha = k ? GHOST : 1;
      this.width = (k ? 0.7 : 1) * (this.many ? 0.7 : 1) * Math.min(9, Math.max(3, 0.03 * this.reach * camera.scale));
      this.joints(scene[k], arms[k], k);
      this.bodies(scene[k], arms[k], k);
      this.wrenches(arms[k], k);
    }
    pen.globalAlpha = 1;
    if (this.names || this.hover !== null && !this.pull) this.labels(scene[0], arms[0]);
    if (this.pull) this.drawPull(arms[0]);
  }

  // Lines at round metres, numbered at the left and the lower edge.
  grid() {
    const {pen, camera} = this, step = roundStep(80 / camera.scale), {width, height} = camera;
    const [left, top] = camera.toPlane(0, 0), [right, bottom] = camera.toPlane(width, height);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    pen.font = FONT;
    pen.fillStyle = colors.faint;
    pen.lineWidth = 1;
    const lines = (first, last, place) => {
      for (let k = Math.ceil(first / step); k <= last / step; k++) {
        pen.strokeStyle = k ? colors.grid : colors.line;
        place(k * step, (k * step).toFixed(digits));
      }
    };
    pen.textAlign = 'center';
    lines(left, right, (x, text) => {
      const px = Math.round(camera.toPixel(x, 0)[0]) + 0.5;
      stroke(pen, [px, 0], [px, height]);
      if (px > 44 && px < width - 30) pen.fillText(text, px, height - 6);
    });
    pen.textAlign = 'left';
    lines(bottom, top, (y, text) => {
      const py = Math.round(camera.toPixel(0, y)[1]) + 0.5;
      stroke(pen, [0, py], [width, py]);
      if (py > 20 && py < height - 24) pen.fillText(text, 6, py + 4);
    });
    pen.fillText('m', 6, height - 6);
  }

  base() {
    const {pen, camera} = this, [x, y] = camera.toPixel(0, 0);
    pen.strokeStyle = pen.fillStyle = colors.faint;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x - 9, y + 14);
    pen.lineTo(x + 9, y + 14);
    pen.closePath();
    pen.stroke();
    pen.lineWidth = 1;
    for (let k = -12; k <= 8; k += 5) stroke(pen, [x + k + 4, y + 14], [x + k, y + 19]);
  }

  // The trail of the chosen point of each arm, which fades; a jump of time starts a new one.
  trail(state, k) {
    const trail = this.trails[k], body = state.bodies[this.trailOf?.body];
    if (!trail || !body) return;
    const [x, y] = inPlane(body, this.trailOf.point), last = trail[trail.length - 1];
    if (last && (state.time < last.time || state.time > last.time + Math.max(GAP, this.trailLength / 4))) trail.length = 0;
    if (!last || state.time !== last.time) trail.push({time: state.time, x, y});
    const begin = state.time - this.trailLength - 1e-9;
    let old = Math.max(0, trail.length - MOST);
    while (old < trail.length - 1 && trail[old].time < begin) old++;
    if (old > 0) trail.splice(0, old);
    if (!this.trailLength || trail.length < 2) return;
    const {pen} = this, parts = 8;
    pen.strokeStyle = this.scene[k].bodies[this.trailOf.body]?.color ?? colors.faint;
    pen.lineWidth = 2;
    pen.lineCap = 'round';
    for (let part = 0; part < parts; part++) {
      pen.globalAlpha = (k ? GHOST : 0.8) * (part + 1) / parts;
      pen.beginPath();
      const to = Math.ceil((part + 1) * trail.length / parts);
      for (let n = Math.max(0, Math.floor(part * trail.length / parts) - 1); n < to; n++) {
        pen.lineTo(...this.camera.toPixel(trail[n].x, trail[n].y));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
    pen.lineCap = 'butt';
    const [px, py] = this.camera.toPixel(x, y);
    dot(pen, px, py, 3.5, pen.strokeStyle);
  }

  // The point whose trail is drawn: name of its body, place in its frame; null if there is none.
  trailPoint() {
    const index = this.trailOf?.body, body = this.arms?.[0].bodies[index];
    if (!body) return null;
    const [px, py] = inPlane(body, this.trailOf.point), c = Math.cos(body.angle), s = Math.sin(body.angle);
    return {body: this.scene[0].bodies[index].name,
            point: [c * (px - body.x) + s * (py - body.y), c * (py - body.y) - s * (px - body.x)]};
  }

  // The trail of an arm up to the state that is drawn; one that comes too late is dropped.
  setTrail(k, trail) {
    if (!trail.length || Math.abs(trail[trail.length - 1].time - this.arms?.[k]?.time) > 1e-9) return;
    this.trails[k] = trail;
    this.again();
  }

  // A stop that is touched stays lit long enough to be seen.
  isLit(arm, joint, stop, q) {
    const key = `${arm}:${joint}:${stop}`, now = performance.now();
    if (Math.abs(q - stop) <= TOUCH * Math.max(1, Math.abs(stop))) this.touched.set(key, now);
    return now - (this.touched.get(key) ?? -Infinity) < GLOW;
  }

  // An event has said that a joint touched its stop, perhaps between two frames.
  light(name, near) {
    const joint = this.scene?.[0]?.joints.findIndex((each) => each.name === name) ?? -1;
    if (joint < 0 || !this.arms) return;
    const {lower, upper} = this.scene[0].joints[joint], q = this.arms[0].position[joint];
    const stop = upper === null || lower !== null && Math.abs(q - lower) < Math.abs(q - upper) ? lower : upper;
    this.touched.set(`0:${joint}:${stop}`, performance.now());
  }

  joints(arm, state, index) {
    arm.joints.forEach((joint, k) => {
      const pen = this.pen, lit = (stop) => this.isLit(index, k, stop, state.position[k]);
      pen.strokeStyle = colors.faint;
      pen.lineWidth = 1.5;
      if (joint.kind === 'slide') this.rail(arm, joint, state.zeros[k], state.bodies[joint.body], state.position[k], lit);
      else this.hinge(joint, state.zeros[k], state.bodies[joint.body], state.position[k], lit);
    });
  }

  rail(arm, joint, {x, y, angle}, body, q, lit) {
    const {pen, camera} = this, c = Math.cos(angle), s = Math.sin(angle);
    const along = (place) => [x + place * c, y + place * s];
    const low = joint.lower ?? Math.min(q, 0, joint.rest) - 0.12 * arm.reach;
    const high = joint.upper ?? Math.max(q, 0, joint.rest) + 0.12 * arm.reach;
    const [ax, ay] = camera.toPixel(...along(low)), [bx, by] = camera.toPixel(...along(high));
    const nx = 5 * s, ny = 5 * c;
    pen.strokeStyle = colors.faint;
    pen.lineWidth = 1;
    stroke(pen, [ax - nx, ay - ny], [bx - nx, by - ny]);
    stroke(pen, [ax + nx, ay + ny], [bx + nx, by + ny]);
    for (const stop of [joint.lower, joint.upper]) {
      if (stop === null) continue;
      const [px, py] = camera.toPixel(...along(stop)), on = lit(stop);
      pen.strokeStyle = on ? colors.fault : colors.faint;
      pen.lineWidth = on ? 5 : 3;
      stroke(pen, [px - 2 * nx, py - 2 * ny], [px + 2 * nx, py + 2 * ny]);
    }
    if (joint.stiffness) this.spring(along(Math.min(0, joint.rest, low)), along(q), colors.faint, 4);
    const [px, py] = camera.toPixel(body.x, body.y), long = 1.6 * this.width + 4, high2 = this.width + 4;
    pen.save();
    pen.translate(px, py);
    pen.rotate(-angle);
    pen.fillStyle = colors.panel;
    pen.strokeStyle = colors.faint;
    pen.lineWidth = 1.5;
    pen.fillRect(-long, -high2, 2 * long, 2 * high2);
    pen.strokeRect(-long, -high2, 2 * long, 2 * high2);
    pen.restore();
  }

  hinge(joint, {angle}, body, q, lit) {
    const {pen, camera} = this, [px, py] = camera.toPixel(body.x, body.y), turn = (at) => -(angle + joint.axis * at);
    const {x1, y1, x2, y2} = body.segments[0] ?? {}, long = 0.45 * Math.hypot(x2 - x1, y2 - y1) * camera.scale;
    const radius = Math.min(10 + 1.6 * this.width, Math.max(long || 0, this.width + 1)), tick = Math.min(5, 0.3 * radius);
    if (joint.lower !== null && joint.upper !== null && joint.upper - joint.lower < 2 * Math.PI) {
      pen.strokeStyle = colors.line;
      pen.beginPath();
      pen.arc(px, py, radius, turn(joint.lower), turn(joint.upper), joint.axis > 0);
      pen.stroke();
    }
    for (const stop of [joint.lower, joint.upper]) {
      if (stop === null) continue;
      const c = Math.cos(turn(stop)), s = Math.sin(turn(stop)), on = lit(stop);
      pen.strokeStyle = on ? colors.fault : colors.faint;
      pen.lineWidth = on ? tick : 0.5 * tick;
      stroke(pen, [px + (radius - tick) * c, py + (radius - tick) * s],
             [px + (radius + tick) * c, py + (radius + tick) * s]);
    }
    if (joint.stiffness && radius > 12) {   // a spiral from where it is slack to where the body is
      pen.strokeStyle = colors.faint;
      pen.lineWidth = 1.5;
      pen.beginPath();
      const begin = turn(joint.rest), end = turn(q) - 4 * Math.PI * joint.axis;
      for (let k = 0; k <= 60; k++) {
        const at = begin + (end - begin) * k / 60, r = this.width + (radius - this.width) * k / 90;
        pen.lineTo(px + r * Math.cos(at), py + r * Math.sin(at));
      }
      pen.stroke();
    }
  }

  bodies(arm, state, index) {
    const {pen, camera, width} = this;
    pen.lineCap = 'round';
    state.bodies.forEach((body, k) => {
      const on = !index && (k === this.hover || k === this.pull?.body);
      const paths = body.segments.map(({x1, y1, x2, y2}) => [camera.toPixel(x1, y1), camera.toPixel(x2, y2)]);
      pen.strokeStyle = on ? colors.ink : colors.paper;   // a rim keeps bodies apart where they cross
      pen.lineWidth = width + (this.many ? 1.5 : 3);
      for (const [from, to] of paths) stroke(pen, from, to);
      pen.strokeStyle = arm.bodies[k].color;
      pen.lineWidth = width;
      for (const [from, to] of paths) stroke(pen, from, to);
    });
    pen.lineCap = 'butt';
    state.bodies.forEach((body, k) => {
      const [px, py] = camera.toPixel(body.x, body.y), radius = 0.5 * width + (this.many ? 0 : 1);
      dot(pen, px, py, radius, colors.paper);
      pen.strokeStyle = arm.bodies[k].color;
      pen.lineWidth = Math.min(2, 0.4 * width);
      pen.beginPath();
      pen.arc(px, py, radius, 0, 2 * Math.PI);
      pen.stroke();
      this.massCenter(...camera.toPixel(body.cx, body.cy), this.many ? 0.4 * width + 1 : Math.min(6, 0.7 * width + 1));
    });
  }

  massCenter(x, y, radius) {
    const {pen} = this;
    dot(pen, x, y, radius, colors.paper);
    pen.fillStyle = pen.strokeStyle = colors.ink;
    for (const begin of [0, Math.PI]) {
      pen.beginPath();
      pen.moveTo(x, y);
      pen.arc(x, y, radius, begin, begin + Math.PI / 2);
      pen.fill();
    }
    pen.lineWidth = 1;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.stroke();
  }

  // Forces as arrows whose length grows with the logarithm, moments as arcs.
  wrenches(state, index) {
    const {pen, camera} = this;
    state.bodies.forEach((body, k) => {
      const size = Math.hypot(body.fx, body.fy), [px, py] = camera.toPixel(body.x, body.y);
      if (k === this.pull?.body) return;
      pen.strokeStyle = pen.fillStyle = colors.fault;
      pen.lineWidth = 2.5;
      if (size > 0) {
        const long = Math.min(140, 24 + 22 * Math.log1p(size)), ux = body.fx / size, uy = -body.fy / size;
        const [tx, ty] = [px + long * ux, py + long * uy];
        stroke(pen, [px, py], [tx, ty]);
        arrowHead(pen, tx, ty, ux, uy);
        if (!index) this.text(`${short(size)} N`, tx + 16 * ux, ty + 16 * uy + 4, colors.fault, 'center');
      }
      if (Math.abs(body.moment) > 0) {
        const way = Math.sign(body.moment), radius = 16 + this.width, end = -way * 1.5 * Math.PI;
        pen.beginPath();
        pen.arc(px, py, radius, 0, end, way > 0);
        pen.stroke();
        arrowHead(pen, px + radius * Math.cos(end), py + radius * Math.sin(end), way * Math.sin(end), -way * Math.cos(end));
        if (!index) this.text(`${short(body.moment)} N m`, px, py - radius - 8, colors.fault, 'center');
      }
    });
  }

  // The spring from the body to the mouse, and the force that acts.
  drawPull(state) {
    const {from, to, body} = this.pull, {fx, fy} = state.bodies[body] ?? {};
    this.spring(from, to, colors.fault, 6);
    const [px, py] = this.camera.toPixel(...to), size = Math.hypot(fx, fy);
    dot(this.pen, px, py, 4, colors.fault);
    if (size > 0) this.text(`${short(size)} N`, px + 12, py - 10, colors.fault, 'left');
  }

  spring(from, to, color, side) {
    const {pen, camera} = this, [ax, ay] = camera.toPixel(...from), [bx, by] = camera.toPixel(...to);
    const long = Math.hypot(bx - ax, by - ay) || 1, ux = (bx - ax) / long, uy = (by - ay) / long, turns = 12;
    pen.strokeStyle = color;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(ax, ay);
    for (let k = 1; k < turns; k++) {
      const out = side * (k % 2 ? 1 : -1), along = long * k / turns;
      pen.lineTo(ax + ux * along - uy * out, ay + uy * along + ux * out);
    }
    pen.lineTo(bx, by);
    pen.stroke();
  }

  labels(arm, state) {
    state.bodies.forEach((body, k) => {
      if (!this.names && k !== this.hover) return;
      const [px, py] = this.camera.toPixel(body.cx, body.cy);
      this.text(shortened(arm.bodies[k].name, 32), px + 11, py - 7, colors.ink, 'left');
    });
  }

  // A text that stays legible on lines, within the canvas.
  text(text, x, y, color, align) {
    const {pen, camera} = this;
    pen.font = FONT;
    const wide = pen.measureText(text).width, left = align === 'center' ? x - wide / 2 : x;
    const px = Math.max(4, Math.min(left, camera.width - wide - 4)), py = Math.max(14, Math.min(y, camera.height - 6));
    pen.textAlign = 'left';
    pen.lineWidth = 3.5;
    pen.strokeStyle = colors.paper;
    pen.strokeText(text, px, py);
    pen.fillStyle = color;
    pen.fillText(text, px, py);
  }
}

// The points whose trail can be chosen from the list: {body, what, name}.
export function trailChoices(arm) {
  return arm.bodies.flatMap(({name}, body) => [{body, point: 'end', text: `end of ${name}`},
                                               {body, point: 'center', text: `mass centre of ${name}`}]);
}

function endOf(arm) {
  return arm.bodies.length ? {body: arm.bodies.length - 1, point: 'end'} : null;
}

// A point of a body, 'end', 'center' or [x, y] in its frame, in the plane.
function inPlane(body, point) {
  if (point === 'center') return [body.cx, body.cy];
  if (point === 'end') {
    const end = body.segments[body.segments.length - 1];
    return end ? [end.x2, end.y2] : [body.cx, body.cy];
  }
  const c = Math.cos(body.angle), s = Math.sin(body.angle), [px, py] = point;
  return [body.x + c * px - s * py, body.y + s * px + c * py];
}

export function shortened(text, most) {
  return text.length > most ? `${text.slice(0, most - 1)}…` : text;
}

// A number in few digits, with a true minus.
export function short(value, digits = 3) {
  if (!Number.isFinite(value)) return '–';
  const text = Math.abs(value) >= 1e5 || value !== 0 && Math.abs(value) < 1e-3 ? value.toExponential(digits - 1) :
    String(+value.toPrecision(digits));
  return text.replace('-', '−');
}

function arrowHead(pen, x, y, ux, uy) {
  pen.beginPath();
  pen.moveTo(x + 9 * ux, y + 9 * uy);
  pen.lineTo(x - 5 * uy, y + 5 * ux);
  pen.lineTo(x + 5 * uy, y - 5 * ux);
  pen.fill();
}

function stroke(pen, from, to) {
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
}

function dot(pen, x, y, radius, color) {
  pen.fillStyle = color;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
}

// The next of 1, 2, 5, 10, ... that is not smaller.
export function roundStep(least) {
  const ten = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((step) => step * ten).find((step) => step >= least * (1 - 1e-9));
}
