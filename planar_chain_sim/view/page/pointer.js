// The mouse, pen and fingers on the canvas: drag a body to pull it, drag elsewhere to move the picture, wheel to zoom.

const NEAR = 14;        // px from a body
const REPEAT = 100;     // ms between two signs that the body is still held

export class Pointer {
  // send(what, values); arms(): what is drawn; scene(): the first arm's description; can(): whether bodies can be pulled
  constructor(canvas, camera, drawing, {send, arms, scene, can}) {
    Object.assign(this, {canvas, camera, drawing, send, arms, scene, can});
    this.held = null;        // {index, body, point: [x, y] in its frame, to: [x, y]}
    this.fingers = new Map();
    canvas.addEventListener('pointerdown', (event) => this.down(event));
    canvas.addEventListener('pointermove', (event) => this.move(event));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      canvas.addEventListener(end, (event) => this.up(event));
    }
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
    }, {passive: false});
    for (const [target, name] of [[window, 'blur'], [window, 'pagehide'], [document, 'visibilitychange']]) {
      target.addEventListener(name, () => this.letGo());
    }
    setInterval(() => this.tell(), REPEAT);
  }

  down(event) {
    if (event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (this.fingers.size > 1) return this.letGo();
    const found = this.can() ? this.bodyAt(event.offsetX, event.offsetY) : null;
    if (!found) return;
    const to = this.camera.toPlane(event.offsetX, event.offsetY), {x, y, angle} = this.arms()[0].bodies[found.index];
    const c = Math.cos(angle), s = Math.sin(angle), [dx, dy] = [found.x - x, found.y - y];
    this.held = {index: found.index, body: this.scene().bodies[found.index].name,
                 point: [c * dx + s * dy, c * dy - s * dx], to};
    this.tell();
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) {
      const over = this.can() && this.bodyAt(event.offsetX, event.offsetY);
      this.canvas.style.cursor = over ? 'pointer' : 'grab';
      return;
    }
    const now = [event.offsetX, event.offsetY];
    if (this.held) {
      this.held.to = this.camera.toPlane(...now);
      this.tell();
    } else if (this.fingers.size === 1) {
      this.camera.pan(now[0] - before[0], now[1] - before[1]);
    } else {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = ([x, y]) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
      this.camera.zoom(apart(now) / apart(before), ...other);
    }
    this.fingers.set(event.pointerId, now);
  }

  up(event) {
    if (this.fingers.delete(event.pointerId)) this.letGo();
  }

  letGo() {
    if (!this.held) return;
    this.held = this.drawing.pull = null;
    this.send('release');
  }

  tell() {
    if (this.held) this.send('pull', {body: this.held.body, point: this.held.point, to: this.held.to});
  }

  // Draw the pull between the newest place of the body and the pointer.
  follow() {
    const body = this.held && this.arms()?.[0]?.bodies[this.held.index];
    if (!body) return this.letGo();
    const c = Math.cos(body.angle), s = Math.sin(body.angle), [px, py] = this.held.point;
    this.drawing.pull = {from: [body.x + c * px - s * py, body.y + s * px + c * py], to: this.held.to};
  }

  // The body nearest to a pixel and the point of it there, in the plane; null if none is near.
  bodyAt(px, py) {
    let best = null, least = NEAR;
    (this.arms()?.[0]?.bodies ?? []).forEach((body, index) => {
      const parts = [...body.segments, {x1: body.cx, y1: body.cy, x2: body.cx, y2: body.cy}];
      for (const {x1, y1, x2, y2} of parts) {
        const [ax, ay] = this.camera.toPixel(x1, y1), [bx, by] = this.camera.toPixel(x2, y2);
        const long = (bx - ax) ** 2 + (by - ay) ** 2;
        const share = long ? Math.min(1, Math.max(0, ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / long)) : 0;
        const away = Math.hypot(ax + share * (bx - ax) - px, ay + share * (by - ay) - py);
        if (away < least) {
          least = away;
          best = {index, x: x1 + share * (x2 - x1), y: y1 + share * (y2 - y1)};
        }
      }
    });
    return best;
  }
}
