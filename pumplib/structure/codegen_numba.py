"""Thesis 6.6: the compiled loop of a residual generator, written as source and kept in the package's cache."""

import hashlib
import os
import sys
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from pumplib.decide import strict  # sets the cache folder; the generated code imports its decorators
from pumplib.structure.codegen import Code, lines, results

Scheme = Literal["heun", "euler"]
_ROOM = strict.__name__
_IMPORTS = (f"from {_ROOM} import strict_inline as inline", f"from {_ROOM} import strict_kernel as kernel")


def _function(name: str, arguments: Sequence[str], code: Code) -> list[str]:
    returned = "".join(f"{text}, " for text in results(code, "python"))
    return [
        "",
        "",
        "@inline",
        f"def {name}({', '.join((*arguments, 'flag'))}):",
        *lines(code, "python", "    "),
        f"    return {returned}flag",
    ]


def python_source(states: int, signals: int, parameters: int, rates: Code, residuals: Code, scheme: Scheme) -> str:
    """Source of the compiled loop.

    Parameters
    ----------
    states, signals, parameters : int
        Numbers of each.
    rates, residuals : Code
        Straight-line code in the variables z0.., s0.., p0...
    scheme : {"heun", "euler"}
        Integration rule.

    Returns
    -------
    str
    """
    z = [f"z{k}" for k in range(states)]
    s = [f"s{k}" for k in range(signals)]
    p = [f"p{k}" for k in range(parameters)]
    old, guess = [f"old{k}" for k in range(signals)], [f"g{k}" for k in range(states)]
    a, b = [f"a{k}" for k in range(states)], [f"b{k}" for k in range(states)]
    body = []
    if states:
        step = [f"{', '.join((*a, 'flag'))} = rates({', '.join((*z, *old, *p, 'flag'))})"]
        if scheme == "heun":
            step += [f"{g} = {x} + dt*{d}" for g, x, d in zip(guess, z, a, strict=True)]
            step += [f"{', '.join((*b, 'flag'))} = rates({', '.join((*guess, *s, *p, 'flag'))})"]
            step += [f"{x} = {x} + 0.5*dt*({d} + {e})" for x, d, e in zip(z, a, b, strict=True)]
        else:
            step += [f"{x} = {x} + dt*{d}" for x, d in zip(z, a, strict=True)]
        body = ["        if dt > 0.0:", *(f"            {line}" for line in step)]
    found = [f"r{k}" for k in range(len(residuals.results))]
    text = [
        "import math",
        "",
        *_IMPORTS,
        *(_function("rates", (*z, *s, *p), rates) if states else []),
        *_function("residuals", (*z, *s, *p), residuals),
        "",
        "",
        "@kernel",
        "def run(state, inputs, steps, parameters, residual, states, flags):",
        *(f"    {x} = state[{k}]" for k, x in enumerate(z)),
        *(f"    {x} = state[{states + k}]" for k, x in enumerate(old)),
        *(f"    {x} = parameters[{k}]" for k, x in enumerate(p)),
        "    for k in range(inputs.shape[0]):",
        "        dt = steps[k]",
        "        flag = 0",
        *(f"        {x} = inputs[k, {j}]" for j, x in enumerate(s)),
        *body,
        f"        {', '.join((*found, 'flag'))} = residuals({', '.join((*z, *s, *p, 'flag'))})",
        *(f"        residual[k, {j}] = {x}" for j, x in enumerate(found)),
        *(f"        states[k, {j}] = {x}" for j, x in enumerate(z)),
        "        flags[k] = flag",
        *(f"        {o} = {x}" for o, x in zip(old, s, strict=True)),
        *(f"    state[{k}] = {x}" for k, x in enumerate(z)),
        *(f"    state[{states + k}] = {x}" for k, x in enumerate(old)),
        "",
    ]
    return "\n".join(text)


@lru_cache(maxsize=256)
def compiled_source(text: str) -> Any:
    """Compile the source of a loop; machine code is kept on disk.

    Parameters
    ----------
    text : str
        From `python_source`.

    Returns
    -------
    callable
        The loop.
    """
    folder = Path(os.environ["NUMBA_CACHE_DIR"]) / "generated"
    name = f"pumplib_generated_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    path = folder / f"{name}.py"
    # Only the text in memory is executed; the file gives numba a place and a date for its cache.
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(f".{os.getpid()}")
        draft.write_text(text)
        draft.replace(path)
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module  # numba looks the module up by its name when it loads machine code
    exec(compile(text, str(path), "exec"), module.__dict__)
    return module.__dict__["run"]
