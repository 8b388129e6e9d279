"""docs/design.md names every package and module of the tree once, in the order of imports, and nothing else."""

import re

import design
import test_imports

PAGE = design.PAGE.read_text(encoding="utf-8")


def test_list_of_modules_is_the_tree() -> None:
    """The page's list is what `python tests/design.py` writes."""
    assert design.generated(PAGE) == design.markdown(design.modules()).strip(), "run `python tests/design.py`"


def test_every_module_stands_in_it_once_with_a_line_of_its_own() -> None:
    """Read back from the page, not from the function that wrote it."""
    files = [
        path.relative_to(design.ROOT).with_suffix("").parts
        for package in ("auvsim", "estimators")
        for path in (design.ROOT / package).rglob("*.py")
    ]
    tree = sorted(".".join(parts[:-1] if parts[-1] == "__init__" else parts) for parts in files)
    written, package = [], ""
    for line in design.generated(PAGE).splitlines():
        if heading := re.fullmatch(r"### (\S+)", line):
            package = heading[1]
            written.append(package)
        elif (row := re.fullmatch(r"\| ([\w.]+) \| (.+) \|", line)) and row[1] != "module":
            written.append(f"{package}.{row[1]}")
            assert re.search(r"\w", row[2]), f"{written[-1]} has no docstring"
    assert sorted(written) == tree


def test_packages_stand_in_the_order_of_imports() -> None:
    """Those of auvsim, and those of estimators, as `tests/test_imports.py` has them."""
    headings = re.findall(r"^### (\S+)$", PAGE, re.MULTILINE)
    ours = [name.removeprefix("auvsim.") for name in headings if name.startswith("auvsim.")]
    others = [name.removeprefix("estimators.") for name in headings if name.startswith("estimators.")]
    assert ours == list(test_imports.ORDER)
    assert others == [name for name in test_imports.ESTIMATORS if name in others]


def test_files_that_the_page_names_are_there() -> None:
    """Every `package/module.py` and link of the hand-written part."""
    written = PAGE.split(design.BEGIN)[0]
    for name in re.findall(r"`((?:\w+/)+\w+\.py)`", written):
        assert any((design.ROOT / folder / name).is_file() for folder in ("", "auvsim")), name
    for link in re.findall(r"\]\(([^)#]+)\)", written):
        assert (design.PAGE.parent / link).exists(), link
