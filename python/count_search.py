#!/usr/bin/env python3
"""Lines and numeric constants of the search for the causes of a thermal record.

    python3 python/count_search.py [--list]

Files, lines (all of them, and those with code), named numeric constants (`const NAME: ... = ...` with a digit in its
value; an array or a tuple counts once), and numbers in the code that have no name (0, 1 and 2, their fractions and the exponents of powers
are not counted; nor is an index). Tests are left out. `--list` names the constants.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent / "src" / "thermal"
FOLDER = "search"
PLAIN = {"0", "1", "2", "0.0", "1.0", "2.0", "0.5"}
CONST = re.compile(r"^\s*(?:pub(?:\([^)]*\))?\s+)?const\s+(\w+)\s*:\s*[^=]+=\s*([^;]*);", re.M | re.S)
NUMBER = re.compile(r"(?<![\w.])(\d[\d_]*(?:\.\d+)?(?:e-?\d+)?)(?:_?(?:f64|usize|i32|u64))?(?![\w.])")


def production(text):
    """The source without comments, strings and its tests at the end."""
    text = re.split(r"^#\[cfg\(test\)\]", text, flags=re.M)[0]
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text, flags=re.S)
    return re.sub(r"//[^\n]*", "", text)


def count():
    lines = code = files = loose = 0
    named = []
    for path in sorted((ROOT / FOLDER).rglob("*.rs")):
        if path.name.endswith("_tests.rs"):
            continue
        text = path.read_text()
        whole = re.split(r"^#\[cfg\(test\)\]", text, flags=re.M)[0]
        files += 1
        lines += whole.count("\n")
        bare = production(text)
        code += sum(bool(line.strip()) for line in bare.splitlines())
        for name, value in CONST.findall(bare):
            if re.search(r"\d", value):
                named.append(f"{path.relative_to(ROOT)}: {name} = {' '.join(value.split())}")
        rest = re.sub(r"powi\(\d+\)|\[\d+\]|\.\d+\b(?!\d)", "", CONST.sub("", bare))
        loose += sum(n not in PLAIN for n in NUMBER.findall(rest))
    return files, lines, code, named, loose


def main():
    files, lines, code, named, loose = count()
    print(f"{'files':>6} {'lines':>6} {'code':>6} {'constants':>10} {'unnamed numbers':>16}")
    print(f"{files:6} {lines:6} {code:6} {len(named):10} {loose:16}")
    if "--list" in sys.argv[1:]:
        print("\n".join("  " + line for line in named))


if __name__ == "__main__":
    main()
