/** Fields for a number. They are of type "text": of one of type "number" a browser in English drops a comma, and 2,079 becomes 2079. */

import { h } from "./dom";

/** A number typed with a decimal point or comma; NaN where the text is none, or may have a comma between thousands. */
export function numberOf(text: string): number {
  const plain = text.trim().replace("−", "-");
  if (/^[-+]?[1-9]\d{0,2},\d{3}$/.test(plain)) return NaN;
  return /^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

interface Asked {
  least?: number;
  most?: number;
  [attribute: string]: string | number | boolean | undefined;
}

/** A field for a number from `least` to `most`. `given` is called with what is typed, NaN where the field was emptied; anything else is
 * refused beside the field, and keeps a form from being sent. */
export function numberField({ least = -Infinity, most = Infinity, ...attributes }: Asked, given: (value: number) => void = () => {}): HTMLInputElement {
  const field = h("input", { type: "text", inputmode: "decimal", autocomplete: "off", ...attributes });
  field.addEventListener("change", () => {
    const [text, value] = [field.value.trim(), numberOf(field.value)];
    const within = value >= least && value <= most;
    field.setCustomValidity(!text || within ? "" : Number.isNaN(value) ? refusal(text) : `between ${least} and ${most}`);
    if (!field.reportValidity()) return;
    if (text) field.value = String(value); // as it was understood
    given(value);
  });
  return field;
}

function refusal(text: string): string {
  const plain = text.replace(",", ".");
  return Number.isNaN(numberOf(plain)) ? "a number, such as 2.5" : `${plain}, or ${text.replace(",", "")}? Write it with a point, or without a comma`;
}
