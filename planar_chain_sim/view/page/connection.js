// The WebSocket to the program: one request for a frame at a time, so that nothing piles up here or there.
// The format is described in scene.py.

const SHORTEST = 500, LONGEST = 3000;   // ms until the next try
const SILENT = 3000;                    // ms without an answer after which the page says so

export class Connection {
  // news(message): what came as JSON; frame(numbers): Float64Array, empty while there is nothing to draw;
  // series(numbers), trail(numbers): Float64Array; state(word): 'open', 'lost' or 'silent'; wanted(): what the next request for a frame
  // says besides; turn(): before each request
  constructor(handlers) {
    Object.assign(this, handlers);
    this.waiting = 0;          // since when an answer is due, ms; 0: none is
    this.pause = SHORTEST;
    this.last = '';
    this.socket = null;
    this.connect();
    const turn = () => {
      this.turn();
      this.ask();
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  connect() {
    const socket = new WebSocket(new URL('socket', location.href.replace(/^http/, 'ws')));
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.pause = SHORTEST;
      this.tell('open');
    };
    socket.onmessage = ({data}) => {
      if (typeof data === 'string') return this.news(JSON.parse(data));
      const numbers = new Float64Array(data);
      if (numbers[0] === -1) return this.series(numbers);
      if (numbers[0] === -2) return this.trail(numbers);
      this.waiting = 0;
      this.tell('open');
      this.frame(numbers);
    };
    socket.onclose = () => {
      this.waiting = 0;
      this.tell('lost');
      setTimeout(() => this.connect(), this.pause);
      this.pause = Math.min(LONGEST, 1.5 * this.pause);
    };
    this.socket = socket;
  }

  tell(word) {
    if (word === this.last) return;
    this.last = word;
    this.state(word);
  }

  ask() {
    const now = performance.now();
    if (!this.waiting) {
      if (this.send('frame', this.wanted())) this.waiting = now;
      this.turned = now;
    } else {
      // time in which the page itself did not run does not count
      if (now - this.turned > 1000) this.waiting = now;
      this.turned = now;
      if (now - this.waiting > SILENT) this.tell('silent');
    }
  }

  // Send an action; false without a connection.
  send(what, values = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({do: what, ...values}));
    return true;
  }
}
