// The mouse, pen and fingers on the canvas: drag a body to pull it, click it for its trail, drag elsewhere to move the
// picture, wheel or two fingers to zoom. Where the page scrolls, one finger beside the arm scrolls it.

const NEAR = 14;        // px from a body
const FINGER = 26;      // the same of a finger
const STILL = 4;        // px; a press that moves no farther is a click
const REPEAT = 100;     // ms between two signs that the body is still held

export class Pointer {
  // send(what, values); arms(): what is drawn; scene(): the first arm's description; can(): whether bodies can be
  // pulled; choose({body, point}): a body was clicked; changed(): the picture must be drawn again
  constructor(canvas, camera, drawing, {send, arms, scene, can, choose, changed}) {
    Object.assign(this, {canvas, camera, drawing, send, arms, scene, can, choose, changed});
    this.held = null;        // {index, body, point: [x, y] in its frame, to: [x, y]}
    this.pressed = null;     // {x, y, found}
    this.fingers = new Map();
    canvas.addEventListener('pointerdown', (event) => this.down(event));
    canvas.addEventListener('pointermove', (event) => this.move(event));
    canvas.addEventListener('pointerleave', () => this.over(null));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      canvas.addEventListener(end, (event) => this.up(event));
    }
    canvas.addEventListener('touchstart', (event) => {   // keeps the page from scrolling
      const [{clientX, clientY}] = event.touches, {left, top} = canvas.getBoundingClientRect();
      if (event.touches.length > 1 || this.bodyAt(clientX - left, clientY - top, FINGER)) event.preventDefault();
    }, {passive: false});
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
      this.zoom(Math.exp(-0.0015 * Math.max(-300, Math.min(300, pixels))), event.offsetX, event.offsetY);
    }, {passive: false});
    for (const [target, name] of [[window, 'blur'], [window, 'pagehide'], [document, 'visibilitychange']]) {
      target.addEventListener(name, () => this.letGo());
    }
    setInterval(() => this.tell(), REPEAT);
  }

  zoom(factor, x = this.camera.width / 2, y = this.camera.height / 2) {
    this.camera.zoom(factor, x, y);
    this.changed();
  }

  down(event) {
    if (event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (this.fingers.size > 1) {
      this.pressed = null;
      return this.letGo();
    }
    const near = event.pointerType === 'touch' ? FINGER : NEAR, found = this.bodyAt(event.offsetX, event.offsetY, near);
    this.pressed = {x: event.offsetX, y: event.offsetY, found, moved: false};
    if (!found || !this.can()) return;
    const to = this.camera.toPlane(event.offsetX, event.offsetY);
    this.held = {index: found.index, body: this.scene().bodies[found.index].name, point: this.local(found), to};
    this.tell();
  }

  move(event) {
    const before = this.fingers.get(event.pointerId), now = [event.offsetX, event.offsetY];
    if (!before) return this.over(this.bodyAt(...now)?.index ?? null);
    if (this.pressed && Math.hypot(now[0] - this.pressed.x, now[1] - this.pressed.y) > STILL) this.pressed.moved = true;
    if (this.held) {
      this.held.to = this.camera.toPlane(...now);
      this.tell();
    } else if (this.fingers.size > 1) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = ([x, y]) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
      this.camera.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
      this.zoom(apart(now) / apart(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    } else if (event.pointerType !== 'touch' || getComputedStyle(this.canvas).touchAction === 'none') {
      this.camera.pan(now[0] - before[0], now[1] - before[1]);
      this.changed();
    }
    this.fingers.set(event.pointerId, now);
  }

  up(event) {
    if (!this.fingers.delete(event.pointerId)) return;
    const {pressed} = this;
    this.pressed = null;
    this.letGo();
    if (event.type === 'pointerup' && pressed && !pressed.moved && pressed.found) {
      this.choose({body: pressed.found.index, point: this.local(pressed.found)});
    }
  }

  over(index) {
    this.canvas.style.cursor = index === null ? '' : this.can() ? 'grab' : 'pointer';
    if (index === this.drawing.hover) return;
    this.drawing.hover = index;
    this.changed();
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
    this.drawing.pull = {body: this.held.index, from: [body.x + c * px - s * py, body.y + s * px + c * py],
                         to: this.held.to};
  }

  // A point of the plane on a body in that body's frame.
  local({index, x: px, y: py}) {
    const {x, y, angle} = this.arms()[0].bodies[index], c = Math.cos(angle), s = Math.sin(angle);
    return [c * (px - x) + s * (py - y), c * (py - y) - s * (px - x)];
  }

  // The body nearest to a pixel and the point of it there, in the plane; null if none is near.
  bodyAt(px, py, near = NEAR) {
    let best = null, least = near;
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
