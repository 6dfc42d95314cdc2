"""Print how large the package, scripts and tests are: code lines, files, branches on None.

Code lines hold a token that is no comment; docstrings and blank lines do not count. ``--most N`` ends with status 1
where the package has more.
"""

import argparse
import ast
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}


def docstring_lines(tree: ast.Module) -> set[int]:
    """Line numbers of the docstrings of a module, its classes and functions."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                lines |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return lines


def code_lines(path: Path) -> int:
    """Number of lines with code."""
    lines: set[int] = set()
    with path.open("rb") as file:
        for token in tokenize.tokenize(file.readline):
            if token.type not in NO_CODE:
                lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - docstring_lines(ast.parse(path.read_bytes())))


def none_branches(path: Path) -> int:
    """Number of comparisons ``is None`` and ``is not None``."""
    return sum(
        isinstance(operator, ast.Is | ast.IsNot) and isinstance(other, ast.Constant) and other.value is None
        for node in ast.walk(ast.parse(path.read_bytes()))
        if isinstance(node, ast.Compare)
        for operator, other in zip(node.ops, node.comparators, strict=True)
    )


def main() -> None:
    """Print a row for each folder, and refuse a package over its budget."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most", type=int, help="code lines that the package may have")
    most = parser.parse_args().most
    size = {}
    print(f"{'folder':<12}{'files':>8}{'code lines':>12}{'None branches per 1,000':>26}")
    for name in ("descentflow", "scripts", "tests"):
        paths = sorted((ROOT / name).rglob("*.py"))
        lines = size[name] = sum(map(code_lines, paths))
        branches = 1000 * sum(map(none_branches, paths)) / lines
        print(f"{name:<12}{len(paths):>8,}{lines:>12,}{branches:>26.1f}")
    if most is not None and size["descentflow"] > most:
        raise SystemExit(f"the package has {size['descentflow']:,} code lines; {most:,} are allowed: take as many away")


if __name__ == "__main__":
    main()
