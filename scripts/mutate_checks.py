#!/usr/bin/env python3
"""Takes away one check of the decoders at a time, and expects some test to fail.

    cmake --build --preset dev --target octree_test  # first: its libraries are used
    scripts/mutate_checks.py                         # compiles, then runs the tests for every check
    scripts/mutate_checks.py --list                  # the checks
    scripts/mutate_checks.py --only node_group       # of files whose path has this

Works on copies of the sources (--work DIR, default build/mutants). There every condition that leads
to a failure becomes (condition and not chosen), and every operand of an "or" by itself; the number
of the chosen one is in the environment (SURFEIT_MUTANT), so all are compiled at once. A condition is
still evaluated: what is taken away is the refusal, not the reading. Left are those with which all
tests pass.
"""
import argparse
import concurrent.futures
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time

FILES = [
    "src/storage/page_file.cpp", "src/storage/page_codec.cpp", "src/octree/page/scene_header.cpp",
    "src/octree/page/byte_planes.h", "src/octree/page/column_codec.cpp",
    "src/octree/page/transparency_columns.h", "src/octree/page/surfel_group.cpp",
    "src/octree/page/node_group.cpp", "src/octree/page/facet_columns.cpp",
    "src/octree/page/node_moments.cpp", "src/octree/page/node_references.cpp",
    "src/octree/page/lobe_columns.cpp", "src/octree/read/scene_file.cpp",
    "src/octree/read/verify.cpp", "src/octree/read/verify_bounds.cpp",
    "src/octree/read/verify_sums.cpp",
]
TESTS = ["io/page_file_test.cpp", "io/sparse_page_file_test.cpp"] + ["octree/" + name for name in (
    "column_codec_test.cpp", "surfel_group_test.cpp", "node_group_test.cpp", "node_bounds_test.cpp",
    "golden_test.cpp", "verify_test.cpp", "verify_hostile_test.cpp", "verify_sums_test.cpp",
    "scene_header_test.cpp", "lobe_columns_test.cpp", "radiosity_rewriter_test.cpp",
    "page_fields_test.cpp", "column_damage_test.cpp", "verify_claims_test.cpp")]
# Tests that only sound files pass through: less refusal does not fail them.
SKIPPED = "*.Sound*:VerifySumsTest.Clouds*:NodeBoundsTest.*:ColumnCodec.*Error*"
SLOW = .1  # Seconds: a test that takes longer is not among the quick ones.
FAILURE = (r"\s*\{?\s*(?:return\s+(?:false|damaged\(|wrongField\(|partError\(|pageError\(|"
           r"Status::corruption\(|message\(|fmt::format\()|wrong_ =|findings_?\.add\(|"
           r"packed\.take\()")
# Checks that no condition holds: (text, how it becomes one).
RETURNS = [
    (r"return (allFinite\([^;]*\));", "return {0} || {1};"),
    (r"return (largest <= kLargest);", "return {0} || {1};"),
    (r"return (std::all_of\(.*return v > 0; \}\));", "return {0} || {1};"),
    (r"return (reader\.ok\(\));", "return {0} || {1};"),
    (r"SURFEIT_RETURN_IF_ERROR\((check\w+\([^;]*\))\);",
     "SURFEIT_RETURN_IF_ERROR({1} ? Status() : {0});"),
]
CHOSEN = """
#include <cstdlib>
namespace surfeit {
inline bool isMutant(int number) {
  static const int chosen = [] {
    const char* const text = std::getenv("SURFEIT_MUTANT");
    return text == nullptr ? 0 : std::atoi(text);
  }();
  return chosen == number;
}
}  // namespace surfeit
"""


def matching(text, at):
    """The place of the bracket that closes the one at `at`."""
    depth = 0
    while True:
        if text[at] in "([{":
            depth += 1
        elif text[at] in ")]}":
            depth -= 1
            if depth == 0:
                return at
        elif text[at] == '"':
            at = text.index('"', at + 1)
        at += 1


def operands(condition):
    """The parts that || joins, as (begin, end)."""
    parts, depth, begin, at = [], 0, 0, 0
    while at < len(condition):
        if condition[at] in "([{":
            depth += 1
        elif condition[at] in ")]}":
            depth -= 1
        elif depth == 0 and condition.startswith("||", at):
            parts.append((begin, at))
            begin = at + 2
        elif depth == 0 and condition.startswith("&&", at):
            return [(0, len(condition))]
        at += 1
    return parts + [(begin, len(condition))]


class Mutants:
    def __init__(self):
        self.all = []  # file, line, text

    def take(self, path, text, place, shown):
        line = text.count("\n", 0, place) + 1
        self.all.append((path, line, " ".join(shown.split())))
        return "::surfeit::isMutant(%d)" % len(self.all)

    def edit(self, path, text):
        edits = []  # begin, end, replacement
        for found in re.finditer(r"\bif \(", text):
            begin = found.end()
            end = matching(text, found.end() - 1)
            if not re.match(FAILURE, text[end + 1:]):
                continue
            condition = text[begin:end]
            depth, init = 0, 0
            for at, letter in enumerate(condition):
                depth += (letter in "([{") - (letter in ")]}")
                if letter == ";" and depth == 0:
                    init = at + 1
            for first, last in operands(condition[init:]):
                part = condition[init + first:init + last]
                chosen = self.take(path, text, begin + init + first, part)
                edits.append((begin + init + first, begin + init + last,
                              " ((%s) && !%s) " % (part.strip(), chosen)))
        for pattern, form in RETURNS:
            for found in re.finditer(pattern, text):
                chosen = self.take(path, text, found.start(), found.group(0))
                edits.append((found.start(), found.end(), form.format(found.group(1), chosen)))
        for found in re.finditer(r"^ +(expect(?:AtLeast)?\()", text, re.M):
            begin = found.start(1)
            end = matching(text, found.end() - 1) + 2  # with the semicolon
            chosen = self.take(path, text, begin, text[begin:end])
            edits.append((begin, begin, "if (!%s) " % chosen))
        for begin, end, replacement in sorted(edits, reverse=True):
            text = text[:begin] + replacement + text[end:]
        opening = "\nnamespace surfeit {"
        return text.replace(opening, '\n#include "core/mutant.h"\n' + opening, 1)


def build(edited, arguments, program):
    """Links the tests with the edited sources in front of the libraries of the build."""
    directory, work = os.path.abspath(arguments.build), os.path.abspath(arguments.work)
    put(os.path.join(work, "src/core/mutant.h"), "#pragma once\n" + CHOSEN)
    for path, text in edited.items():
        put(os.path.join(work, path), text)
    link = subprocess.run(["ninja", "-C", directory, "-t", "commands", "tests/octree/octree_test"],
                          check=True, stdout=subprocess.PIPE, text=True).stdout.strip().split("\n")[-1]
    flags = {}
    with open(os.path.join(directory, "compile_commands.json")) as file:
        for entry in json.load(file):
            flags[entry["file"]] = entry["command"]
    of_tests = next(command for path, command in flags.items() if "octree_test.dir/Unity" in path)
    jobs = []
    for path in filter(lambda path: path.endswith(".cpp"), edited):
        jobs.append((flags[os.path.abspath(path)], os.path.join(work, path)))
    for test in TESTS:
        if os.path.exists("tests/" + test):
            jobs.append((of_tests, os.path.abspath("tests/" + test)))
    objects = [os.path.join(work, "objects", "%d.o" % i) for i in range(len(jobs))]
    os.makedirs(os.path.join(work, "objects"), exist_ok=True)

    def compile(job, output):
        command, source = job
        words = shlex.split(command)
        for option in ("-o", "-c", "-MT", "-MF"):
            if option in words:
                del words[words.index(option):words.index(option) + 2]
        words = [word for word in words if word not in ("-MD", "-Werror") and word[:2] != "-g"]
        compiler = next(i for i, word in enumerate(words) if re.search(r"(\+\+|cc|clang)[\d.-]*$", word)
                        and not word.endswith("ccache"))
        words.insert(compiler + 1, "-I" + os.path.join(work, "src"))
        subprocess.run(words + ["-O1", "-w", "-c", source, "-o", output], cwd=directory, check=True)

    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        list(pool.map(compile, jobs, objects))
    words = shlex.split(link.split("&&")[1])
    output = words.index("-o")
    words[output + 1] = program
    words = [word for word in words if "octree_test.dir" not in word]
    words[1:1] = objects
    subprocess.run(words, cwd=directory, check=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", default="build/dev", help="where octree_test is built")
    parser.add_argument("--work", default="build/mutants")
    parser.add_argument("--only", default="")
    parser.add_argument("--numbers", default="", help="such as 3,17: these alone")
    parser.add_argument("--tests", default="", help="a filter of GoogleTest: these alone")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    parser.add_argument("--no-build", action="store_true")
    arguments = parser.parse_args()
    source = os.path.abspath(os.path.join(os.path.dirname(__file__), ".."))
    os.chdir(source)
    mutants, edited = Mutants(), {}
    for path in FILES:
        if os.path.exists(path):
            edited[path] = mutants.edit(path, open(path).read())
    chosen = [i for i, (path, _, _) in enumerate(mutants.all, 1) if arguments.only in path]
    if arguments.numbers:
        chosen = [i for i in chosen if str(i) in arguments.numbers.split(",")]
    if arguments.list:
        for i in chosen:
            print("%3d %s:%d: %s" % (i, *mutants.all[i - 1]))
        return 0

    program = os.path.join(os.path.abspath(arguments.work), "mutation_test")
    if not arguments.no_build:
        build(edited, arguments, program)

    left, begin = [], time.monotonic()
    seconds = times(program, arguments.tests or "-" + SKIPPED)
    killers = {}  # of a file: the slow tests that have killed a mutant of it
    for i in chosen:
        path = mutants.all[i - 1][0]
        by = killedBy(program, i, batches(seconds, killers.setdefault(path, [])), seconds)
        print("%3d %s:%d: %s: %s" % (i, *mutants.all[i - 1], by or "LEFT"), flush=True)
        if not by:
            left.append(i)
        elif seconds.get(by, 0) > SLOW and by not in killers[path]:
            killers[path].append(by)
    print("\n| file | checks | killed | left |\n|---|---|---|---|")
    for path in FILES:
        of_file = [i for i in chosen if mutants.all[i - 1][0] == path]
        if of_file:
            alive = sum(i in left for i in of_file)
            print("| `%s` | %d | %d | %d |" % (path, len(of_file), len(of_file) - alive, alive))
    print("| all | %d | %d | %d |" % (len(chosen), len(chosen) - len(left), len(left)))
    print("%.0f s" % (time.monotonic() - begin))
    return 1 if left else 0


def put(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w") as file:
        file.write(text)


def times(program, tests):
    """The seconds of every test, all of which must pass as long as nothing is taken away."""
    with tempfile.NamedTemporaryFile(suffix=".json") as report:
        environment = dict(os.environ, SURFEIT_MUTANT="0", GTEST_FILTER=tests, GTEST_BRIEF="1",
                           GTEST_OUTPUT="json:" + report.name)
        done = subprocess.run([program], env=environment, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, errors="replace")
        if done.returncode != 0:
            sys.exit("mutate_checks.py: fails without a mutant\n" + done.stdout[-4000:])
        return {"%s.%s" % (suite["name"], test["name"]): float(test["time"].rstrip("s"))
                for suite in json.load(report)["testsuites"] for test in suite["testsuite"]}


def batches(seconds, first):
    """Lists of tests: the quick ones, then `first`, then ever slower ones."""
    in_order = sorted(seconds, key=seconds.get)
    result = [[test for test in in_order if seconds[test] <= SLOW], [*first]]
    for test in in_order:
        if seconds[test] <= SLOW or test in first:
            continue
        if sum(map(seconds.get, result[-1])) > seconds[test] or len(result) == 2:
            result.append([])
        result[-1].append(test)
    return list(filter(None, result))


def killedBy(program, number, in_batches, seconds):
    """The first test that fails, or nothing."""
    for batch in in_batches:
        failed = failing(program, number, 20 + 10 * sum(map(seconds.get, batch)), ":".join(batch))
        if failed:
            return failed
    return ""


def failing(program, number, timeout, tests):
    environment = dict(os.environ, SURFEIT_MUTANT=str(number), GTEST_FAIL_FAST="1", GTEST_BRIEF="1",
                       GTEST_FILTER=tests)
    try:
        done = subprocess.run([program], env=environment, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=timeout, errors="replace")
    except subprocess.TimeoutExpired:
        return "does not end"
    if done.returncode == 0:
        return ""
    failed = re.search(r"\[  FAILED  \] ([\w./]+)", done.stdout)
    return failed.group(1) if failed else "ends with status %d" % done.returncode


if __name__ == "__main__":
    sys.exit(main())
