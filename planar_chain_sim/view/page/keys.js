// The keys, and the help that lists them. KEYS is both.

import {element} from './controls.js';

// [keys, as the help shows them, what they do, kind of source or ''; what is pressed]
export const KEYS = [
  [[' '], 'space', 'pause, go on', '', 'pause'],
  [['.', 'ArrowRight'], '→ or .', 'one tick', '', 'step'],
  [['ArrowLeft', ','], '← or ,', 'one tick back', 'log', 'back'],
  [['n'], 'n', 'next event', 'log', 'next'],
  [['p'], 'p', 'previous event', 'log', 'previous'],
  [['<'], '<', 'slower', 'log', 'slower'],
  [['>'], '>', 'faster', 'log', 'faster'],
  [['l'], 'l', 'loop', 'log', 'loop'],
  [['r'], 'r', 'back to the initial state', '', 'reset'],
  [['['], '[', 'choose the previous joint', '', 'before'],
  [[']'], ']', 'choose the next joint', '', 'after'],
  [['ArrowUp'], '↑', 'positive effort in the chosen joint while held', '', 'more'],
  [['ArrowDown'], '↓', 'negative effort in the chosen joint while held', '', 'less'],
  [['0'], '0', 'no effort in the chosen joint while held', '', 'zero'],
  [['h'], 'h', 'hold the charts', '', 'hold'],
  [['f'], 'f', 'fit the arm into the picture', '', 'fit'],
  [['+', '='], '+', 'zoom in', '', 'closer'],
  [['-'], '-', 'zoom out', '', 'farther'],
  [['t'], 't', 'light or dark', '', 'theme'],
  [['?'], '?', 'this help', '', 'help'],
  [[], 'drag a body', 'pull it with a spring', '', ''],
  [[], 'click a body', 'draw the trail of that point', '', ''],
  [[], 'drag beside the arm', 'move the picture; on a small screen with two fingers', '', ''],
  [[], 'wheel', 'zoom; also with two fingers', '', '']];
const HELD = new Set(['more', 'less', 'zero']);

export class Keys {
  // actions: by name; others are buttons of the page with that id
  constructor(actions, released) {
    document.addEventListener('keydown', (event) => {
      const {target, key} = event, dialog = element('keys');
      if (event.ctrlKey || event.altKey || event.metaKey || dialog.open) return;
      if (target.matches('select, textarea, input:not([type=range], [type=checkbox])')) return;
      if (target.matches('input[type=range]') && key.startsWith('Arrow')) return;
      // a button of the help that has just been closed may still have the focus
      const here = target.getClientRects().length > 0;
      if (here && target.matches('button:focus-visible, input[type=checkbox]') && key === ' ') return;
      const found = KEYS.find(([keys]) => keys.includes(key))?.[4];
      if (!found) return;
      event.preventDefault();
      if (actions[found]) actions[found]();
      else if (!event.repeat || found === 'step' || found === 'back') press(element(found));
    });
    document.addEventListener('keyup', ({key}) => {
      if (HELD.has(KEYS.find(([keys]) => keys.includes(key))?.[4])) released();
    });
    element('help').onclick = () => element('keys').showModal();
    element('keys').onclick = ({target}) => target === element('keys') && element('keys').close();
  }

  // List the keys that mean something for a kind of source.
  show(source) {
    element('keys').querySelector('dl').replaceChildren(...KEYS.filter(([, , , only]) => !only || only === source)
      .flatMap(([keys, shown, does]) => {
        const term = document.createElement('dt'), meaning = document.createElement('dd');
        const key = document.createElement(keys.length ? 'kbd' : 'span');
        key.textContent = shown;
        term.append(key);
        meaning.textContent = does;
        return [term, meaning];
      }));
  }
}

function press(button) {
  if (!button.disabled && !button.hidden) button.click();
}
