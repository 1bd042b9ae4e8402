// Colours. All are variables of style.css, so that text, plots and replay agree.

const root = document.documentElement;
const listeners = [];
let cache = new Map();

export function color(name) {
  if (!cache.has(name)) cache.set(name, getComputedStyle(root).getPropertyValue(`--${name}`).trim());
  return cache.get(name);
}

export const isDark = () => color("is-dark") === "1";

// Returns the function that ends it.
export function onThemeChange(listener) {
  listeners.push(listener);
  return () => listeners.splice(listeners.indexOf(listener), 1);
}

function changed() {
  cache = new Map();
  for (const listener of listeners) listener();
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);

export function connectThemeButton(button) {
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    changed();
  });
}
