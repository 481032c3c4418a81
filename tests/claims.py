#!/usr/bin/env python3
"""Compares the numbers on the pages with the JSON files that they come from.

    python3 tests/claims.py                     prints `numbers checked N, wrong 0`, or one line for each fault
    python3 tests/claims.py --write             writes the numbers of the JSON files into the pages
    python3 tests/claims.py --show PATH         prints what a path finds, such as public_sets.rows[data=walk].accuracy

`experiments/results/claims.toml` quotes the text around the numbers of a page and has a placeholder for each number:

    [[claim]]
    page = "README.md"
    in = "crossval_tactnet2_twin2.rows"
    text = "| twin | base network | {[*: base, accuracy, 1 sweeps]:.1%} |"

- `{PATH:FORMAT}` is the value at PATH, formatted as Python does; `%` multiplies by 100 and prints no percent sign. FORMAT `p` prints p-values.
- PATH, such as `file.rows[2].mean`, begins with the name of a file in `experiments/results` or in the table `files` (`.jsonl`: a list), with `[`
  or `.`, which continue the path of `in`, or with an abbreviation, `let.NAME = PATH`.
- `[2]` is a list's element 2, `[:10]` its first ten. `[TEXT]` is the only row with the key TEXT, `[A=B; C=D]` the only row with these values; `*`
  matches any text.
- A row stands for its `mean` or `difference`. A list of numbers is printed with commas.
- `median PATH` (also `min`, `max`, `mean`) is that of all rows, or of the list, that the path finds.
- `{A - B:FORMAT}` calculates with paths and numbers, from left to right: `+`, `-`, `*`, `/`; for an interval at both ends.
- Each line of `text` must be on the page once, or once after the text `after`. `each` lists the values of `{0}`, `{1}`, … for one copy of `text`
  per row, as in a table.

It also fails if
- a JSON file or a page names a commit that is not in the history (not checked in shallow clones);
- a JSON file in `experiments/results` is cited by no page and no claim;
- a number in README that has a decimal point, a percent sign or a unit has no claim.

`[[exception]]` lists text in README, a commit or a JSON file that these three may pass, with the reason.
"""

import argparse
import fnmatch
import json
import operator
import re
import statistics
import subprocess
import sys
import tomllib
from pathlib import Path

RESULTS = "experiments/results"
SIGNS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}
OF_SEVERAL = {"median": statistics.median, "mean": statistics.fmean, "min": min, "max": max}
NUMBER = r"([-+]?(?:< )?\d(?:[-+.,\d ]*\d)?)"
MEASURED = re.compile(r"\d[\d ]*\.\d+|\d+(?= ?(?:%|(?:ms|us|µs|ns|s|min|h|kB|KB|MB|GB|MiB|GiB|times|points|x)\b))")


class Fault(Exception):
    """A claim that cannot be checked, or that does not hold."""


class Numbers:
    """The JSON files of a repository, and the values at their paths."""

    def __init__(self, root, elsewhere=()):
        self.root, self.elsewhere, self.files = root, dict(elsewhere), {}

    def file(self, name):
        if name not in self.files:
            path = self.root / self.elsewhere.get(name, f"{RESULTS}/{name}.json")
            if not path.is_file():
                raise Fault(f"expected the file {path.relative_to(self.root)}, found none")
            text = path.read_text()
            self.files[name] = [json.loads(line) for line in text.splitlines()] if path.suffix == ".jsonl" else json.loads(text)
        return self.files[name]

    def values(self, path):
        """Returns the numbers, or lists of numbers, that a path finds."""
        parts = re.findall(r"\[[^\]]*\]|[^.\[\]]+", path)
        found = [self.file(parts[0])]
        for part in parts[1:]:
            found = [member for value in found for member in members(value, part)]
        found = [v.get("mean", v.get("difference")) if isinstance(v, dict) else v for v in found]
        for value in found:
            if isinstance(value, bool) or not isinstance(value, (int, float, list)):
                raise Fault(f"expected a number at {path}, found {value!r}")
        return found

    def value(self, path, claim):
        """Returns the value of `PATH` or `median PATH`, with the claim's abbreviations."""
        name = re.match(r"\w*", path)[0]
        path = claim.get("let", {}).get(name, name) + path[len(name):]
        function, _, path = path.partition(" ") if path.split(" ")[0] in OF_SEVERAL else ("", "", path)
        found = self.values(claim.get("in", "") + path if path[0] in "[." else path)
        if function:
            return OF_SEVERAL[function](found[0] if isinstance(found[0], list) else found)
        if len(found) != 1:
            raise Fault(f"expected one number at {path}, found {len(found)}")
        return found[0]

    def calculate(self, expression, claim):
        """Returns the value of `A - B * C …`, from left to right."""
        operands = re.split(r" ([-+*/]) (?![^\[]*\])", expression)
        result = self.operand(operands[0], claim)
        for sign, token in zip(operands[1::2], operands[2::2]):
            result = apply(SIGNS[sign], result, self.operand(token, claim))
        return result

    def operand(self, token, claim):
        return float(token) if re.fullmatch(r"[\d.]+", token) else self.value(token, claim)


def apply(function, a, b):
    """Returns `function(a, b)`; of an interval, that of both ends, in order."""
    if isinstance(a, list) or isinstance(b, list):
        return sorted(function(x, y) for x, y in zip(a if isinstance(a, list) else [a] * len(b), b if isinstance(b, list) else [b] * len(a)))
    return function(a, b)


def members(value, part):
    """Returns the members of a JSON value that one part of a path names."""
    name = part.strip("[]")
    if isinstance(value, dict):
        return [v for k, v in value.items() if k == name] or [v for k, v in value.items() if part[0] == "[" and fnmatch.fnmatchcase(k, name)]
    if not isinstance(value, list):
        return []
    if re.fullmatch(r":?\d+", name):
        return [value[:int(name[1:])] if name[0] == ":" else value[int(name)]]
    wanted = dict(pair.split("=", 1) for pair in name.split("; ")) if "=" in name else {"key": name}
    return [row for row in value if all(fnmatch.fnmatchcase(str(row.get(k)), v) for k, v in wanted.items())]


def text_of(value, form):
    if isinstance(value, list):
        return ", ".join(text_of(v, form) for v in value)
    if form == "p":
        return "< 0.001" if value < 0.001 else f"{value:.3f}"
    return format(value, form).replace("%", "").replace(",", " ")


def lines_of(claim):
    """Yields the claim with its abbreviations, and each line of its text, once for each row of `each`."""
    for row in claim.get("each", [[]]):
        def filled(text):
            for i, cell in enumerate([row] if isinstance(row, str) else row):
                text = text.replace("{%d}" % i, cell)
            return text
        of_row = claim | {"let": {name: filled(path) for name, path in claim.get("let", {}).items()}}
        yield from ((of_row, line) for line in filled(claim["text"]).splitlines() if line.strip())


def line_of(text, position):
    return text.count("\n", 0, position) + 1


def find(page, claim, line):
    """Returns the match of a line's text on a page, with a group for each number, and the placeholders."""
    parts = re.split(r"\{([^{}]*)\}", line)
    pattern = "".join(NUMBER if i % 2 else re.escape(part) for i, part in enumerate(parts))
    begin = 0
    if "after" in claim:
        begin = page.find(claim["after"])
        if begin < 0:
            raise Fault(f"expected the text {claim['after']!r}, found none")
    found = list(re.finditer(pattern, page[begin:]))
    if not found or len(found) > 1 and "after" not in claim:
        raise Fault(f"expected one text {line!r}, found {len(found)}")
    return begin, found[0], parts[1::2]


def check_page(name, text, claims, numbers):
    """Returns the claims that cannot be checked, the wrong numbers, the number of values checked, the numbers' spans, and the corrected text."""
    faults, wrong, checked, spans, edits = [], [], 0, [], []
    for claim in claims:
        for of_row, line in lines_of(claim):
            try:
                begin, match, placeholders = find(text, claim, line)
            except Fault as fault:
                faults.append(f"{name}: {fault}")
                continue
            number = line_of(text, begin + match.start())
            for group, placeholder in enumerate(placeholders, 1):
                span = tuple(begin + i for i in match.span(group))
                spans.append(span)
                try:
                    path, _, form = placeholder.rpartition(":")
                    value = numbers.calculate(path, of_row)
                    expected = text_of(value, form)
                except (Fault, ValueError, TypeError, ZeroDivisionError, IndexError) as fault:
                    faults.append(f"{name}:{number}: {{{placeholder}}}: {fault}")
                    continue
                checked += len(value) if isinstance(value, list) else 1
                if text[slice(*span)] != expected:
                    wrong.append(f"{name}:{number}: expected {expected}, found {text[slice(*span)]} ({path})")
                    edits.append((span, expected))
    for (begin, end), expected in sorted(set(edits), reverse=True):
        text = text[:begin] + expected + text[end:]
    return faults, wrong, checked, spans, text


def without_claim(text, spans, exceptions):
    """Yields line and text of the measured numbers of a page that no claim and no exception covers. Code and link targets are left out."""
    left_out = [m.span() for m in re.finditer(r"^```.*?^```|`[^`\n]*`|\]\([^)]*\)", text, re.M | re.S)]
    for exception in exceptions:
        left_out += [m.span() for m in re.finditer(re.escape(exception), text)]
    for match in MEASURED.finditer(text):
        if not any(begin < match.end() and match.start() < end for begin, end in spans + left_out):
            yield line_of(text, match.start()), match.group()


def commits_in(value, key=None):
    """Yields the commits that a JSON value names."""
    if isinstance(value, dict):
        for k, v in value.items():
            yield from commits_in(v, k)
    elif isinstance(value, list):
        for v in value:
            yield from commits_in(v, key)
    elif key in ("git", "commit", "program") and isinstance(value, str) and (commit := re.match(r"[0-9a-f]{7,40}", value)):
        yield commit[0]


def git(root, *arguments, **options):
    return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, **options)


def check_readme(text, spans, exceptions):
    faults = [f"README.md:{line}: expected a claim or an exception for {number}, found none" for line, number in without_claim(text, spans, exceptions)]
    return faults + [f"claims.toml: exception {e!r} is not in README.md" for e in sorted(exceptions) if e not in text]


def check_citations(names, pages, numbers, exceptions):
    """Returns a fault for each JSON file that no page and no claim cites."""
    text = "\n".join(pages.values())
    uncited = {n for n in names if n not in numbers.files and not re.search(rf"\b{re.escape(n)}\.json", text)}
    faults = [f"{RESULTS}/{n}.json: expected a page or a claim that cites it, found none" for n in sorted(uncited - exceptions)]
    return faults + [f"claims.toml: exception {n!r} is not needed" for n in sorted(exceptions - uncited)]


def check_commits(root, names, pages, numbers, exceptions):
    """Returns a fault for each commit that a JSON file or a page names and the history lacks, and notes."""
    if git(root, "rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        return [], ["commits not checked: this clone has no complete history"]
    where = {}
    for name in names:
        for commit in commits_in(numbers.file(name)):
            where.setdefault(commit, f"{RESULTS}/{name}.json")
    for name, text in pages.items():
        for match in re.finditer(r"`((?=[0-9a-f]*\d)[0-9a-f]{7,40})`", text):
            where.setdefault(match[1], f"{name}:{line_of(text, match.start())}")
    history = "\n" + git(root, "rev-list", "HEAD").stdout
    missing = {c for c in where if f"\n{c}" not in history}
    faults = [f"{where[c]}: expected commit {c} in the history, found none" for c in sorted(missing - exceptions)]
    return faults + [f"claims.toml: exception {c!r} is not needed" for c in sorted(exceptions - missing)], []


def check(root, write=False):
    """Returns the faults of a repository, the number of values checked and notes."""
    table = tomllib.loads((root / RESULTS / "claims.toml").read_text())
    exceptions = {kind: {e[kind] for e in table.get("exception", []) if kind in e} for kind in ("readme", "commit", "uncited")}
    numbers, faults, checked, notes = Numbers(root, table.get("files", {})), [], 0, []
    listed = git(root, "ls-files", "*.md").stdout.split() or [str(p.relative_to(root)) for p in root.rglob("*.md")]
    pages = {name: (root / name).read_text() for name in listed if (root / name).is_file()}
    claims, spans = {}, {}
    for claim in table.get("claim", []):
        claims.setdefault(claim["page"], []).append(claim)
    for name, of_page in claims.items():
        if name not in pages:
            faults.append(f"claims.toml: expected the page {name}, found none")
            continue
        found, wrong, count, spans[name], corrected = check_page(name, pages[name], of_page, numbers)
        checked += count
        faults += found
        if write and wrong:
            (root / name).write_text(corrected)
            notes.append(f"{name}: {len(wrong)} numbers written")
        else:
            faults += wrong
    names = sorted(p.stem for p in (root / RESULTS).glob("*.json"))
    faults += check_readme(pages.get("README.md", ""), spans.get("README.md", []), exceptions["readme"])
    faults += check_citations(names, pages, numbers, exceptions["uncited"])
    of_commits, more = check_commits(root, names, pages, numbers, exceptions["commit"])
    return faults + of_commits, checked, notes + more


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the numbers of the JSON files into the pages")
    parser.add_argument("--show", metavar="PATH", help="print what a path finds")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parent.parent, help="repository")
    arguments = parser.parse_args()
    if arguments.show:
        try:
            print(Numbers(arguments.root).calculate(arguments.show, {}))
        except Fault as fault:
            sys.exit(str(fault))
        return
    faults, checked, notes = check(arguments.root, arguments.write)
    for line in notes + faults:
        print(line)
    print(f"numbers checked {checked}, wrong {len(faults)}")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
