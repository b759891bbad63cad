// The transform between the plane of the arm, m, and the canvas, CSS pixels.

export class Camera {
  constructor() {
    this.width = this.height = 1;   // px
    this.x = this.y = 0;            // m, in the middle of the canvas
    this.scale = 100;               // px per m
    this.touched = false;           // whether the user has moved it
  }

  fit(reach) {
    this.x = this.y = 0;
    this.scale = 0.46 * Math.min(this.width, this.height) / reach;
    this.touched = false;
  }

  toPixel(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toPlane(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.touched = true;
  }

  // Zoom so that the point under the pixel stays there.
  zoom(factor, px, py) {
    const [x, y] = this.toPlane(px, py);
    this.scale = Math.min(1e6, Math.max(1e-3, this.scale * factor));
    const [there, above] = this.toPlane(px, py);
    this.x += x - there;
    this.y += y - above;
    this.touched = true;
  }
}
