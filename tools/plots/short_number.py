"""Numbers as people read them, like tools/program/short_number.h. Files for programs keep all digits."""

import math

# A value below this is rounding in the quantities of a run.
NEGLIGIBLE = 1e-9
_MOST_DIGITS = 9


def significant(value, digits):
    """So many significant digits, without an exponent up to 1e6. A negligible value is "0", without a sign."""
    if abs(value) < NEGLIGIBLE:
        return "0"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text and 1 <= abs(value) < 1e6 else text


def short_number(value):
    """A quantity."""
    return significant(value, 3)


def short_time(value):
    """A time in s since the start of a run: one digit more, because the place in a plot is looked for."""
    return significant(value, 4)


def apart(a, b):
    """Two numbers with as many digits as tell them apart, three at least. The same text if they differ by rounding."""
    for digits in range(3, _MOST_DIGITS + 1):
        texts = significant(a, digits), significant(b, digits)
        if texts[0] != texts[1]:
            return texts
    return short_number(a), short_number(b)


def short_difference(value):
    """A difference with its sign; "rounding" where it is negligible."""
    if not math.isfinite(value):
        return f"{value:+}"
    return "rounding" if abs(value) < NEGLIGIBLE else ("+" if value > 0 else "") + short_number(value)
