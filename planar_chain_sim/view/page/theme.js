// Light or dark: as the system has it until the button is pressed, whose choice is kept. The same colours for canvases.

const root = document.documentElement, KEY = 'theme';
const NAMES = ['paper', 'panel', 'ink', 'faint', 'line', 'grid', 'accent', 'fault'];
const listeners = [], system = matchMedia('(prefers-color-scheme: dark)');
export const colors = {};

// Read the colours of the style sheet; `listener` is called at once and at every change.
export function followTheme(listener) {
  listeners.push(listener);
  read();
}

export function isDark() {
  return (root.dataset.theme ?? (system.matches ? 'dark' : 'light')) === 'dark';
}

export function changeTheme() {
  root.dataset.theme = isDark() ? 'light' : 'dark';
  try {
    localStorage.setItem(KEY, root.dataset.theme);
  } catch { /* a browser that keeps nothing */ }
  read();
}

function read() {
  const style = getComputedStyle(root);
  for (const name of NAMES) colors[name] = style.getPropertyValue(`--${name}`).trim();
  for (const listener of listeners) listener();
}

try {
  const kept = localStorage.getItem(KEY);
  if (kept === 'light' || kept === 'dark') root.dataset.theme = kept;
} catch { /* a browser that keeps nothing */ }
system.addEventListener('change', read);
