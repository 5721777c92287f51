"""Thesis 6.6: residual generators as C99 source for a pump's controller, one function without memory of its own."""

import re
from collections.abc import Sequence

from pumplib.structure.codegen import Code, lines, results
from pumplib.structure.codegen_generator import ResidualGenerator


def identifier(name: str) -> str:
    """C identifier for a name.

    Parameters
    ----------
    name : str
        Any name.

    Returns
    -------
    str
        Letters, digits and underscores, no digit first.
    """
    clean = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "x"
    return clean if not clean[0].isdigit() else f"x{clean}"


def _static(name: str, code: Code, counts: Sequence[int]) -> list[str]:
    """One static function that writes the results of some code."""
    body = lines(code, "c", "    ")
    written = results(code, "c")
    body += [f"    out[{k}] = {text};" for k, text in enumerate(written)]
    text = "\n".join(body)
    loads = []
    for letter, array, count in zip("zsp", ("state", "signals", "params"), counts, strict=True):
        used = [k for k in range(count) if re.search(rf"\b{letter}{k}\b", text)]
        loads += [f"    const double {letter}{k} = {array}[{k}];" for k in used]
        loads += [] if used else [f"    (void){array};"]
    loads += [] if "*flag" in text else ["    (void)flag;"]
    return [
        f"static void {name}(const double *state, const double *signals, const double *params, double *out, int *flag)",
        "{",
        *loads,
        *body,
        "}",
        "",
    ]


def c_source(generator: ResidualGenerator, name: str | None = None) -> str:
    """C99 source of a residual generator.

    The function `NAME_step(state, inputs, params, dt)` takes the next sample and the time since the one before (zero
    for the first), returns the flag and leaves the residuals in `state`. Before the first sample the entries of the
    states z are set by the caller. The operations and their order are those of the Python code.

    Parameters
    ----------
    generator : ResidualGenerator
        From `residual_generator`.
    name : str, optional
        Prefix of all names; by default that of the generator.

    Returns
    -------
    str
        A file that needs no other; compiles with -std=c99 -Wall -Wextra -pedantic -Werror and the mathematics library.

    References
    ----------
    Thesis 6.6 (reconstruction).
    """
    prefix = identifier(name or generator.name)
    n, m, p, q = len(generator.states), len(generator.signals), len(generator.parameters), generator.outputs
    counts = (n, m, p)
    upper = prefix.upper()

    def numbered(kind: str, names: Sequence[str], first: int = 0) -> list[str]:
        return [f"    {upper}_{kind}_{identifier(one)} = {first + k}," for k, one in enumerate(names)]

    head = [
        f"/* Residual generator: {generator.name}. Generated; all quantities in SI units. */",
        "#include <math.h>",
        "",
        "enum {",
        *numbered("STATE", generator.states),
        *numbered("LAST", generator.signals, n),
        *(f"    {upper}_RESIDUAL_{k} = {n + m + k}," for k in range(q)),
        f"    {upper}_STATES = {n + m + q}",
        "};",
        "enum {",
        *numbered("INPUT", generator.signals),
        f"    {upper}_INPUTS = {m}",
        "};",
        "enum {",
        *numbered("PARAM", generator.parameters),
        f"    {upper}_PARAMS = {p}",
        "};",
        "",
        *(
            f"/* flag bit {k}: {str(one).replace('*/', '* /')} was negative, zero was used */"
            for k, one in enumerate(generator.radicands)
        ),
        f"int {prefix}_step(double *state, const double *inputs, const double *params, double dt);",
        "",
    ]
    body = [f"int {prefix}_step(double *state, const double *inputs, const double *params, double dt)", "{"]
    body += ["    int flag = 0;", "    int k;"]
    if n:
        body += [f"    double a[{n}];"]
        body += [f"    double b[{n}];", f"    double guess[{n}];"] if generator.scheme == "heun" else []
        body += ["    if (dt > 0.0) {", f"        {prefix}_rates(state, state + {n}, params, a, &flag);"]
        if generator.scheme == "heun":
            body += [
                f"        for (k = 0; k < {n}; k++)",
                "            guess[k] = state[k] + dt*a[k];",
                f"        {prefix}_rates(guess, inputs, params, b, &flag);",
                f"        for (k = 0; k < {n}; k++)",
                "            state[k] = state[k] + 0.5*dt*(a[k] + b[k]);",
            ]
        else:
            body += [f"        for (k = 0; k < {n}; k++)", "            state[k] = state[k] + dt*a[k];"]
        body += ["    }"]
    else:
        body += ["    (void)dt;"]
    body += [
        f"    {prefix}_residuals(state, inputs, params, state + {n + m}, &flag);",
        f"    for (k = 0; k < {m}; k++)",
        f"        state[{n} + k] = inputs[k];",
        "    return flag;",
        "}",
        "",
    ]
    rates = _static(f"{prefix}_rates", generator.rates, counts) if n else []
    return "\n".join([*head, *rates, *_static(f"{prefix}_residuals", generator.residuals, counts), *body])
