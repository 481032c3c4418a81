"""Cases and what is expected of them."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from signals import Array, Sweeps

#: Longest run of one command, in seconds.
PATIENCE = 60
#: Exit codes of `data check`.
FAILED, UNREADABLE = 1, 2


@dataclass
class Outcome:
    """End of a command."""

    status: int
    out: str
    err: str


class Trial:
    """Runs the program on the files of one case."""

    def __init__(self, tactnet: str, folder: Path, path: Path, options: tuple[str, ...]):
        self.tactnet, self.folder, self.path, self.options = tactnet, folder, path, options
        self._checked: Outcome | None = None

    def run(self, *arguments: str | Path) -> Outcome:
        command = [self.tactnet, *map(str, arguments)]
        try:
            ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        except subprocess.TimeoutExpired:
            return Outcome(-1, "", f"no end within {PATIENCE} s")
        return Outcome(ended.returncode, ended.stdout, ended.stderr)

    def check(self) -> Outcome:
        """Returns the end of `data check FILE --json`, which runs once."""
        if self._checked is None:
            self._checked = self.run("data", "check", self.path, "--json", *self.options)
        return self._checked

    def findings(self) -> list[dict[str, Any]]:
        try:
            return list(json.loads(self.check().out)["findings"])
        except (ValueError, KeyError):
            return []


class Expectation(Protocol):
    """One expectation; `fault` returns a sentence about what is wrong, or none."""

    def fault(self, trial: Trial) -> str | None: ...


@dataclass
class Case:
    """Files with a fault, or sound ones, and what the program is expected to say."""

    name: str
    #: Number of the item in issue 55; 0 for sound files.
    item: int
    #: Format, for `--without`.
    format: str
    #: Writes the files into an empty folder.
    make: Callable[[Path], Made]


@dataclass
class Made:
    """Files of a case."""

    path: Path
    expect: tuple[Expectation, ...]
    #: Further arguments of `data check`.
    options: tuple[str, ...] = ()


def summary(trial: Trial) -> str:
    """Returns a line about the findings of severity error or warning."""
    found = trial.findings()
    shown = [f"{of['severity']} {of['kind']} at {place(of['at'])}: {of['message'][:160]}" for of in found if of["severity"] != "note"]
    text = "; ".join(shown[:4]) + (f" and {len(shown) - 4} more" if len(shown) > 4 else "")
    said = trial.check().err.strip().splitlines()
    return f"exit {trial.check().status}: {text or ' '.join(said)[:300] or 'nothing'}"


def place(at: Mapping[str, Any]) -> str:
    return "{" + ", ".join(f"{key} {value}" for key, value in at.items() if value is not None) + "}"


@dataclass(frozen=True)
class Find:
    """A finding of a kind and severity at a place."""

    kind: str
    severity: str = "error"
    at: Mapping[str, Any] = field(default_factory=dict)
    #: Regular expression that the message contains.
    message: str = ""
    #: Number of such findings; none: at least one.
    count: int | None = None

    def fits(self, finding: Mapping[str, Any]) -> bool:
        if finding["kind"] != self.kind or finding["severity"] not in self.severity.split("|"):
            return False
        for key, value in self.at.items():
            found = finding["at"].get(key)
            right = str(found).endswith(str(value)) if key == "file" else found == value
            if not right:
                return False
        return re.search(self.message, finding["message"], re.IGNORECASE) is not None

    def fault(self, trial: Trial) -> str | None:
        fitting = [finding for finding in trial.findings() if self.fits(finding)]
        if (self.count is None and fitting) or (self.count is not None and len(fitting) == self.count):
            return None
        count = "" if self.count is None else f"{self.count} times "
        text = f"expected {count}{self.severity} {self.kind} at {place(self.at)}"
        text += f" saying /{self.message}/" if self.message else ""
        return f"{text}; found {summary(trial)}"


@dataclass(frozen=True)
class NoOther:
    """No errors and warnings but those of some kinds."""

    allowed: tuple[str, ...] = ()

    def fault(self, trial: Trial) -> str | None:
        # Single arrays do not name their rate.
        allowed = (*self.allowed, "assumed_rate") if next(trial.path.glob("**/*.npy"), None) else self.allowed
        odd = [of for of in trial.findings() if of["severity"] != "note" and of["kind"] not in allowed]
        status = trial.check().status
        if not odd and status in (0, FAILED) and (status == 0 or self.allowed):
            return None
        return f"expected no errors and warnings{' but ' + ', '.join(self.allowed) if self.allowed else ''}; found {summary(trial)}"


@dataclass(frozen=True)
class Refused:
    """Files that cannot be read, for a reason that names the cure."""

    pattern: str
    at: Mapping[str, Any] = field(default_factory=dict)

    def fault(self, trial: Trial) -> str | None:
        checked = trial.check()
        text = " ".join([checked.err, *(finding["message"] for finding in trial.findings())])
        placed = not self.at or Find("unreadable", "error", self.at).fault(trial) is None
        if checked.status == UNREADABLE and re.search(self.pattern, text, re.IGNORECASE | re.DOTALL) and placed:
            return None
        where = f" at {place(self.at)}" if self.at else ""
        return f"expected refusal{where} saying /{self.pattern}/; found {summary(trial)}; {text[:300]}"


@dataclass(frozen=True)
class Either:
    """At least one of two expectations."""

    first: Expectation
    second: Expectation

    def fault(self, trial: Trial) -> str | None:
        faults = [self.first.fault(trial), self.second.fault(trial)]
        return None if None in faults else f"{faults[0]} or {faults[1]}"


@dataclass(frozen=True)
class Says:
    """Another command whose output, and the file that it writes, contain a text."""

    arguments: tuple[str, ...]
    pattern: str
    status: int | None = None
    #: File in the case's folder that the command writes.
    file: str = ""

    def fault(self, trial: Trial) -> str | None:
        arguments = [str(trial.path) if argument == "FILE" else argument.replace("FOLDER", str(trial.folder)) for argument in self.arguments]
        ended = trial.run(*arguments)
        text = ended.out + ended.err
        written = trial.folder / self.file
        if self.file and written.is_file():
            text += written.read_text()
        if (self.status is None or ended.status == self.status) and re.search(self.pattern, text, re.IGNORECASE | re.DOTALL):
            return None
        return f"expected `{' '.join(self.arguments)}` to say /{self.pattern}/; found exit {ended.status}: {text.strip()[:400]}"


@dataclass(frozen=True)
class Rate:
    """Sample rate that `data info` shows."""

    hz: float
    tolerance: float = 1e-3

    def fault(self, trial: Trial) -> str | None:
        options = [option for option in trial.options if option != "--all"]
        shown = trial.run("data", "info", trial.path, "--json", *options)
        try:
            found = float(json.loads(shown.out)["sample_rate_hz"])
        except (ValueError, KeyError):
            return f"expected {self.hz} Hz; `data info` found {shown.err.strip()[:300]}"
        right = abs(found / self.hz - 1.0) <= self.tolerance
        return None if right else f"expected {self.hz} Hz, found {found} Hz"


@dataclass(frozen=True)
class Import:
    """Result of `data import`: numbers of sweeps, shape, rate and values."""

    sweeps: Sweeps
    arguments: tuple[str, ...] = ()
    rate: float | None = None
    rate_tolerance: float = 1e-3
    #: Largest difference of values, relative to their range.
    tolerance: float = 1e-6
    #: Steps at each end that are not compared.
    margin: int = 0
    #: Regular expression in what the command prints.
    says: str = ""
    #: True if values may differ by an offset per taxel.
    any_offset: bool = False
    blocks: bool = False
    #: Number of sweeps that the data marks as test sweeps.
    test: int | None = None

    def fault(self, trial: Trial) -> str | None:
        out = trial.folder / "imported.npz"
        arguments = [argument.replace("FOLDER", str(trial.folder)) for argument in self.arguments]
        ended = trial.run("data", "import", trial.path, "--out", out, "--force", *arguments)
        said = ended.out + ended.err
        if ended.status != 0:
            return f"expected `data import {' '.join(self.arguments)}` to succeed; found exit {ended.status}: {said.strip()[:400]}"
        if not re.search(self.says, said, re.IGNORECASE | re.DOTALL):
            return f"expected import to say /{self.says}/; found {said.strip()[:300]}"
        with np.load(out) as file:
            arrays = dict(file)
        if self.blocks and "blocks" not in arrays:
            return "expected blocks in the imported file; found none"
        if self.test is not None:
            found = int(arrays["test_flag"].sum()) if "test_flag" in arrays else None
            if found != self.test:
                return f"expected {self.test} test sweeps, found {found}"
        return self.compare(arrays)

    def compare(self, arrays: Mapping[str, Array]) -> str | None:
        names, stack = imported(arrays)
        wanted = self.sweeps
        counts = {name: names.count(name) for name in names}
        if counts != wanted.counts:
            return f"expected sweeps {wanted.counts}, found {counts}"
        shape = (wanted.steps, wanted.taxels)
        if stack.shape[1:] != shape:
            return f"expected sweeps of shape {shape}, found {stack.shape[1:]}"
        rate = float(arrays.get("sample_rate_hz", np.nan))
        if self.rate is not None and not abs(rate / self.rate - 1.0) <= self.rate_tolerance:
            return f"expected {self.rate} Hz, found {rate} Hz"
        inner = slice(self.margin, wanted.steps - self.margin)
        left = [(name, values[inner]) for name, values in zip(names, stack, strict=True)]
        for index, (name, values) in enumerate(zip(wanted.materials, wanted.values, strict=True)):
            same = [place for place, (other, found) in enumerate(left) if other == name and self.near(values[inner], found)]
            if not same:
                best = min(self.distance(values[inner], found) for other, found in left if other == name)
                return f"expected the values of sweep {index} of `{name}`, the nearest sweep differs by {best:.3g} of the range"
            left.pop(same[0])
        return None

    def near(self, wanted: Array, found: Array) -> bool:
        return self.distance(wanted, found) <= self.tolerance

    def distance(self, wanted: Array, found: Array) -> float:
        wanted = wanted.astype(float)
        difference = found.astype(float) - wanted
        if self.any_offset:
            difference = difference - difference.mean(axis=0)
        span = float(np.ptp(wanted)) or 1.0
        # Values are 32-bit floats.
        span = max(span, float(np.abs(wanted).max()) * 0.1)
        return float(np.abs(difference).max()) / span


def imported(arrays: Mapping[str, Array]) -> tuple[list[str], Array]:
    """Returns the material of each sweep of an imported file, and the values `[sweeps][steps][taxels]`."""
    samples = arrays["samples"]
    materials = [str(name) for name in arrays["materials"]]
    if samples.ndim == 5:
        names = [name for name in materials for _ in range(samples.shape[1])]
        samples = samples.reshape(-1, *samples.shape[2:])
    else:
        names = [materials[int(label)] for label in arrays["labels"]]
    return names, samples.reshape(*samples.shape[:2], -1)
