/** What was typed and not saved yet: this tab keeps it over a reload and while other pages are open. */

const keyOf = (name: string): string => `terragrip-draft ${name}`;

export function draftOf<T>(name: string): T | null {
  return JSON.parse(sessionStorage.getItem(keyOf(name)) ?? "null") as T | null;
}

/** Keep a draft in place of the one before; null: none. */
export function keepDraft(name: string, draft: unknown): void {
  if (draft === null) sessionStorage.removeItem(keyOf(name));
  else sessionStorage.setItem(keyOf(name), JSON.stringify(draft));
}
