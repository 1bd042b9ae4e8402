// Numbers with three significant digits, like tools/plots/short_number.py.

const NEGLIGIBLE = 1e-9;  // rounding of 0

// A number that changes. It keeps its zeros, so that it does not jump about.
export const numberText = (value) => {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const size = Math.abs(value) < NEGLIGIBLE ? 0 : Math.abs(value);
  if (size === 0) return "0.00";
  if (size < 1e-3 || size >= 1e6) return value.toExponential(2).replace(/-/g, "−");
  const text = value.toPrecision(3);
  return (text.includes("e") ? String(Number(text)) : text).replace("-", "−");
};

// A number that stands.
export const shortNumber = (value, digits = 3) =>
    Math.abs(value) < NEGLIGIBLE ? "0" : String(Number(value.toPrecision(digits))).replace(/-/g, "−");
