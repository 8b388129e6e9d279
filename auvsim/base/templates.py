"""Jinja templates that stand beside the modules that fill them."""

from jinja2 import Environment, PackageLoader, StrictUndefined


def environment(package: str) -> Environment:
    """Returns an environment that loads a package's `*.html.j2`, escapes every value and refuses unknown names."""
    return Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
