"""The report of ``hsp doctor`` on the browser that draws films."""

from hsp_control.cli.doctor import Check
from hsp_control.companions.film.chromium import find_browser


def browser() -> Check:
    """Return whether there is a browser for films."""
    found = find_browser()
    if found is None:
        return Check(
            "browser",
            "note",
            "no Chromium on the path",
            "films need one (apt-get install chromium); pages open in any browser",
        )
    return Check("browser", "ok", found)
