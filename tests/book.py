#!/usr/bin/env python3
"""Builds the book of all pages with mkdocs-material, and fails on dead links and anchors.

    python3 tests/book.py --tactnet target/release/tactnet --out target/book     opens with target/book/site/index.html

Its order is in docs/book.yml. A line `<!-- tactnet ARGUMENTS -->` of a page is replaced by the Markdown that this command prints, under the
heading before it: these references are not committed. Needs `pip install mkdocs-material==9.8.2` and a program with the feature `full`.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GENERATED = re.compile(r"^<!-- tactnet (.*) -->$", re.MULTILINE)
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")
FENCE = re.compile(r"^(```.*?^```)", re.MULTILINE | re.DOTALL)
# Outside the book: the first page of release archives.
LEFT_OUT = {"packaging/INSTALL.md"}


def generated(page, tactnet):
    """Returns a page with the output of the commands that it names."""

    def output(match):
        arguments = match[1].split()
        printed = subprocess.run([tactnet, *arguments], check=True, capture_output=True, text=True).stdout
        printed = re.sub(r"\A# .*\n+", "", printed)
        if "man" in arguments:
            check_reference(printed)
        levels = re.findall(r"^(#+) ", FENCE.sub("", page[:match.start()]), re.MULTILINE)
        return re.sub(r"^(?=##+ )", "#" * (len(levels[-1]) - 1), printed, flags=re.MULTILINE)

    return GENERATED.sub(output, page)


def check_reference(reference):
    """Fails if the help of a command shows no example of it or of its group."""
    names = re.findall(r"^##+ (.*)", reference, re.MULTILINE)
    examples = "\n".join(FENCE.findall(reference))
    without = [name for name in names if not re.search(rf"\btactnet {name.rpartition(' ')[0] or name} ?\b", examples)]
    if without:
        sys.exit(f"expected examples in the help texts of all commands, found none of: {', '.join(without)}")


def staged(name, page, out):
    """Returns a page in the Markdown of mkdocs, and copies the files that it links to."""

    def link(match):
        text, target, anchor = match[1], match[2], match[3] or ""
        if re.match("[a-z]+:", target):
            return match[0]
        path = Path(os.path.normpath(Path(name).parent / target))
        if (ROOT / path).is_dir():
            return text
        if path.suffix != ".md" and (ROOT / path).is_file():
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / path, out / path)
        return f"[{text}]({target}{anchor})"

    parts = FENCE.split(page)
    for i in range(0, len(parts), 2):
        # A list after a paragraph needs an empty line there.
        text = re.sub(r"^((?!\s|[-*] |\d+\. ).+\n)(?=[-*] |\d+\. )", r"\1\n", parts[i], flags=re.MULTILINE)
        # Pipes in code do not end a cell, and are shown with their backslash.
        text = re.sub(r"`[^`\n]+`", lambda code: code[0].replace("\\|", "|"), text)
        parts[i] = LINK.sub(link, text)
    return "".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", required=True, help="program with all features")
    parser.add_argument("--out", type=Path, required=True, help="folder of the book; its content is replaced")
    arguments = parser.parse_args()
    out = arguments.out.resolve()
    pages = out / "pages"
    for folder in (pages, out / "site"):
        shutil.rmtree(folder, ignore_errors=True)
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    for name in listed:
        if name in LEFT_OUT or not (ROOT / name).is_file():
            continue
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        page = generated((ROOT / name).read_text(), arguments.tactnet)
        (pages / name).write_text(staged(name, page, pages))
    shutil.copyfile(ROOT / "docs/book.css", pages / "docs/book.css")
    settings = out / "mkdocs.yml"
    settings.write_text(f"INHERIT: {ROOT}/docs/book.yml\ndocs_dir: {pages}\nsite_dir: {out}/site\n")
    # Not `--quiet`: that would also drop the warnings that `--strict` counts.
    call = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", settings]
    built = subprocess.run(call, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if built.returncode:
        sys.exit(built.stdout)
    print(f"{out}/site/index.html: {len(list(pages.rglob('*.md')))} pages")


if __name__ == "__main__":
    main()
