// The list of events, the newest first.

const MOST = 200;

export class Events {
  constructor(list) {
    this.list = list;
  }

  add(events) {
    for (const {tick, kind, data} of events) {
      const item = document.createElement('li');
      for (const text of [`tick ${tick}`, kind, words(data)]) {
        const part = document.createElement('span');
        part.textContent = text;
        item.append(part);
      }
      this.list.prepend(item);
    }
    while (this.list.children.length > MOST) this.list.lastChild.remove();
  }
}

function words(data) {
  return Object.entries(data).map(([key, value]) => `${key} ${typeof value === 'number' ? +value.toPrecision(5) :
    typeof value === 'string' ? value : JSON.stringify(value)}`).join(', ');
}
