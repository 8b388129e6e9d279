"""The part of docs/design.md that lists every module: `python tests/design.py` writes it again from the docstrings."""

import ast
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from test_imports import ESTIMATORS, ORDER

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "design.md"
BEGIN, END = "<!-- modules: written by `python tests/design.py` -->", "<!-- end of modules -->"


def modules(root: Path = ROOT) -> dict[str, str]:
    """First line of the docstring of every module and package of auvsim and estimators, by dotted name."""
    paths = [path for package in ("auvsim", "estimators") for path in (root / package).rglob("*.py")]
    return {_name(path.relative_to(root)): _first_line(path) for path in sorted(paths)}


def packages(names: Iterable[str]) -> list[str]:
    """Packages auvsim and estimators and those right below them, in the order in which they may import each other."""
    found = {".".join(name.split(".")[:2]) for name in names if "__main__" not in name}
    known = ["estimators", *(f"estimators.{name}" for name in ESTIMATORS), "auvsim", *(f"auvsim.{n}" for n in ORDER)]
    return [name for name in known if name in found] + sorted(found - set(known))


def markdown(known: dict[str, str]) -> str:
    """A heading with one line for each package, and a table of its modules."""
    lines, listed = [], packages(known)
    for package in listed:
        lines += [f"### {package}", "", known[package], ""]
        inside = [name for name in known if name.startswith(f"{package}.") and name not in listed]
        if package in ("auvsim", "estimators"):
            inside = [name for name in inside if name.count(".") == 1]
        lines += _table(inside, package, known)
    return "\n".join(lines)


def generated(page: str) -> str:
    """The part of the page between the marks."""
    return page.split(BEGIN)[1].split(END)[0].strip()


def _table(names: Sequence[str], package: str, known: dict[str, str]) -> Iterator[str]:
    if names:
        yield from ("| module | its one thing |", "|---|---|")
        yield from (
            f"| {name.removeprefix(f'{package}.')} | {known[name].replace('|', chr(92) + '|')} |" for name in names
        )
        yield ""


def _name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _first_line(path: Path) -> str:
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]


if __name__ == "__main__":
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{BEGIN}\n\n{markdown(modules())}\n{END}{after}", encoding="utf-8")
