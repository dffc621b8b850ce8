"""Run the fast tests with every supported Blender and record what came out: `make matrix`.

    python3 tools/matrix.py [VERSION …]

Each version runs in its own environment (tools/environment.py). The last result of each, with date and commit, is kept
in bench/results/matrix.json and shown on docs/versions.md; a version without a result is shown as not run.
"""

import datetime as dt
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

from environment import FOLDER_OF, python_in  # noqa: E402

from bench.markdown import put_between, table, write_whole  # noqa: E402

RESULTS = ROOT / "bench" / "results" / "matrix.json"
PAGE = ROOT / "docs" / "versions.md"
COMMAND = "make matrix"
TESTS = ["-q", "-n", "2", "--dist", "worksteal", "-m", "not window and not timing and not slow"]


def main(versions):
    known = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    for version in versions or list(FOLDER_OF):
        subprocess.run([sys.executable, ROOT / "tools" / "environment.py", "--blender", version], check=True)
        known[version] = run(python_in(ROOT / FOLDER_OF[version]))
        print(version, known[version], flush=True)
        write_whole(RESULTS, json.dumps(known, indent=1) + "\n")
        put_between(PAGE, COMMAND, shown(known), stamped=False)
    return 1 if any(one["failed"] for one in known.values()) else 0


def run(python):
    """Numbers of tests by what became of them, and when and at which commit that was."""
    done = subprocess.run([python, "-m", "pytest", *TESTS], cwd=ROOT, check=False, capture_output=True, text=True)
    print(*[line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))], sep="\n", flush=True)
    last = done.stdout.strip().splitlines()[-1] if done.stdout.strip() else ""
    counts = {word: int(number) for number, word in re.findall(r"(\d+) (passed|failed|skipped|xfailed|errors?)", last)}
    commit = subprocess.run(
        ["git", "rev-parse", "--short=10", "HEAD"], cwd=ROOT, check=False, capture_output=True, text=True
    )
    return {
        "date": dt.datetime.now(dt.timezone.utc).strftime("%Y-%m-%d"), "commit": commit.stdout.strip(),
        "passed": counts.get("passed", 0), "skipped": counts.get("skipped", 0),
        "failed": counts.get("failed", 0) + counts.get("error", 0) + counts.get("errors", 0)
        + (done.returncode not in (0, 1)),
    }  # fmt: skip


def shown(known):
    rows = [("Blender", "fast tests", "on", "at commit")]
    for version in sorted(FOLDER_OF, reverse=True):
        one = known.get(version)
        said = ("not run", "–", "–")
        if one:
            said = (
                f"{one['passed']} passed, {one['failed']} failed, {one['skipped']} skipped",
                one["date"],
                one["commit"],
            )
        rows.append((version, *said))
    return table(rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
