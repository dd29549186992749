#!/usr/bin/env python3
"""The newest version of glibc whose symbols a program for Linux asks for."""

import re
import sys


def main() -> None:
    with open(sys.argv[1], "rb") as file:
        content = file.read()
    # Names of versions stand in the table of strings, each ended by a zero.
    versions = {tuple(map(int, m.split(b"."))) for m in re.findall(rb"\0GLIBC_(\d+(?:\.\d+)+)(?=\0)", content)}
    if not versions:
        sys.exit(f"{sys.argv[1]}: no glibc in it")
    print(".".join(map(str, max(versions))))


main()
