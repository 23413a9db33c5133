/** What a person chose once: theme and system of units, kept in this browser. */
import type { System } from "./format";

type Theme = "system" | "light" | "dark";

function stored(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

function store(key: string, value: string | null): void {
  try {
    if (value === null) localStorage.removeItem(key);
    else localStorage.setItem(key, value);
  } catch {
    // no storage: it holds for this page only
  }
}

const theme = stored("subtense.theme");

class Preferences {
  theme: Theme = $state(theme === "light" || theme === "dark" ? theme : "system");
  system: System = $state(stored("subtense.units") === "imperial" ? "imperial" : "metric");

  chooseTheme(theme: Theme): void {
    this.theme = theme;
    store("subtense.theme", theme === "system" ? null : theme);
    if (theme === "system") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = theme;
  }

  chooseSystem(system: System): void {
    this.system = system;
    store("subtense.units", system);
  }
}

export const preferences = new Preferences();
