// Light or dark: the system's choice until the person makes one, which is remembered.

const KEY = "keyhole-theme";
const system = matchMedia("(prefers-color-scheme: dark)");
const listeners = [];

export const isDark = () => {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : system.matches;
};

/** Call `listener` after every change. */
export function onTheme(listener) {
  listeners.push(listener);
}

export function switchTheme() {
  const theme = isDark() ? "light" : "dark";
  document.documentElement.dataset.theme = theme;
  try {
    localStorage.setItem(KEY, theme);
  } catch {
    // Not remembered where storage is forbidden.
  }
  announce();
}

const announce = () => listeners.forEach((listener) => listener());
system.addEventListener("change", announce);
