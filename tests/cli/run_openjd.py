# A scheduler for job templates of Open Job Description, 2023-09, as far as `surfeit plan --openjd`
# goes: run_openjd.py TEMPLATE DIRECTORY. It refuses what it does not know.
import itertools
import os
import re
import subprocess
import sys
import tempfile

import yaml

KNOWN = {
    "template": {"specificationVersion", "name", "parameterDefinitions", "steps"},
    "step": {"name", "dependencies", "hostRequirements", "parameterSpace", "script"},
    "script": {"actions", "embeddedFiles"},
    "action": {"command", "args", "timeout", "cancelation"},
}


def check(kind, value):
    unknown = set(value) - KNOWN[kind]
    assert not unknown, f"{kind} has {unknown}"


def resolve(text, values):
    """The value of a format string; a value that is not known is an error, as the rules say."""
    return re.sub(r"\{\{\s*([\w.]+)\s*\}\}", lambda found: str(values[found[1]]), text)


def tasks(step):
    """The task parameters of each task: all combinations."""
    names, ranges = [], []
    space = step.get("parameterSpace", {"taskParameterDefinitions": []})
    for parameter in space["taskParameterDefinitions"]:
        assert parameter["type"] == "INT"
        first, last = re.fullmatch(r"(\d+)-(\d+)", parameter["range"]).groups()
        names.append(parameter["name"])
        ranges.append(range(int(first), int(last) + 1))
    for values in itertools.product(*ranges):
        yield dict(zip(names, values))


def run_task(step, parameters, directory, session):
    script = step["script"]
    check("script", script)
    values = {"Param.Directory": directory, "Session.WorkingDirectory": session}
    values |= {f"Task.Param.{name}": value for name, value in parameters.items()}
    for file in script["embeddedFiles"]:
        assert file["type"] == "TEXT"
        values[f"Task.File.{file['name']}"] = os.path.join(session, file["name"])
    for file in script["embeddedFiles"]:
        with open(os.path.join(session, file["name"]), "w") as out:
            out.write(resolve(file["data"], values))
    action = script["actions"]["onRun"]
    check("action", action)
    assert isinstance(action["timeout"], int) and action["timeout"] > 0
    words = [resolve(word, values) for word in [action["command"], *action["args"]]]
    return subprocess.run(words, cwd=session, timeout=action["timeout"]).returncode


def main():
    template = yaml.safe_load(open(sys.argv[1]))
    check("template", template)
    assert template["specificationVersion"] == "jobtemplate-2023-09"
    assert 1 <= len(template["name"]) <= 128
    done = set()
    for step in template["steps"]:
        check("step", step)
        assert all(other["dependsOn"] in done for other in step.get("dependencies", []))
        amounts = {a["name"]: a["min"] for a in step["hostRequirements"]["amounts"]}
        assert amounts == {"amount.worker.vcpu": 1, "amount.worker.memory": 128}, amounts
        for parameters in tasks(step):
            with tempfile.TemporaryDirectory() as session:
                status = run_task(step, parameters, sys.argv[2], session)
            assert status == 0, f"{step['name']} {parameters}: exit status {status}"
        done.add(step["name"])


main()
