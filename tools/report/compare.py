"""ballast-compare RUN_A RUN_B: Lists how two runs differ and makes a page of both, for `ballast compare`."""

import argparse
import html
import sys
from pathlib import Path

import differences
import words
from assemble import compare_page, notes_html, page_begins, symbols, table_html
from command import run_program
from differences import value_text, value_texts
from output_files import Kind, check_place
from recording import Recording
from report import ERRORS, write_page
from short_number import short_difference

_PAGE = Kind("page of ballast compare", page_begins("compare"))
# Limits of the lists in the terminal. The page has everything.
_LONGEST_TERMINAL_LIST = 40
_WIDEST_VALUE = 28


class Comparison:
    """Two recordings and their differences."""

    def __init__(self, path_a, path_b):
        self.recordings = [Recording(path_a), Recording(path_b)]
        a, b = self.recordings
        self.fields, self.logs = differences.log_differences(a.log_path, b.log_path)
        self.fields += differences.robot_differences(a.robot, b.robot)
        self.fields += differences.summary_differences(a.summary, b.summary)

    @property
    def names(self):
        """The runs' names. Where they are the same, the folders tell the runs apart."""
        names = [recording.name for recording in self.recordings]
        if names[0] != names[1]:
            return names
        return [f"{recording.name} ({recording.folder.resolve().name})" for recording in self.recordings]

    @property
    def identical(self):
        return not self.fields and not any(log.differs for log in self.logs)

    def field_rows(self):
        return [[d.path, *value_texts(d.a, d.b), "" if d.difference is None else short_difference(d.difference)]
                for d in self.fields]

    def log_rows(self):
        rows = []
        for log in self.logs:
            counts = " / ".join(str(size) for size in log.messages)
            if log.differs:
                rows.append([log.channel, counts, str(log.differing), str(log.tick), log.field or "(only one has it)",
                             *value_texts(log.a, log.b)])
            else:
                rows.append([log.channel, counts, "0", "–", "–", "–", "–"])
        return rows

    def first_difference(self):
        """A sentence on the earliest difference. In one tick, the plant's messages come before the other's."""
        differing = [log for log in self.logs if log.differs]
        if not differing:
            return "The logs are the same, message by message."
        # A field that differs says more than a log that begins or ends elsewhere.
        first = min(differing, key=lambda log: (not log.field, log.tick))
        where = f"The logs first differ in tick {first.tick}: {first.channel}"
        if not first.field:
            return f"{where}, which only one of them has."
        far = differences.how_far(first.channel, first.field, first.a, first.b)
        a, b = value_texts(first.a, first.b)
        return f"{where}, {first.field}: {a} in A, {b} in B{far}."


_FIELD_HEAD = ["field", "A", "B", "B − A"]
_LOG_TITLE = "Logs, channel by channel, without run_id (a number drawn on a bus)"
_LOG_HEAD = ["channel", "messages A / B", "differing", "first tick", "first field", "A", "B"]


# The controller's channels, commands first.
_CONTROLLER = ("BALLAST_STEP_COMMAND", "BALLAST_CONTROLLER_STATUS")


def controller_text(recorded, replayed):
    """The first field in which the controller's messages differ, one line per channel, for two logs of the same inputs.

    The steps of tick k are commanded with the status of tick k - 1.
    """
    _, logs = differences.log_differences(recorded, replayed)
    found = sorted((log for log in logs if log.channel in _CONTROLLER and log.field),
                   key=lambda log: (log.tick - (log.channel == "BALLAST_STEP_COMMAND"), _CONTROLLER.index(log.channel)))
    return "".join(f"  {log.channel}, {_when(log)}, {log.field}: {_exact(log.a)} recorded, {_exact(log.b)} replayed"
                   f"{differences.how_far(log.channel, log.field, log.a, log.b)}; "
                   f"{log.differing} {'message differs' if log.differing == 1 else 'messages differ'}\n"
                   for log in found)


def _when(log):
    computed = f" (commanded in tick {log.tick - 1})" if log.channel == "BALLAST_STEP_COMMAND" else ""
    return f"tick {log.tick}{computed}"


def _exact(value):
    return repr(value) if isinstance(value, float) else value_text(value)


def terminal_text(comparison):
    a, b = comparison.recordings
    lines = [f"A  {a.name}  ({a.log_path})", f"B  {b.name}  ({b.log_path})"]
    lines += [f"   {which}: {note}" for which, recording in zip("AB", (a, b)) for note in recording.notes]
    lines.append("")
    if comparison.identical:
        return "\n".join(lines + ["The runs are identical: every field but wall_time and speed, and every message but its run_id."])
    rows = comparison.field_rows()
    if rows:
        lines += _columns([_FIELD_HEAD] + rows[:_LONGEST_TERMINAL_LIST])
        if len(rows) > _LONGEST_TERMINAL_LIST:
            lines.append(f"  ... and {len(rows) - _LONGEST_TERMINAL_LIST} more fields, on the page")
    else:
        lines.append("The summaries are the same.")
    lines += ["", f"  {_LOG_TITLE}"] + _columns([_LOG_HEAD] + comparison.log_rows()) + [
        "", comparison.first_difference()]
    return "\n".join(lines)


def _columns(rows):
    rows = [[cell if len(cell) <= _WIDEST_VALUE or k == 0 else cell[:_WIDEST_VALUE - 1] + "…"
             for k, cell in enumerate(row)] for row in rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]


def _head(comparison):
    verdict = ('<span class="badge good">Identical</span>' if comparison.identical else
               '<span class="badge">They differ</span>')
    pair = "".join(_run_box(recording, which) for which, recording in enumerate(comparison.recordings))
    name_a, name_b = comparison.names
    return (f"<h1>{html.escape(name_a)} <small>and</small> {html.escape(name_b)}{verdict}</h1>"
            f'<p class="subtitle">{html.escape(comparison.first_difference())}</p><div class="pair">{pair}</div>')


def _run_box(recording, which):
    text, kind = words.badge(recording)
    said = " ".join(symbols(sentence) for sentence in words.sentences(recording))
    return (f'<section style="--which: var(--run-{which})"><h2>{"AB"[which]} · {html.escape(recording.name)}'
            f'<span class="badge {kind}">{html.escape(text)}</span></h2>'
            f'<p class="subtitle">{html.escape(recording.folder.resolve().name)}</p>{notes_html(recording)}'
            f'<p class="said">{said}</p></section>')


def _tables(comparison):
    a, b = comparison.recordings
    headline = []
    numbers_b = {number.path: number for number in words.numbers(b)}
    for number in words.numbers(a):
        other = numbers_b.get(number.path)
        difference = None
        if other is not None:
            difference = differences.FieldDifference(number.path, number.value, other.value).difference
            if difference is not None:
                difference *= number.factor
        label = f"{number.label} [{number.unit}]" if number.unit else number.label
        headline.append([label, number.text, "–" if other is None else other.text,
                         "" if difference is None else short_difference(difference)])
    fields = comparison.field_rows()
    return (table_html(words.Table("Key numbers", ["", "A", "B", "B − A"], headline))
            + table_html(words.Table(_LOG_TITLE, _LOG_HEAD, comparison.log_rows()), "full")
            + (table_html(words.Table(f"Fields that differ: {len(fields)}", _FIELD_HEAD, fields), "full")
               if fields else ""))


def main():
    parser = argparse.ArgumentParser(prog="ballast-compare",
                                     description="Lists how two runs differ, and makes an HTML page of both.")
    parser.add_argument("run_a", type=Path, help="folder of a run, or its log")
    parser.add_argument("run_b", type=Path, help="folder of another run, or its log")
    parser.add_argument("--controller", action="store_true",
                        help="for two logs of the same inputs: print only where the controller's messages differ first")
    parser.add_argument("--out", type=Path, help="default: compare.html beside the log of RUN_B")
    arguments = parser.parse_args()

    def body():
        if arguments.controller:
            print(controller_text(arguments.run_a, arguments.run_b), end="", flush=True)
            return
        comparison = Comparison(arguments.run_a, arguments.run_b)
        a, b = comparison.recordings
        out, inputs = arguments.out or b.folder / "compare.html", [*a.files, *b.files]
        check_place(out, _PAGE, inputs)
        print(terminal_text(comparison), flush=True)
        write_page(out, compare_page([a, b], " and ".join(comparison.names), _head(comparison), _tables(comparison)), _PAGE,
                   inputs)

    return run_program("ballast-compare", body, *ERRORS)


if __name__ == "__main__":
    sys.exit(main())
