// Fields for numbers. They are fields of text, since a browser's own number field drops other letters without a word.

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
const BEGINNING = /^[+-]?(\d+\.?\d*|\.\d*)?(e[+-]?\d*)?$/i;  // may become a number

const LARGEST = 1e15;  // of the server (live_show.py)

const textIn = (field) => field.value.trim().replaceAll("−", "-");
const no = ({value, dataset}) => `${dataset.number}: “${value.trim().slice(0, 20)}” is no number; allowed: such as −0.25`;

export const numberIn = (field) => (NUMBER.test(textIn(field)) ? Number(textIn(field)) : NaN);

// Empty, or why the field has no number.
export function numberTrouble(field) {
  const text = textIn(field);
  if (NUMBER.test(text)) {
    return Math.abs(Number(text)) < LARGEST ? "" : `${field.dataset.number}: is too large; allowed: below ${LARGEST} in size`;
  }
  return text ? no(field) : `${field.dataset.number}: is missing; allowed: a number, such as −0.25`;
}

// Marks the fields in which there is what cannot become a number, and tells `say` why, or "" when that is mended.
export function watchNumbers(fields, say) {
  for (const field of fields)
    field.addEventListener("input", () => {
      const before = field.getAttribute("aria-invalid") === "true", wrong = !BEGINNING.test(textIn(field));
      field.setAttribute("aria-invalid", String(wrong));
      if (wrong || before) say(wrong ? no(field) : "");
    });
}
