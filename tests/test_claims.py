#!/usr/bin/env python3
"""Tests that claims.py finds each fault in a small repository.

    python3 tests/test_claims.py
"""

import json
import subprocess
import tempfile
import unittest
from pathlib import Path

import claims

PAGE = "# A page\n\n| model | accuracy |\n|---|---|\n| base | 84.7 [82.7, 86.6] |\n| twice | 1 693 |\n"
README = "The base network is 84.7 % accurate on Rust 1.95.\n"
CLAIMS = """
[[claim]]
page = "page.md"
in = "study.rows"
each = ["base"]
let.r = "[*: {0}]"
text = "| {0} | {r:.1%} [{r.ci95:.1%}] |"

[[claim]]
page = "page.md"
after = "# A page"
text = "| twice | {study.rows[0] * 2000:,.0f} |"

[[claim]]
page = "README.md"
text = "is {median study.rows[model=b*].mean:.1%} % accurate"

[[exception]]
readme = "Rust 1.95"
reason = "a version"
"""


class Faults(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = Path(cls.folder.name)
        (cls.root / claims.RESULTS).mkdir(parents=True)
        (cls.root / "page.md").touch()
        (cls.root / "README.md").touch()
        cls.git("init", "-q")
        cls.git("add", ".")
        cls.git("-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-q", "-m", "pages")
        cls.head = cls.git("rev-parse", "HEAD")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        (self.root / ".git/shallow").unlink(missing_ok=True)
        (self.root / claims.RESULTS / "other.json").unlink(missing_ok=True)
        self.write("page.md", PAGE)
        self.write("README.md", README)
        self.write(f"{claims.RESULTS}/claims.toml", CLAIMS)
        self.study(0.84667, self.head[:12])

    @classmethod
    def git(cls, *arguments):
        return subprocess.run(["git", *arguments], cwd=cls.root, check=True, capture_output=True, text=True).stdout.strip()

    def write(self, name, text):
        (self.root / name).write_text(text)

    def study(self, mean, commit, name="study"):
        row = {"key": "twin: base", "model": "base", "mean": mean, "ci95": [0.827, 0.866]}
        self.write(f"{claims.RESULTS}/{name}.json", json.dumps({"git": [commit], "rows": [row]}))

    def faults(self):
        return claims.check(self.root)[0]

    def expect(self, fault):
        self.assertEqual(len(self.faults()), 1, self.faults())
        self.assertIn(fault, self.faults()[0])

    def test_right_pages_have_no_faults(self):
        self.assertEqual(claims.check(self.root), ([], 5, []))

    def test_a_wrong_number_is_found_with_page_and_line(self):
        self.write("page.md", PAGE.replace("86.6", "86.7"))
        self.expect("page.md:5: expected 82.7, 86.6, found 82.7, 86.7")

    def test_write_corrects_numbers(self):
        self.study(0.9, self.head)
        self.assertEqual(len(self.faults()), 3)
        claims.check(self.root, write=True)
        self.assertEqual(self.faults(), [])
        self.assertEqual((self.root / "page.md").read_text(), PAGE.replace("84.7", "90.0").replace("1 693", "1 800"))

    def test_a_text_that_is_not_on_the_page_is_found(self):
        self.write("page.md", PAGE.replace("| base |", "| basis |"))
        self.expect("expected one text")

    def test_a_text_that_is_on_the_page_twice_is_found(self):
        self.write("page.md", PAGE + "| base | 5 [6, 7] |\n")
        self.expect("found 2")

    def test_a_path_without_value_is_found(self):
        self.write(f"{claims.RESULTS}/claims.toml", CLAIMS.replace("model=b*", "model=c*"))
        self.expect("README.md:1: {median study.rows[model=c*].mean:.1%}")

    def test_a_lost_commit_is_found(self):
        self.study(0.84667, "0123456789ab-dirty")
        self.expect("study.json: expected commit 0123456789ab in the history, found none")

    def test_a_lost_commit_of_a_page_is_found(self):
        self.write("page.md", PAGE + "\nMeasured at `0123456789ab`.\n")
        self.expect("page.md:8: expected commit 0123456789ab")

    def test_shallow_clones_skip_commits(self):
        self.study(0.84667, "0123456789ab")
        self.write(".git/shallow", self.head + "\n")
        faults, _, notes = claims.check(self.root)
        self.assertEqual((faults, len(notes)), ([], 1))

    def test_a_json_that_nobody_cites_is_found(self):
        self.study(0.5, self.head, "other")
        self.expect("other.json: expected a page or a claim that cites it")

    def test_a_number_in_readme_without_claim_is_found(self):
        self.write("README.md", README + "It trains 7.9 times as fast.\n")
        self.expect("README.md:2: expected a claim or an exception for 7.9")

    def test_an_exception_that_nothing_needs_is_found(self):
        self.write(f"{claims.RESULTS}/claims.toml", CLAIMS + '[[exception]]\ncommit = "0123456789ab"\nreason = "none"\n')
        self.expect("exception '0123456789ab' is not needed")


if __name__ == "__main__":
    unittest.main()
