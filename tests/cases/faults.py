"""Runs the tests that hold each promise about faults; see faults.sh."""

import argparse
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
# Each case with the tests that hold it: a test binary of Rust and the name of a test without its domain, `python` and a test of
# bindings/python/tests, or `example` and a program that measures.
CASES = {
    "order": [
        "conformance packets_of_all_put_ports_arrive_in_the_order_of_their_puts",
        "conformance order_holds_between_put_ports_of_two_threads",
        "conformance a_late_getter_gets_the_history_of_all_put_ports_in_order",
    ],
    "fairness": ["conformance a_bulk_sender_that_connected_first_starves_nobody"],
    "priority under load": [
        "conformance urgent_packets_overtake_waiting_bulk",
        "conformance bulk_displaces_no_urgent_packet",
        "python test_urgent_packets_overtake_waiting_bulk",
        "example urgent_under_load",
    ],
    "losses": [
        "conformance losses_count_from_the_opening_and_the_putter_knows_them",
        "python test_a_putter_knows_who_lost_how_many",
    ],
    "closed ports": [
        "conformance packets_of_a_closed_put_port_arrive",
        "conformance what_a_closed_port_had_lost_is_counted",
    ],
    "small shared memory": [
        "conformance a_lack_of_shared_memory_is_an_error_that_names_the_remedy",
        "it too_little_shared_memory_is_an_error_and_no_crash",
    ],
    "two users": ["it another_user_gets_nowhere_near_a_bus"],
    "kill and restart": [
        "conformance a_wild_client_does_not_stop_channels_that_it_is_not_connected_to",
        "it a_killed_hub_is_not_missed_and_the_next_one_takes_over",
        "it a_killed_putter_leaves_its_place_and_its_memory_to_the_next",
        "it a_killed_recorder_loses_the_last_second_at_most_and_cut_files_are_read_as_far_as_they_go",
    ],
    "disk full": [
        "it a_full_disk_is_told_once_and_nothing_is_sent_again",
        "it a_file_that_may_not_be_that_large_is_an_error_in_one_line",
        "it a_full_disk_is_an_error_and_never_a_broken_checkpoint",
    ],
    "slurm: queue fails at restart": ["it a_restarted_runner_finds_its_job_although_the_queue_fails_once"],
    "slurm: banner around the job id": ["it lines_around_the_job_id_and_lost_answers_leave_no_second_job"],
    "slurm: socket timeout": ["it a_busy_controller_is_asked_again_and_a_refusal_is_final"],
    "slurm: preemption, failed node": ["it preempted_tasks_and_failed_nodes_use_up_no_attempt"],
    "slurm: out of memory": ["it a_task_out_of_memory_gets_more_or_is_given_up_by_that_name"],
    "slurm: time limit": ["it a_task_at_its_time_limit_goes_on_from_its_checkpoint"],
    "slurm: disk full": ["it a_full_disk_is_told_once_and_nothing_is_sent_again"],
    "fork": [
        "python test_fork_after_use_works_in_the_children",
        "python test_fork_during_a_training_is_refused_in_the_child",
        "python test_ports_of_a_parent_are_refused_in_a_forked_child_which_can_open_its_own",
    ],
    "failed refit": [
        "python test_a_fit_that_fails_or_is_interrupted_leaves_the_estimator_as_it_was",
        "python test_a_failed_enrolment_or_adaptation_leaves_the_estimator_as_it_was",
    ],
}
PYTHON_TESTS = ROOT / "bindings/python/tests"
# Words of a test that leaves itself out.
LEFT_OUT = re.compile(r"^(SKIPPED|left out)\b.*", re.MULTILINE)
# Maximum ratio of urgent round trips at 99 % with a bulk sender to those without.
MAX_RATIO = 2.0


def nextest(command, *arguments):
    """Returns a call of cargo-nextest for all of this build."""
    features = os.environ.get("FEATURES", "catching,fetch,recording")
    left_out = [] if features == "full" else ["--exclude", "tactnet-conv-gpu", "--exclude", "tactnet-python", "--exclude", "tactnet-c"]
    build = ["--cargo-profile", "release", "--locked", "--workspace", *left_out, "--features", features, "--color", "never"]
    return ["cargo", "nextest", command, *build, *arguments]


def rust_tests():
    """Returns binary and full name of the tests of Rust."""
    command = nextest("list", "--message-format", "json", "-E", "binary(conformance) + binary(it)")
    listed = json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout)
    suites = [suite for suite in listed["rust-suites"].values() if suite["binary-name"] in ("conformance", "it")]
    return {(suite["binary-name"], name) for suite in suites for name in suite["testcases"]}


def python_tests():
    """Returns file and name of the tests of Python."""
    files = sorted(PYTHON_TESTS.glob("test_*.py"))
    return {("python", f"{file.name}::{name}") for file in files for name in re.findall(r"^def (test_\w+)", file.read_text(), re.MULTILINE)}


def existing(test, known):
    """Returns the tests of a line of the table; a case of the channels has one for each domain."""
    kind, name = test.split()
    if kind == "example":
        return {(kind, name)} if (ROOT / f"channel/examples/{name}.rs").exists() else set()
    return {found for found in known if found[0] == kind and found[1].rsplit("::")[-1] == name}


def outcomes(file):
    """Returns None for each test of a JUnit file that is right, else the reason."""
    found = {}
    for case in ElementTree.parse(file).getroot().iter("testcase"):
        said = "\n".join(child.text or "" for child in case if child.tag in ("system-out", "system-err"))
        failed = [child for child in case if child.tag in ("failure", "error", "skipped")]
        left_out = LEFT_OUT.search(said)
        reason = failed[0].tag if failed else left_out and left_out[0]
        found[case.get("name").split("[")[0], case.get("classname")] = reason
    return found


def run_rust(tests):
    """Runs tests of Rust one at a time, and returns their outcomes."""
    selected = " + ".join(f"(binary({binary}) & test(={name}))" for binary, name in sorted(tests))
    # Its place is relative to the workspace, wherever the build is.
    file = ROOT / "target/nextest/faults/junit.xml"
    file.unlink(missing_ok=True)
    subprocess.run(nextest("run", "--profile", "faults", "-E", selected), cwd=ROOT, stdout=sys.stderr)
    found = outcomes(file) if file.exists() else {}
    named = {name: reason for (name, _), reason in found.items()}
    return {test: named.get(test[1], "it did not run") for test in tests}


def run_python(tests, target, python):
    """Runs tests of Python with the extension of this build, and returns their outcomes."""
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "tactnet"
        shutil.copytree(ROOT / "bindings/python/python/tactnet", package)
        shutil.copy(target / "release/lib_tactnet.so", package / "_tactnet.abi3.so")
        file = Path(folder) / "tests.xml"
        environment = {**os.environ, "PYTHONPATH": folder, "TACTNET": str(target / "release/tactnet")}
        names = [str(PYTHON_TESTS / name) for _, name in sorted(tests)]
        command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--junitxml", str(file), *names]
        subprocess.run(command, cwd=ROOT, env=environment, stdout=sys.stderr)
        found = outcomes(file) if file.exists() else {}
    named = {}
    for (name, _), reason in found.items():
        named[name] = named.get(name) or reason
    return {test: named.get(test[1].split("::")[1], "it did not run") for test in tests}


def run_example(name, target, measured):
    """Returns None if the urgent packets of a measurement are in time, else the reason. Appends 99th percentiles in us to `measured`."""
    program = target / "release/examples" / name
    if not program.exists():
        return f"{program} is missing"
    printed = subprocess.run([program], stdout=subprocess.PIPE, text=True).stdout
    rows = re.findall(r"^(host|link) +(none|50 MB/s) +[\d.]+ +([\d.]+)$", printed, re.MULTILINE)
    reasons = []
    for place in sorted({place for place, _, _ in rows}):
        free, loaded = (statistics.median(float(time) for of, load, time in rows if (of, load) == (place, wanted)) for wanted in ["none", "50 MB/s"])
        measured.append({"place": place, "p99_us": free, "p99_us_under_load": loaded, "ratio": round(loaded / free, 2)})
        if loaded > MAX_RATIO * free:
            reasons.append(f"{place}: 99 % of the urgent round trips take {loaded / free:.1f} times as long under load, at most {MAX_RATIO:.0f} expected")
    return "; ".join(reasons) or (None if rows else "no measurement")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--only", default="", metavar="CASES")
    parser.add_argument("--python", default=sys.executable)
    arguments = parser.parse_args()
    only = arguments.only.split(",") if arguments.only else list(CASES)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    known = rust_tests() | python_tests()
    tests = {(case, line): existing(line, known) for case in only for line in CASES[case]}
    found, measured = {}, []
    if not arguments.check:
        needed = set().union(*tests.values())
        rust = {test for test in needed if test[0] in ("conformance", "it")}
        python = {test for test in needed if test[0] == "python"}
        found |= run_rust(rust) if rust else {}
        found |= run_python(python, target, arguments.python) if python else {}
        found |= {test: run_example(test[1], target, measured) for test in needed if test[0] == "example"}
    wrong = []
    for (case, line), of_line in tests.items():
        reasons = {} if of_line else {line: "there is no such test"}
        reasons |= {" ".join(test): found[test] for test in sorted(of_line) if found.get(test)}
        wrong += [{"case": case, "test": test, "reason": reason} for test, reason in reasons.items()]
    right = len(only) - len({failure["case"] for failure in wrong})
    if arguments.json:
        git = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], cwd=ROOT, stdout=subprocess.PIPE, text=True).stdout.strip()
        result = {"schema_version": 1, "git": git, "cases": len(only), "right": right, "wrong": wrong, "urgent_packets": measured}
        print(json.dumps(result, indent=2))
    else:
        for case in only:
            print(f"{'wrong' if any(failure['case'] == case for failure in wrong) else 'right':<6} {case}")
        print(f"{right} of {len(only)} cases are right")
    for failure in wrong:
        print(f"error: {failure['case']}: {failure['test']}: {failure['reason']}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
