// The list of events, the newest first; the same that repeats is counted, not repeated.

import {short, shortened} from './drawing.js';

const MOST = 200;
const WORDS = {
  command: 'command', reset: 'reset', state: 'state set', parameter: 'parameter set', payload: 'payload', wrench: 'wrench',
  pause: 'paused', resume: 'goes on', step: 'one tick', rejected: 'message refused', ignored: 'message without effect',
  controller_loss: 'controller gone', command_timeout: 'no commands', dropped_time: 'time dropped',
  held_up: 'publishing held up', divergence: 'ran away', stopped: 'stopped', stop_touched: 'stop touched', stop_left: 'stop left',
  stuck: 'stuck', slipped: 'slips', log_failure: 'log fails'};
const BAD = new Set(['rejected', 'ignored', 'controller_loss', 'command_timeout', 'dropped_time', 'divergence',
                     'stopped', 'log_failure']);
const QUIET = new Set(['topic', 'axes', 'plan', 'reason', 'body', 'joint', 'name', 'message', 'time']);

export class Events {
  // jump(tick): the event was pressed; timeOf(tick): s, NaN if that is not known
  constructor(list, {jump, timeOf}) {
    Object.assign(this, {list, jump, timeOf});
    this.clear();
  }

  clear() {
    this.last = this.marked = null;
    this.list.replaceChildren();
  }

  add(events) {
    for (const event of events) {
      const key = `${event.kind} ${event.data.joint ?? event.data.body ?? event.data.name ?? event.data.reason ?? ''}`;
      if (this.last?.key === key) {
        this.last.count += 1;
        this.fill(this.last, event);
        continue;
      }
      const item = document.createElement('li');
      item.append(...Array.from({length: 3}, () => document.createElement('span')));
      item.className = BAD.has(event.kind) ? 'bad' : '';
      this.last = {key, item, count: 1};
      this.fill(this.last, event);
      this.list.prepend(item);
    }
    while (this.list.children.length > MOST) this.list.lastChild.remove();
  }

  fill({item, count}, {tick, kind, data}) {
    const [when, what, times] = item.children, time = data.time ?? this.timeOf(tick);
    const text = Number.isFinite(time) ? `${time.toFixed(3)} s` : `tick ${tick}`;
    item.dataset.tick = tick;
    if (this.jump) {
      const button = when.firstElementChild ?? document.createElement('button');
      button.textContent = text;
      button.title = 'go there';
      button.onclick = () => this.jump(tick);
      when.replaceChildren(button);
    } else {
      when.textContent = text;
    }
    what.textContent = words(kind, data);
    times.textContent = count > 1 ? `× ${count}` : '';
    times.className = 'times';
  }

  // Mark the row of the last event up to a tick.
  mark(tick) {
    const found = [...this.list.children].find((item) => Number(item.dataset.tick) <= tick) ?? null;
    if (found !== this.marked) {
      this.marked?.classList.remove('now');
      found?.classList.add('now');
      this.marked = found;
      if (found && !this.list.matches(':hover, :focus-within')) {
        this.list.scrollTop = found.offsetTop - this.list.offsetTop - this.list.clientHeight / 2;
      }
    }
  }
}

function words(kind, data) {
  const whose = shortened(String(data.joint ?? data.body ?? data.name ?? ''), 48);
  const rest = Object.entries(data).filter(([key, value]) => !QUIET.has(key) && value !== null && value !== '')
    .map(([key, value]) => `${key} ${shown(value)}`).join(', ');
  const why = [data.reason, data.message].filter(Boolean).map(shown).join(', ');
  return `${WORDS[kind] ?? kind}${whose ? `: ${whose}` : ''}${rest ? ` (${rest})` : ''}${why ? `: ${why}` : ''}`;
}

function shown(value) {
  if (typeof value === 'number') return short(value, 4);
  if (Array.isArray(value)) return value.length > 6 ? `${value.length} values` : `[${value.map(shown).join(', ')}]`;
  const text = typeof value === 'string' ? value : JSON.stringify(value);
  return text.length > 160 ? `${text.slice(0, 159)}…` : text;
}
