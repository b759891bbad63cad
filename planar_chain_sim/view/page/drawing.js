// Draws the arms on the canvas: grid, base, slides, stops, springs, bodies, mass centres, trails, wrenches, pulls.

const TRAIL = 400;   // points

export class Drawing {
  constructor(canvas, camera) {
    Object.assign(this, {canvas, camera});
    this.pen = canvas.getContext('2d');
    this.trails = [];
    this.trailOf = '';     // 'body:part' of the point whose trail is drawn
    this.pull = null;      // {from: [x, y], to: [x, y]} m
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.canvas, ratio = devicePixelRatio || 1;
    Object.assign(this.camera, {width, height});
    Object.assign(this.canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
    if (!this.camera.touched && this.reach) this.camera.fit(this.reach);
    if (this.scene && this.arms) this.draw(this.scene, this.arms);
  }

  show(scene) {
    this.scene = scene;
    this.trails = scene.map(() => []);
    const reach = Math.max(...scene.map((arm) => arm.reach));
    if (reach !== this.reach) {
      this.reach = reach;
      this.camera.fit(reach);
    }
  }

  draw(scene, arms) {
    this.arms = arms;
    const {pen, camera, canvas} = this, ratio = canvas.width / Math.max(camera.width, 1);
    const style = getComputedStyle(canvas);
    this.ink = style.getPropertyValue('--ink');
    this.faint = style.getPropertyValue('--faint');
    this.line = style.getPropertyValue('--line');
    this.fault = style.getPropertyValue('--fault');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, camera.width, camera.height);
    this.grid();
    arms.forEach((state, k) => {
      pen.globalAlpha = k ? 0.5 : 1;
      this.trail(state, k);
      this.joints(scene[k], state);
      this.bodies(scene[k], state);
      this.wrenches(state);
    });
    pen.globalAlpha = 1;
    if (this.pull) this.spring(this.pull.from, this.pull.to, this.fault);
  }

  grid() {
    const {pen, camera} = this, step = roundStep(80 / camera.scale);
    const [left, top] = camera.toPlane(0, 0), [right, bottom] = camera.toPlane(camera.width, camera.height);
    pen.strokeStyle = this.line;
    pen.lineWidth = 0.5;
    pen.beginPath();
    for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
      const [px] = camera.toPixel(x, 0);
      pen.moveTo(px, 0);
      pen.lineTo(px, camera.height);
    }
    for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) {
      const [, py] = camera.toPixel(0, y);
      pen.moveTo(0, py);
      pen.lineTo(camera.width, py);
    }
    pen.stroke();
    pen.fillStyle = this.faint;
    pen.font = '12px system-ui, sans-serif';
    pen.textAlign = 'right';
    pen.fillText(`grid ${+step.toPrecision(3)} m`, camera.width - 8, 16);
    const [x, y] = camera.toPixel(0, 0);
    pen.fillStyle = this.ink;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x - 7, y + 12);
    pen.lineTo(x + 7, y + 12);
    pen.fill();
  }

  // The trail of the chosen point of each arm; a jump of time starts a new one.
  trail(state, k) {
    const trail = this.trails[k], point = trailPoint(state, this.trailOf);
    if (!trail || !point) return;
    const last = trail[trail.length - 1];
    if (last && (state.time < last.time || state.time > last.time + 1)) trail.length = 0;
    if (!last || state.time !== last.time) trail.push({time: state.time, x: point[0], y: point[1]});
    if (trail.length > TRAIL) trail.shift();
    const {pen} = this;
    pen.strokeStyle = this.faint;
    pen.lineWidth = 1.2;
    pen.beginPath();
    for (const {x, y} of trail) pen.lineTo(...this.camera.toPixel(x, y));
    pen.stroke();
  }

  joints(arm, state) {
    const {pen, camera} = this;
    arm.joints.forEach((joint, k) => {
      const {x, y, angle} = state.zeros[k], body = state.bodies[joint.body];
      pen.strokeStyle = this.faint;
      pen.lineWidth = 1.5;
      if (joint.kind === 'slide') {
        const along = (q) => [x + q * Math.cos(angle), y + q * Math.sin(angle)];
        const q = state.position[k];
        const low = joint.lower ?? Math.min(q, 0, joint.rest) - 0.1 * arm.reach;
        const high = joint.upper ?? Math.max(q, 0, joint.rest) + 0.1 * arm.reach;
        const from = camera.toPixel(...along(low)), to = camera.toPixel(...along(high));
        pen.setLineDash([6, 4]);
        stroke(pen, from, to);
        pen.setLineDash([]);
        const nx = 6 * Math.sin(angle), ny = 6 * Math.cos(angle);
        for (const stop of [joint.lower, joint.upper]) {
          if (stop === null) continue;
          const [px, py] = camera.toPixel(...along(stop));
          pen.lineWidth = 3;
          stroke(pen, [px - nx, py - ny], [px + nx, py + ny]);
        }
        if (joint.stiffness) this.spring(along(Math.min(0, joint.rest, q) - 0.05 * arm.reach), along(q), this.faint);
        pen.save();
        const [px, py] = camera.toPixel(body.x, body.y);
        pen.translate(px, py);
        pen.rotate(-angle);
        pen.fillStyle = this.line;
        pen.fillRect(-9, -6, 18, 12);
        pen.restore();
      } else {
        const [px, py] = camera.toPixel(body.x, body.y), turn = (q) => -(angle + joint.axis * q);
        if (joint.lower !== null && joint.upper !== null) {
          pen.beginPath();
          pen.arc(px, py, 16, turn(joint.lower), turn(joint.upper), joint.axis > 0);
          pen.stroke();
        }
        for (const stop of [joint.lower, joint.upper]) {
          if (stop === null) continue;
          const c = Math.cos(turn(stop)), s = Math.sin(turn(stop));
          pen.lineWidth = 2.5;
          stroke(pen, [px + 12 * c, py + 12 * s], [px + 20 * c, py + 20 * s]);
        }
      }
    });
  }

  bodies(arm, state) {
    const {pen, camera} = this;
    state.bodies.forEach((body, k) => {
      const color = arm.bodies[k].color;
      pen.strokeStyle = pen.fillStyle = color;
      pen.lineWidth = 6;
      pen.lineCap = 'round';
      for (const {x1, y1, x2, y2} of body.segments) stroke(pen, camera.toPixel(x1, y1), camera.toPixel(x2, y2));
      pen.lineCap = 'butt';
      const [px, py] = camera.toPixel(body.x, body.y), [cx, cy] = camera.toPixel(body.cx, body.cy);
      dot(pen, px, py, 5, color);
      dot(pen, px, py, 2, '#ffffff');
      pen.strokeStyle = color;
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.arc(cx, cy, 6, 0, 2 * Math.PI);
      pen.fillStyle = '#ffffff';
      pen.fill();
      pen.stroke();
      pen.fillStyle = color;
      for (const begin of [0, Math.PI]) {
        pen.beginPath();
        pen.moveTo(cx, cy);
        pen.arc(cx, cy, 6, begin, begin + Math.PI / 2);
        pen.fill();
      }
    });
  }

  wrenches(state) {
    const {pen, camera} = this;
    for (const body of state.bodies) {
      const size = Math.hypot(body.fx, body.fy);
      const [px, py] = camera.toPixel(body.x, body.y);
      pen.strokeStyle = pen.fillStyle = this.fault;
      pen.lineWidth = 2;
      if (size > 0) {
        const long = Math.min(120, 12 * Math.log1p(size)), ux = body.fx / size, uy = -body.fy / size;
        const [tx, ty] = [px + long * ux, py + long * uy];
        stroke(pen, [px, py], [tx, ty]);
        pen.beginPath();
        pen.moveTo(tx + 6 * ux, ty + 6 * uy);
        pen.lineTo(tx - 5 * uy, ty + 5 * ux);
        pen.lineTo(tx + 5 * uy, ty - 5 * ux);
        pen.fill();
      }
    }
  }

  spring(from, to, color) {
    const {pen, camera} = this, [ax, ay] = camera.toPixel(...from), [bx, by] = camera.toPixel(...to);
    const long = Math.hypot(bx - ax, by - ay) || 1, ux = (bx - ax) / long, uy = (by - ay) / long, turns = 12;
    pen.strokeStyle = color;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(ax, ay);
    for (let k = 1; k < turns; k++) {
      const side = 5 * (k % 2 ? 1 : -1), along = long * k / turns;
      pen.lineTo(ax + ux * along - uy * side, ay + uy * along + ux * side);
    }
    pen.lineTo(bx, by);
    pen.stroke();
  }
}

// The points whose trail can be drawn: [value, text].
export function trailChoices(arm) {
  return [['', 'nothing'], ...arm.bodies.flatMap(({name}, k) => [[`${k}:end`, `end of ${name}`],
                                                                 [`${k}:center`, `mass centre of ${name}`]])];
}

function trailPoint(state, choice) {
  const [index, part] = choice.split(':'), body = state.bodies[index];
  if (!choice || !body) return null;
  const end = body.segments[body.segments.length - 1];
  return part === 'center' || !end ? [body.cx, body.cy] : [end.x2, end.y2];
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
