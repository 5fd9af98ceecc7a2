"""Public names of a package from its stub, imported at their first use."""

import sys
from collections.abc import Callable
from typing import Any

import lazy_loader


def public_names(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return a package's ``__getattr__``, ``__dir__`` and ``__all__`` (PEP 562).

    Args:
        package: Its ``__name__``.
        file: Its ``__file__``, beside which is the stub: ``__init__.pyi``.
    """
    find, listed, names = lazy_loader.attach_stub(package, file)

    def attribute(name: str) -> Any:
        if name not in names:
            raise unknown(package, name)
        return find(name)

    return attribute, listed, names


def unknown(package: str, name: str, hint: str = "") -> AttributeError:
    """Return the error that Python raises itself: its traceback says what was meant."""
    message = f"module {package!r} has no attribute {name!r}{hint}"
    return AttributeError(message, name=name, obj=sys.modules[package])
