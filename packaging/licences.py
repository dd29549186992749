#!/usr/bin/env python3
"""Licences of all that is linked into the program: licences.py TARGET FILE.

Walks what cargo resolved from groundcal-cli along normal dependencies, and writes name, version, licence and the licence texts that each crate
brings. A crate without a licence, or one that is neither permissive nor MPL, ends it: somebody has to look.
"""

import json
import pathlib
import re
import subprocess
import sys

PERMISSIVE = {
    "MIT", "MIT-0", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "ISC", "Zlib", "0BSD", "Unlicense", "CC0-1.0",
    "Unicode-3.0", "Unicode-DFS-2016", "MPL-2.0", "BSL-1.0", "IJG",
}
TEXTS = re.compile(r"^(licen[cs]e|copying|notice|unlicense|copyright)", re.IGNORECASE)


def allowed(expression: str) -> bool:
    """Whether an SPDX expression can be met with permissive licences: one side of each OR, both of each AND."""
    text = expression.replace("/", " OR ").replace("(", " ( ").replace(")", " ) ")
    for name in sorted(PERMISSIVE, key=len, reverse=True):
        text = re.sub(rf"(?<![\w.-]){re.escape(name)}(?![\w.-])", " True ", text)
    text = re.sub(r"\b(?!True\b|OR\b|AND\b)[A-Za-z0-9][\w.-]*(?:\s+WITH\s+[\w.-]+)?", " False ", text)
    return bool(eval(text.replace("OR", "or").replace("AND", "and"), {"__builtins__": {}}))  # only True, False, or, and, ( )


def linked(target: str) -> list[dict]:
    command = ["cargo", "metadata", "--format-version", "1", "--filter-platform", target]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    packages = {p["id"]: p for p in metadata["packages"]}
    nodes = {n["id"]: n for n in metadata["resolve"]["nodes"]}
    start = next(i for i, p in packages.items() if p["name"] == "groundcal-cli")
    seen, waiting = set(), [start]
    while waiting:
        node = waiting.pop()
        if node in seen:
            continue
        seen.add(node)
        for dependency in nodes[node]["deps"]:
            # What runs while building (proc macros among it) is linked into nothing.
            is_macro = any("proc-macro" in t["kind"] for t in packages[dependency["pkg"]]["targets"])
            if not is_macro and any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    workspace = set(metadata["workspace_members"])
    return sorted((packages[i] for i in seen if i not in workspace), key=lambda p: (p["name"], p["version"]))


def main() -> None:
    target, out = sys.argv[1:]
    crates = linked(target)
    lines = [f"groundcal is made of these {len(crates)} libraries, too, and of Rust's standard library (MIT OR Apache-2.0).", ""]
    texts: dict[str, list[str]] = {}
    wrong = []
    for p in crates:
        licence = p["license"] or ("see its file" if p["license_file"] else "")
        if not licence or (p["license"] and not allowed(licence)):
            wrong.append(f"{p['name']} {p['version']}: {licence or 'no licence'}")
        name = f"{p['name']} {p['version']}"
        lines.append(f"{name}: {licence} ({p['repository'] or 'https://crates.io/crates/' + p['name']})")
        folder = pathlib.Path(p["manifest_path"]).parent
        for file in sorted(f for f in folder.iterdir() if f.is_file() and TEXTS.match(f.name)):
            text = "\n".join(line.rstrip() for line in file.read_text(encoding="utf-8", errors="replace").strip().splitlines())
            texts.setdefault(text, []).append(name)
    if wrong:
        sys.exit("licences to be looked at:\n" + "\n".join(wrong))
    for text, names in texts.items():
        lines += ["", "=" * 100, ", ".join(dict.fromkeys(names)), "=" * 100, text]
    pathlib.Path(out).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(crates)} libraries, {len(texts)} texts", file=sys.stderr)


main()
