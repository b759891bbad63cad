// The WebSocket to the program: one request for a frame at a time, so that nothing piles up here or there.
// The format is described in scene.py.

export class Connection {
  // news(message): what came as JSON; frame(numbers): Float64Array, empty while there is nothing to draw;
  // open(is): whether there is a connection.
  constructor({news, frame, open}) {
    Object.assign(this, {news, frame, open});
    this.waiting = false;
    this.wanted = {};          // what a request for a frame says besides
    this.socket = null;
    this.connect();
    const turn = () => {
      this.ask();
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  connect() {
    const socket = new WebSocket(new URL('socket', location.href.replace(/^http/, 'ws')));
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => this.open(true);
    socket.onmessage = ({data}) => {
      if (typeof data === 'string') {
        this.news(JSON.parse(data));
      } else {
        this.waiting = false;
        this.frame(new Float64Array(data));
      }
    };
    socket.onclose = () => {
      this.waiting = false;
      this.open(false);
      setTimeout(() => this.connect(), 1000);
    };
    this.socket = socket;
  }

  ask() {
    if (!this.waiting) this.waiting = this.send('frame', this.wanted);
  }

  // Send an action; false without a connection.
  send(what, values = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({do: what, ...values}));
    return true;
  }
}
