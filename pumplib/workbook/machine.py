"""Thesis, all chapters: what machine and which versions a result was made with."""

import importlib.metadata
import os
import platform
from pathlib import Path


def machine() -> dict[str, str | int]:
    """Describe this machine.

    Returns
    -------
    dict
        CPU model, architecture, number of cores, operating system.
    """
    cpu = platform.processor() or platform.machine()
    listing = Path("/proc/cpuinfo")
    if listing.exists():
        lines = listing.read_text(encoding="utf-8").splitlines()
        models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        cpu = models[0] if models else cpu
    return {
        "cpu": cpu,
        "architecture": platform.machine(),
        "cores": os.cpu_count() or 1,
        "os": f"{platform.system()} {platform.release()}",
    }


def versions(*packages: str) -> dict[str, str]:
    """Versions of Python and of some packages.

    Parameters
    ----------
    *packages : str
        Names as on the package index.

    Returns
    -------
    dict of str to str
        ``python`` and the packages that are installed.
    """
    found = {"python": platform.python_version()}
    for name in packages:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def drawing_platform() -> dict[str, str]:
    """What the bytes of a figure depend on beside its data.

    Returns
    -------
    dict of str to str
        Versions of the drawing and computing libraries, architecture and CPU model.
    """
    here = machine()
    return {
        **versions("matplotlib", "numpy", "scipy", "numba", "pandas"),
        "architecture": str(here["architecture"]),
        "cpu": str(here["cpu"]),
    }
